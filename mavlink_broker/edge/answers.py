"""What the edge server's answers mean.

`PostOutcome` classifies the answer to a post: settled, sent before, withdrawn, refused, or to
be sent again. `EdgeClock` estimates the edge server's time of day from its answers.

ForeignAnswerError  somebody else answered in the place of the edge server
"""

import logging
from collections import deque
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from http import HTTPStatus
from typing import Final, Self

import requests
from pydantic import AwareDatetime, TypeAdapter, ValidationError

from mavlink_broker.edge.bounded_http import Answer, cause_of
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.wire import VEHICLE_LANE, AcceptanceResult, is_acknowledgement

MAX_LOGGED_CHARACTERS: Final = 500
"""Longest logged text of a refusal."""
KNOWN: Final = "Idempotency-Key was used"
"""The edge server's refusal of another body under a key that it has received before."""
ANSWERS_KEPT: Final = 16
"""Within so many long polls a drift of 100 ppm adds up to 30 ms."""
SET_BACK_S: Final = 1.0
"""More than the clocks drift apart within the answers that are kept."""
FIRST_TRIP_S: Final = 1.0
"""Longest exchange of a first answer whose time is used to judge orders: an order expires after 10
s or more."""

_RETRIED: Final = frozenset(
    {
        HTTPStatus.UNAUTHORIZED,
        HTTPStatus.FORBIDDEN,
        HTTPStatus.REQUEST_TIMEOUT,
        HTTPStatus.TOO_EARLY,
        HTTPStatus.TOO_MANY_REQUESTS,
    }
)
_TEMPORARY: Final = _RETRIED | {HTTPStatus.SERVICE_UNAVAILABLE, HTTPStatus.INSUFFICIENT_STORAGE}
_WITHDRAWN: Final = frozenset({HTTPStatus.NOT_FOUND, HTTPStatus.CONFLICT, HTTPStatus.GONE})
"""Answers to an acknowledgement of work that is cancelled, expired or ended."""
_REFUSALS: Final = HTTPStatus.BAD_REQUEST
"""Status codes from here on."""
_TIME: Final[TypeAdapter[datetime]] = TypeAdapter(AwareDatetime)
_LOG = logging.getLogger(__name__)


class ForeignAnswerError(requests.RequestException):
    """Somebody else answered in the place of the edge server."""


def explain(answer: Answer) -> str:
    """Give the reason of a refusal: the edge server's sentence, then each fault of a field.

    What is not the edge server's, such as the page of a proxy, is given as one line.
    """
    try:
        document = answer.json()
        faults = [
            f"{path} {text}" if text[:1].islower() else f"{path}: {text}"
            for fields in document.get("detail", {}).values()
            for path, texts in fields.items()
            for text in texts
        ]
        sentence = str(document["message"])
    except (requests.RequestException, AttributeError, KeyError, TypeError):
        return " ".join(answer.text.split())
    return f"{sentence}: {'; '.join(faults)}" if faults else sentence


def is_final(status_code: int) -> bool:
    """Whether a repeated request would get the same answer."""
    is_answer = 200 <= status_code < 300 or 400 <= status_code < 500
    return is_answer and status_code not in _RETRIED


def is_temporary_refusal(status_code: int) -> bool:
    """Whether the edge server refuses until a condition outside the request changes."""
    return status_code in _TEMPORARY


@dataclass(frozen=True, slots=True)
class PostOutcome:
    """The answer to a post, or why there was none."""

    post: Post
    status: int | None  # None: there was no answer
    text: str  # Names field and reason of a refusal
    is_settled: bool = False  # The edge server's own answer, which a repetition would get again

    @classmethod
    def of(cls, post: Post, answer: Answer | Exception, *, is_own: bool) -> Self:
        """Judge an answer; `is_own` if it is the edge server's, as of `examined`."""
        if isinstance(answer, Exception):
            return cls(post, None, cause_of(answer)[:MAX_LOGGED_CHARACTERS])
        status, text = answer.status_code, explain(answer)[:MAX_LOGGED_CHARACTERS]
        return cls(post, status, text, is_own and is_final(status))

    @property
    def reason(self) -> str:
        """Why the post was not taken."""
        if self.status is None:
            return self.text
        return f"HTTP {self.status}: {self.text}" if self.text else f"HTTP {self.status}"

    @property
    def is_temporary(self) -> bool:
        """Whether it is refused until a condition outside the request changes."""
        return self.status is not None and is_temporary_refusal(self.status)

    @property
    def loses_nothing(self) -> bool:
        """Whether no data is lost: a success, or a refusal of known or ended work.

        An acknowledgement of work that the edge server has withdrawn or closed has no effect.
        """
        return self._is_success or self._was_sent_before or self._is_withdrawn

    @property
    def acceptance_result(self) -> AcceptanceResult | None:
        """What the last answer to an acceptance means; None for any other post."""
        work_id = self.post.accepted_work_id
        if work_id is None:
            return None
        if self._is_success:
            return AcceptanceResult(work_id, is_confirmed=True)
        if self.status in _WITHDRAWN:
            return AcceptanceResult(work_id, is_confirmed=False, reason=self.text)
        reason = f"the edge server did not confirm the acceptance: {self.reason}"
        return AcceptanceResult(work_id, is_confirmed=False, reason=reason, has_failed=True)

    def log_refusal(self) -> None:
        """Log a final answer, if it is a refusal."""
        what, why = _name_of(self.post), self.reason
        if self._is_success:
            return
        if self._was_sent_before:
            _LOG.info("%s was sent before", what)
        elif self._is_withdrawn:
            _LOG.warning("%s is not accepted: %s", what, why)
        elif self.post.is_inherited:
            _LOG.warning("%s, by an earlier run, is refused: %s", what, why)
        else:
            _LOG.error("%s is refused: %s", what, why)

    def log_given_up(self) -> None:
        """Log that the post is not sent again."""
        by_whom = ", by an earlier run," if self.post.is_inherited else ""
        _LOG.error("%s%s is given up: %s", _name_of(self.post), by_whom, self.reason)

    @property
    def _is_success(self) -> bool:
        return self.status is not None and self.status < _REFUSALS

    @property
    def _was_sent_before(self) -> bool:
        is_refused_body = self.status == HTTPStatus.UNPROCESSABLE_ENTITY
        return self.post.may_be_duplicate and is_refused_body and KNOWN in self.text

    @property
    def _is_withdrawn(self) -> bool:
        return is_acknowledgement(self.post) and self.status in _WITHDRAWN


