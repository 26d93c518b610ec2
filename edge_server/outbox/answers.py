"""What the cloud's answer to a record means; one table, pure."""

import json
from enum import StrEnum
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


Reply: TypeAlias = Answer | Unreachable


class Meaning(StrEnum):
    """What to do with the record."""

    CONFIRMED = "confirmed"  # The cloud has it: delete
    TRY_LATER = "try later"  # Not now: keep and try again
    NO_CLOUD = "no cloud"  # Not the record's fault, nor one stream's: the way is blocked
    NO_ACCESS = "no access"  # Our key is not accepted: pause everything, tell the operator
    REJECTED = "rejected"  # The cloud will never take it: dead letter, the next one goes on


class Verdict(NamedTuple):
    """A meaning and its reason in words."""

    meaning: Meaning
    reason: str
    status: int = 0
    retry_after_s: float | None = None


_RETRIED_4XX: Final = frozenset({408, 425, 429})
_CONFIRMING: Final = frozenset({200, 201, 203, 204, 205})


def judge(reply: Reply) -> Verdict:
    """Classify a reply."""
    if isinstance(reply, Unreachable):
        return Verdict(Meaning.NO_CLOUD, reply.reason)
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
    if status in {401, 403}:
        return Meaning.NO_ACCESS, f"{status} refuses our key"
    if 400 <= status < 500 and status not in _RETRIED_4XX:
        return Meaning.REJECTED, f"{status} rejects the record"
    return Meaning.TRY_LATER, f"{status} is no confirmation"


def _comes_from_a_cloud(answer: Answer) -> bool:
    """A captive portal answers 200 too; its page is HTML."""
    if not answer.body.strip():
        return True
    media_type = answer.content_type.partition(";")[0].strip().lower()
    if media_type != "application/json" and not media_type.endswith("+json"):
        return False
    try:
        json.loads(answer.body)
    except (ValueError, RecursionError):
        return False
    return True
