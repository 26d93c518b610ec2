/** Code that is loaded once, and again after it could not be loaded. */

/** A file of the console could not be loaded. */
export class NotLoadedError extends Error {}

export class LoadedOnce<Value> {
  /** Undefined until it is loaded. */
  value: Value | undefined;
  #promise: Promise<Value> | null = null;
  #hasFailed = false;

  constructor(readonly load: () => Promise<Value>) {}

  /** The same promise until a failure is forgotten: React asks again whenever it renders. */
  promise(): Promise<Value> {
    this.#promise ??= this.load().then(
      (value) => (this.value = value),
      (reason: unknown) => {
        this.#hasFailed = true;
        throw new NotLoadedError(String(reason));
      },
    );
    return this.#promise;
  }

  /** Lets the next call load again if the last one failed. */
  forgetFailure(): void {
    if (this.#hasFailed) this.#promise = null;
    this.#hasFailed = false;
  }

  /** Loads ahead of need, so that a failure is not remembered; false for a failure. */
  async preload(): Promise<boolean> {
    try {
      await this.promise();
      return true;
    } catch {
      this.forgetFailure();
      return false;
    }
  }
}
