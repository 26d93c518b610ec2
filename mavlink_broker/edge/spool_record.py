"""One line of a spool file: a post that waits, or numbers of posts that have been answered. Pure.

    <CRC-32 of the rest, 8 hexadecimal digits> <JSON without line breaks>

A line is validated as strictly as input from the network: a path that is none of the edge server's
would send the broker's access key to another server.

RecordError  a line that is truncated, damaged, or not written by the broker
"""

import json
import zlib
from collections.abc import Iterable
from typing import Annotated, Any, Final, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mavlink_broker.edge.outbox import DeadLetter, Post, Urgency

_CHECKSUM_LENGTH: Final = 9
"""Eight digits and a blank."""
_PATH: Final = r"^/([a-z_]{1,40}/|broker/commands/[0-9]{1,18}/ack)$"
_KEY: Final = r"^[!-~]{1,64}$"
_NUMBER: Final = Field(ge=1, le=2**53)


class RecordError(Exception):
    """A line that cannot be read."""


class PendingPost(NamedTuple):
    """A post and its number."""

    number: int
    post: Post


class AnsweredPosts(NamedTuple):
    """Numbers of posts that have their final answer."""

    numbers: tuple[int, ...]


class _PostRecord(BaseModel):
    """A post as it is stored."""

    model_config = ConfigDict(extra="forbid", strict=True)

    number: Annotated[int, _NUMBER]
    path: Annotated[str, Field(pattern=_PATH)]
    key: Annotated[str, Field(pattern=_KEY)] | None
    vehicle_id: int
    lane: Annotated[str, Field(pattern=r"^[a-z_]{1,40}$")]
    urgency: Annotated[int, Field(ge=min(Urgency), le=max(Urgency))]
    may_be_known: bool
    body: dict[str, Any]


class _DeadLetterRecord(_PostRecord):
    """A dead letter as it is stored."""

    reason: Annotated[str, Field(max_length=2000)]


class _AnsweredRecord(BaseModel):
    """Answered posts as they are stored."""

    model_config = ConfigDict(extra="forbid", strict=True)

    answered: list[Annotated[int, _NUMBER]]


def encode_post(number: int, post: Post) -> bytes:
    """Give the line of a post."""
    return _with_checksum(_document_of(number, post))


def encode_dead_letter(number: int, letter: DeadLetter) -> bytes:
    """Give the line of a dead letter."""
    return _with_checksum(_document_of(number, letter.post) | {"reason": letter.reason[:2000]})


def encode_answered(numbers: Iterable[int]) -> bytes:
    """Give the line that records which posts have their final answer."""
    return _with_checksum({"answered": sorted(numbers)})


def decode_dead_letter(line: bytes) -> tuple[int, DeadLetter]:
    """Read the line of a dead letter; gives its number too.

    Raises:
        RecordError: if it is incomplete or not valid.
    """
    try:
        record = _DeadLetterRecord.model_validate(_document(line))
    except ValidationError as error:
        raise _record_error(error) from error
    return record.number, DeadLetter(_post(record), record.reason)


def decode(line: bytes) -> PendingPost | AnsweredPosts:
    """Read a line.

    Raises:
        RecordError: if it is incomplete or not valid.
    """
    document = _document(line)
    try:
        if isinstance(document, dict) and "answered" in document:
            return AnsweredPosts(tuple(_AnsweredRecord.model_validate(document).answered))
        record = _PostRecord.model_validate(document)
    except ValidationError as error:
        raise _record_error(error) from error
    return PendingPost(record.number, _post(record))


def _document_of(number: int, post: Post) -> dict[str, Any]:
    return {
        "number": number,
        "path": post.path,
        "key": post.idempotency_key,
        "vehicle_id": post.vehicle_id,
        "lane": post.lane,
        "urgency": int(post.urgency),
        "may_be_known": post.may_be_duplicate,
        "body": post.body,
    }


def _record_error(error: ValidationError) -> RecordError:
    first = error.errors()[0]
    path = ".".join(str(step) for step in first["loc"])
    return RecordError(f"{path}: {first['msg']}")


def _post(record: _PostRecord) -> Post:
    """Give the post; the run that wrote it has registered its vehicle, or this one soon will."""
    return Post(
        method="POST",
        path=record.path,
        body=record.body,
        vehicle_id=record.vehicle_id,
        lane=record.lane,
        urgency=Urgency(record.urgency),
        idempotency_key=record.key,
        needs_registration=False,
        may_be_duplicate=record.may_be_known,
        spool_number=record.number,
        is_inherited=True,
    )


def _with_checksum(document: dict[str, Any]) -> bytes:
    text = json.dumps(document, separators=(",", ":")).encode("ascii")
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _document(line: bytes) -> Any:
    checksum, text = line[:_CHECKSUM_LENGTH], line[_CHECKSUM_LENGTH:-1]
    if not line.endswith(b"\n") or checksum != b"%08x " % zlib.crc32(text):
        raise RecordError("truncated or damaged")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordError(f"not JSON: {error}") from error
