"""What the cloud's answer to a record means: one table; pure."""

from enum import StrEnum
from http import HTTPStatus
from typing import Final, NamedTuple, TypeAlias

from afarcloud import wire
from afarcloud.faults import Fault, SyntaxFaultError


class Answer(NamedTuple):
    """The parts of an HTTP response that decide about a record."""

    status: int
    content_type: str = ""
    body: bytes = b""
    retry_after_s: float | None = None


class Unreachable(NamedTuple):
    """No answer: refused, timed out, cut off, or the peer has not proved that it is the cloud."""

    reason: str


class Failed(NamedTuple):
    """No answer, because an error in this program prevented the attempt."""

    reason: str


Reply: TypeAlias = Answer | Unreachable | Failed


class Outcome(StrEnum):
    """What to do with the record; the values are also labels of metrics."""

    CONFIRMED = "confirmed"  # The cloud has it: delete it
    TRY_LATER = "try later"  # Not accepted now: keep it and retry
    NO_CLOUD = "no cloud"  # The cloud is not reachable: the whole uplink is blocked
    NO_ACCESS = "no access"  # The cloud refuses our key: pause the uplink and log an error
    REJECTED = "rejected"  # The cloud never accepts it: dead letter, the next record is sent
    NO_ENDPOINT = "no place"  # The cloud has no endpoint for this kind: the kind waits, ten tries
    HELD_BACK = "held back"  # Not tried: an earlier record of its stream has to be sent first


class Result(NamedTuple):
    """An outcome and the reason for it."""

    outcome: Outcome
    reason: str
    status: int = 0
    retry_after_s: float | None = None


LONGEST_REASON: Final = 200
"""Characters of a reason in the cloud's words."""
_REASONS: Final = ("detail", "message", "error", "title")
_RETRIED_4XX: Final = frozenset({408, 425, 429})
_CONFIRMING: Final = frozenset({200, 201, 203, 204, 205})
_REFUSALS: Final = {
    401: (Outcome.NO_ACCESS, "401 refuses our key"),
    403: (Outcome.NO_ACCESS, "403 refuses our key"),
    404: (Outcome.NO_ENDPOINT, "404 no such endpoint"),
    410: (Outcome.NO_ENDPOINT, "410 the endpoint is gone"),
    424: (Outcome.HELD_BACK, "424 waits for an earlier record"),
}


def classify(reply: Reply) -> Result:
    """Return what a reply means for its record."""
    if isinstance(reply, Unreachable):
        return Result(Outcome.NO_CLOUD, reply.reason)
    if isinstance(reply, Failed):
        return Result(Outcome.TRY_LATER, reply.reason)
    outcome, reason = _outcome(reply)
    return Result(outcome, reason, reply.status, reply.retry_after_s)


def _outcome(answer: Answer) -> tuple[Outcome, str]:
    status = answer.status
    if status in _CONFIRMING:
        if _comes_from_a_cloud(answer):
            return Outcome.CONFIRMED, f"{status}"
        return Outcome.NO_CLOUD, f"{status} with a body that is not JSON"
    if 300 <= status < 400:
        return Outcome.NO_CLOUD, f"{status} redirects elsewhere"
    if 400 <= status < 500 and status not in _RETRIED_4XX:
        return _refusal(answer)
    return Outcome.TRY_LATER, f"{status} is no confirmation"


def _refusal(answer: Answer) -> tuple[Outcome, str]:
    if answer.status == HTTPStatus.CONFLICT:
        if _is_duplicate(answer):
            return Outcome.CONFIRMED, f"{answer.status} and the cloud has it already"
        if _is_called_json(answer) and not _comes_from_a_cloud(answer):
            return Outcome.TRY_LATER, f"{answer.status} with a body that is not JSON"
    refusal = _REFUSALS.get(answer.status)
    if refusal is not None:
        return refusal
    stated = _stated_reason(answer)
    rejects = f"{answer.status} rejects the record"
    return Outcome.REJECTED, f"{rejects}: {stated}" if stated else rejects


def _stated_reason(answer: Answer) -> str:
    """The reason in the cloud's own words, as one line that can be shown; empty without one.

    By RFC 9457 it is `detail`; others name it otherwise.
    """
    document = _document(answer)
    fields = document if isinstance(document, dict) else {}
    stated = next((fields[name] for name in _REASONS if isinstance(fields.get(name), str)), "")
    shown = "".join(one if one.isprintable() else " " for one in stated[:LONGEST_REASON])
    return " ".join(shown.split())


def _comes_from_a_cloud(answer: Answer) -> bool:
    """Whether the body is empty or JSON; a captive portal answers 200 with an HTML page."""
    return not answer.body.strip() or _document(answer) is not _NO_JSON


def _is_duplicate(answer: Answer) -> bool:
    """Whether the cloud refuses the record because it has the same record already."""
    document = _document(answer)
    return isinstance(document, dict) and document.get("outcome") == "duplicate"


_NO_JSON: Final = object()


def _refuse_constant(name: str) -> object:
    """NaN and the infinities are not JSON (RFC 8259 section 6)."""
    raise SyntaxFaultError((Fault("", f"{name} is not JSON"),))


def _is_called_json(answer: Answer) -> bool:
    media_type = answer.content_type.partition(";")[0].strip().lower()
    return media_type == "application/json" or media_type.endswith("+json")


def _document(answer: Answer) -> object:
    """Return the JSON of an answer, _NO_JSON if it is not JSON.

    It is read as what is sent to the edge server: with a member twice it says nothing.
    """
    if not _is_called_json(answer):
        return _NO_JSON
    try:
        return wire.parse_json(answer.body, _refuse_constant)
    except SyntaxFaultError:
        return _NO_JSON
