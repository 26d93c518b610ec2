"""One line of a spool's file: a post that waits, or posts that have been answered. Pure.

    <CRC-32 of the rest, 8 hexadecimal digits> <JSON without line breaks>

What a line says is believed as little as what comes over the network: a path that is none of ours
would send our access key to somebody else's server.

RecordError  a line that is torn, damaged, or not of our making
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


class Waiting(NamedTuple):
    """A post under its number."""

    number: int
    post: Post


class Settled(NamedTuple):
    """Numbers of posts that have their answer."""

    numbers: tuple[int, ...]


class _Told(BaseModel):
    """A post as a line says it."""

    model_config = ConfigDict(extra="forbid", strict=True)

    number: Annotated[int, _NUMBER]
    path: Annotated[str, Field(pattern=_PATH)]
    key: Annotated[str, Field(pattern=_KEY)] | None
    vehicle_id: int
    lane: Annotated[str, Field(pattern=r"^[a-z_]{1,40}$")]
    urgency: Annotated[int, Field(ge=min(Urgency), le=max(Urgency))]
    may_be_known: bool
    body: dict[str, Any]


class _Dead(_Told):
    """A post that was given up, as a line says it."""

    reason: Annotated[str, Field(max_length=2000)]


class _Answered(BaseModel):
    """Posts that have their answer, as a line says it."""

    model_config = ConfigDict(extra="forbid", strict=True)

    answered: list[Annotated[int, _NUMBER]]


def line_of(number: int, post: Post) -> bytes:
    """Write a post down."""
    return _sealed(_document_of(number, post))


def line_of_dead(number: int, letter: DeadLetter) -> bytes:
    """Write a dead letter down."""
    return _sealed(_document_of(number, letter.post) | {"reason": letter.reason[:2000]})


def read_dead(line: bytes) -> tuple[int, DeadLetter]:
    """Read the line of a dead letter; gives its number too.

    Raises:
        RecordError: if it is not whole, or does not say what a line may say.
    """
    try:
        dead = _Dead.model_validate(_document(line))
    except ValidationError as error:
        raise _fault(error) from error
    return dead.number, DeadLetter(_post(dead), dead.reason)


def _document_of(number: int, post: Post) -> dict[str, Any]:
    return {
        "number": number,
        "path": post.path,
        "key": post.idempotency_key,
        "vehicle_id": post.vehicle_id,
        "lane": post.lane,
        "urgency": int(post.urgency),
        "may_be_known": post.may_be_known,
        "body": post.body,
    }


def line_of_answered(numbers: Iterable[int]) -> bytes:
    """Write down which posts have their answer."""
    return _sealed({"answered": sorted(numbers)})


def read(line: bytes) -> Waiting | Settled:
    """Read a line.

    Raises:
        RecordError: if it is not whole, or does not say what a line may say.
    """
    document = _document(line)
    try:
        if isinstance(document, dict) and "answered" in document:
            return Settled(tuple(_Answered.model_validate(document).answered))
        told = _Told.model_validate(document)
    except ValidationError as error:
        raise _fault(error) from error
    return Waiting(told.number, _post(told))


def _fault(error: ValidationError) -> RecordError:
    first = error.errors()[0]
    path = ".".join(str(step) for step in first["loc"])
    return RecordError(f"{path}: {first['msg']}")


def _post(told: _Told) -> Post:
    """Give the post; its vehicle was registered by whoever wrote it, or soon will be."""
    return Post(
        method="POST",
        path=told.path,
        body=told.body,
        vehicle_id=told.vehicle_id,
        lane=told.lane,
        urgency=Urgency(told.urgency),
        idempotency_key=told.key,
        needs_registration=False,
        may_be_known=told.may_be_known,
        kept_as=told.number,
        is_inherited=True,
    )


def _sealed(document: dict[str, Any]) -> bytes:
    text = json.dumps(document, separators=(",", ":")).encode("ascii")
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _document(line: bytes) -> Any:
    checksum, text = line[:_CHECKSUM_LENGTH], line[_CHECKSUM_LENGTH:-1]
    if not line.endswith(b"\n") or checksum != b"%08x " % zlib.crc32(text):
        raise RecordError("torn or damaged")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordError(f"no JSON: {error}") from error