def _name_of(post: Post) -> str:
    """Name a post as an operator knows it."""
    if is_acknowledgement(post):
        status, work_id = post.body["status"], post.path.split("/")[3]
        return f'the answer "{status}" of vehicle {post.vehicle_id} to work {work_id}'
    if post.lane == VEHICLE_LANE:
        return f"the state of vehicle {post.vehicle_id}"
    return f"the {post.path.strip('/').replace('_', ' ')} of vehicle {post.vehicle_id}"


def examined(answer: Answer | Exception) -> tuple[Answer | Exception, bool]:
    """Give an answer, and whether it is the edge server's: its answers are JSON objects.

    A success or redirection of somebody else becomes an error.
    """
    if isinstance(answer, Exception):
        return answer, False
    try:
        if isinstance(answer.json(), dict):
            return answer, True
    except requests.RequestException as error:
        _LOG.debug("an answer is not JSON: %s", error)
    if answer.status_code >= _REFUSALS:
        return answer, False
    return ForeignAnswerError(f"HTTP {answer.status_code} is not of the edge server"), False


class EdgeClock:
    """The edge server's time of day on this program's monotonic clock.

    Work expires by the edge server's clock: an abort within 10 s. A broker on another machine,
    whose clock is wrong, would refuse every abort as expired, or carry out one that
    has expired.

    An answer names the time at which it was written and arrives later: of several answers the one
    that was in transit for the shortest time is the most accurate. It was written after its
    request was sent, so that a time which is too early even for that moment is that of a clock
    which was set back, or of another edge server. An answer that is merely read late, as by a
    broker that was suspended for minutes, changes nothing: an order in it has expired meanwhile.

    The first answer has none before it that would show how long it was in transit. It is requested
    without a wait, so that it counts as written at once: an order in it may be older than its time.
    If it was long in transit, as with an edge server that was just starting, the time is not
    settled before the next one.
    """

    def __init__(self) -> None:
        self._ahead_s: deque[float] = deque(maxlen=ANSWERS_KEPT)  # [s] Of the monotonic clock
        self._first_at_most_s: float | None = None  # The same, until there is a second answer

    def read(self, written: object, sent_at: float, now: float) -> datetime | None:
        """Give the present time of day after an answer; None while none has named one to be used.

        `written` is the time as the answer has it; request and answer at monotonic times [s]. The
        second answer settles the time, whatever it names.
        """
        if self._ahead_s:
            self._first_at_most_s = None
        try:
            if isinstance(written, str):
                self.note(_TIME.validate_python(written), sent_at, now)
            return self.time(now)
        except (ValidationError, OverflowError):
            _LOG.warning("the time of the edge server's answer cannot be used: %.40r", written)
            return None

    def note(self, written: datetime, sent_at: float, now: float) -> None:
        """Take the time that an answer names; request and answer at monotonic times [s]."""
        at_least_s, at_most_s = written.timestamp() - now, written.timestamp() - sent_at
        is_first = not self._ahead_s
        if not is_first and at_most_s < max(self._ahead_s) - SET_BACK_S:
            self._ahead_s.clear()
        self._ahead_s.append(at_least_s)
        self._first_at_most_s = at_most_s if is_first else None

    @property
    def is_settled(self) -> bool:
        """Whether work may be judged by it: not by a first answer that was long in transit."""
        first_s = self._first_at_most_s
        return first_s is None or first_s - max(self._ahead_s) <= FIRST_TRIP_S

    def time(self, now: float) -> datetime | None:
        """Give the edge server's time of day at a monotonic time [s]; None without an answer."""
        if not self._ahead_s:
            return None
        first_s = self._first_at_most_s
        ahead_s = max(self._ahead_s) if first_s is None else first_s
        return datetime.fromtimestamp(0.0, UTC) + timedelta(seconds=ahead_s + now)
