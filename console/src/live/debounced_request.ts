/** When a question that a person changes is asked, and which answers count. Pure but for its timers. */

/** How long a question has to stay the same. */
export const PAUSE_MS = 350;
/** How often a question is asked that changes all the time, as while something is dragged. */
export const FOLLOWING_MS = 200;

export class DebouncedRequest<Question, Answer> {
  private waiting: { question: Question; number: number } | null = null;
  private pause: ReturnType<typeof setTimeout> | undefined;
  private following: ReturnType<typeof setTimeout> | undefined;
  private isFollowed = false;
  private unanswered = 0;
  private askedAtMs = -Infinity;
  /** Number of the last question that was put, and of the newest that is answered. */
  private last = 0;
  private answered = 0;

  constructor(
    private readonly ask: (question: Question) => Promise<Answer>,
    /** Called with each answer to a newer question than that of the answer before. */
    private readonly deliver: (answer: Answer, question: Question) => void,
    private readonly fail: (reason: unknown, question: Question) => void,
  ) {}

  /** Asks after a pause; a question that is followed also before, while no other one is on its way. */
  change(question: Question, isFollowed: boolean): void {
    this.last += 1;
    this.waiting = { question, number: this.last };
    this.isFollowed = isFollowed;
    clearTimeout(this.pause);
    this.pause = setTimeout(() => this.send(), PAUSE_MS);
    this.follow();
  }

  /** Asks nothing more, and delivers no answer to what was asked before. */
  cancel(): void {
    this.last += 1;
    this.answered = this.last;
    this.waiting = null;
    clearTimeout(this.pause);
    clearTimeout(this.following);
    this.following = undefined;
  }

  private follow(): void {
    if (!this.isFollowed || this.waiting === null || this.unanswered > 0 || this.following !== undefined) return;
    const rest_ms = Math.max(0, this.askedAtMs + FOLLOWING_MS - Date.now());
    this.following = setTimeout(() => this.send(), rest_ms);
  }

  private send(): void {
    clearTimeout(this.pause);
    clearTimeout(this.following);
    this.following = undefined;
    if (this.waiting === null) return;
    const { question, number } = this.waiting;
    this.waiting = null;
    this.unanswered += 1;
    this.askedAtMs = Date.now();
    const isNews = () => {
      this.unanswered -= 1;
      if (number <= this.answered) return false;
      this.answered = number;
      return true;
    };
    this.ask(question)
      .then(
        (answer) => isNews() && this.deliver(answer, question),
        (reason: unknown) => isNews() && this.fail(reason, question),
      )
      .finally(() => this.follow());
  }
}
