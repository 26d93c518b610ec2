"""Posts and dead letters as bytes of the broker's database; pure.

    <CRC-32 of the rest, 8 hexadecimal digits> <JSON>

They are validated as strictly as input from the network: a path that is none of the edge server's
would send the broker's access key to another server.

RecordError  bytes that are truncated, damaged, or not written by the broker
"""

import json
import zlib
from typing import Annotated, Any, Final, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mavlink_broker.edge.outbox import DeadLetter, Post, Urgency

_CHECKSUM_LENGTH: Final = 9
"""Eight digits and a blank."""
_PATH: Final = r"^/([a-z_]{1,40}/|broker/commands/[0-9]{1,18}/ack)$"
_KEY: Final = r"^[!-~]{1,64}$"
_NUMBER: Final = Field(ge=1, le=2**53)


class RecordError(Exception):
    """Bytes that cannot be read."""


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
    is_retried: bool = False
    body: dict[str, Any]


class _DeadLetterRecord(_PostRecord):
    """A dead letter as it is stored."""

    reason: Annotated[str, Field(max_length=2000)]


R = TypeVar("R", bound=_PostRecord)


def encode_post(number: int, post: Post) -> bytes:
    """Encode a post under its number."""
    return _with_checksum(_document_of(number, post))


def encode_dead_letter(number: int, letter: DeadLetter) -> bytes:
    """Encode a dead letter under its number."""
    return _with_checksum(_document_of(number, letter.post) | {"reason": letter.reason[:2000]})


def decode_post(number: int, data: bytes) -> Post:
    """Decode the post of a number.

    Raises:
        RecordError: if it is incomplete or not valid.
    """
    return _post(_validated(_PostRecord, number, data))


def decode_dead_letter(number: int, data: bytes) -> DeadLetter:
    """Decode the dead letter of a number.

    Raises:
        RecordError: if it is incomplete or not valid.
    """
    record = _validated(_DeadLetterRecord, number, data)
    return DeadLetter(_post(record), record.reason)


def _validated(kind: type[R], number: int, data: bytes) -> R:
    try:
        record = kind.model_validate(_document(data))
    except ValidationError as error:
        first = error.errors()[0]
        path = ".".join(str(step) for step in first["loc"])
        raise RecordError(f"{path}: {first['msg']}") from error
    if record.number != number:
        raise RecordError(f"number: it is that of post {record.number}")
    return record


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
        # Alone where it is true: an earlier version refuses fields that it does not know
        **({"is_retried": True} if post.is_retried else {}),
    }


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
        is_retried=record.is_retried,
    )


def _with_checksum(document: dict[str, Any]) -> bytes:
    text = json.dumps(document, separators=(",", ":")).encode("ascii")
    return b"%08x %s" % (zlib.crc32(text), text)


def _document(data: bytes) -> Any:
    checksum, text = data[:_CHECKSUM_LENGTH], data[_CHECKSUM_LENGTH:]
    if checksum != b"%08x " % zlib.crc32(text):
        raise RecordError("truncated or damaged")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordError(f"not JSON: {error}") from error
