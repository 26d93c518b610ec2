"""What the cloud's answer to a record means; one table, pure."""

import json
from enum import StrEnum
from http import HTTPStatus
from typing import Final, NamedTuple, TypeAlias


class Answer(NamedTuple):
    """An HTTP answer, as far as it matters here."""

    status: int
    content_type: str = ""
    body: bytes = b""
    retry_after_s: float | None = None


class Unreachable(NamedTuple):
    """No answer: refused, timed out, cut off, or no proof that it is the cloud."""

    reason: str


class Failed(NamedTuple):
    """No answer, since an error of our own has prevented the try."""

    reason: str


Reply: TypeAlias = Answer | Unreachable | Failed


class Meaning(StrEnum):
    """What to do with the record."""

    CONFIRMED = "confirmed"  # The cloud has it: delete
    TRY_LATER = "try later"  # Not now: keep and try again
    NO_CLOUD = "no cloud"  # Not the record's fault, nor one stream's: the way is blocked
    NO_ACCESS = "no access"  # Our key is not accepted: pause everything, tell the operator
    REJECTED = "rejected"  # The cloud will never take it: dead letter, the next one goes on
    NO_PLACE = "no place"  # The cloud has no place for this kind: the kind waits, ten tries each
    HELD_BACK = "held back"  # Not tried: one before it in its stream has to go first


class Verdict(NamedTuple):
    """A meaning and its reason in words."""

    meaning: Meaning
    reason: str
    status: int = 0
    retry_after_s: float | None = None


_RETRIED_4XX: Final = frozenset({408, 425, 429})
_CONFIRMING: Final = frozenset({200, 201, 203, 204, 205})
_REFUSALS: Final = {
    401: (Meaning.NO_ACCESS, "401 refuses our key"),
    403: (Meaning.NO_ACCESS, "403 refuses our key"),
    404: (Meaning.NO_PLACE, "404 knows no such address"),
    410: (Meaning.NO_PLACE, "410 has given the address up"),
    424: (Meaning.HELD_BACK, "424 waits for the one before it"),
}


def judge(reply: Reply) -> Verdict:
    """Classify a reply."""
    if isinstance(reply, Unreachable):
        return Verdict(Meaning.NO_CLOUD, reply.reason)
    if isinstance(reply, Failed):
        return Verdict(Meaning.TRY_LATER, reply.reason)
    meaning, reason = _meaning(reply)
    return Verdict(meaning, reason, reply.status, reply.retry_after_s)


def _meaning(answer: Answer) -> tuple[Meaning, str]:
    status = answer.status
    if status in _CONFIRMING:
        if _comes_from_a_cloud(answer):
            return Meaning.CONFIRMED, f"{status}"
        return Meaning.NO_CLOUD, f"{status} with a body that is not JSON"
    if 300 <= status < 400:
        return Meaning.NO_CLOUD, f"{status} redirects elsewhere"
    if 400 <= status < 500 and status not in _RETRIED_4XX:
        return _refusal(answer)
    return Meaning.TRY_LATER, f"{status} is no confirmation"


def _refusal(answer: Answer) -> tuple[Meaning, str]:
    if answer.status == HTTPStatus.CONFLICT and _says_duplicate(answer):
        return Meaning.CONFIRMED, f"{answer.status} and the cloud has it already"
    return _REFUSALS.get(answer.status, (Meaning.REJECTED, f"{answer.status} rejects the record"))


def _comes_from_a_cloud(answer: Answer) -> bool:
    """A captive portal answers 200 too; its page is HTML."""
    return not answer.body.strip() or _document(answer) is not _NO_JSON


def _says_duplicate(answer: Answer) -> bool:
    """Whether the cloud refuses the record because it has this very one: it is there."""
    document = _document(answer)
    return isinstance(document, dict) and document.get("outcome") == "duplicate"


_NO_JSON: Final = object()


def _document(answer: Answer) -> object:
    """The JSON of an answer, _NO_JSON when it is something else."""
    media_type = answer.content_type.partition(";")[0].strip().lower()
    if media_type != "application/json" and not media_type.endswith("+json"):
        return _NO_JSON
    try:
        return json.loads(answer.body)
    except (ValueError, RecursionError):
        return _NO_JSON
