"""Posts and dead letters on disk, in the broker's database, with a limit.

`Spool` has the posts that wait for the edge server. `Report` means every post but a picture here:
reports, alarms, result sets and acknowledgements exist in the broker alone, while a picture is
still on its vehicle. Where there is no space for reports all pictures are evicted. A post for which
there is no space waits in memory.

`DeadLetters` has the posts that the edge server never accepted, until a person decides. A post that
is refused for good would be refused again, and one that fails again and again while others are
answered blocks the posts behind it. Either is removed from its lane, stored here with the reason,
and sent again or removed by a person: `python -m mavlink_broker dead-letters`. That command only
adds requests, which the running broker or the next one carries out and then removes: those that a
killed broker has taken are carried out by the next.

A row's bytes are:

    <CRC-32 of the rest, 8 hexadecimal digits> <JSON>

They are validated as strictly as input from the network: a path that is none of the edge server's
would send the broker's access key to another server.

RecordError  bytes that are truncated, damaged, or not written by the broker
"""

import errno
import json
import logging
import zlib
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mavlink_broker.database import Database, read_rows
from mavlink_broker.edge.outbox import DeadLetter, Post, Urgency

MIB: Final = 1 << 20
ROWS_PER_DELETION: Final = 50
"""Rows deleted in one transaction, which fits into the reserve of the database."""
PICTURES_SHARE: Final = 2
"""Divisor: the part of the space that pictures may use."""
DEAD_LETTERS_SHARE: Final = 4
"""Divisor: the size of the separate space of the dead letters."""

_CHECKSUM_LENGTH: Final = 9
"""Eight digits and a blank."""
_PATH: Final = r"^/([a-z_]{1,40}/|broker/commands/[0-9]{1,18}/ack)$"
_KEY: Final = r"^[!-~]{1,64}$"
_NUMBER: Final = Field(ge=1, le=2**53)
_POSTS: Final = "SELECT number, is_picture, CAST(data AS BLOB) FROM posts ORDER BY number"
_DEAD_LETTERS: Final = "SELECT number, CAST(data AS BLOB) FROM dead_letters ORDER BY number"

_LOG = logging.getLogger(__name__)


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


class StoredLetter(NamedTuple):
    """A dead letter and its number."""

    number: int
    letter: DeadLetter


class Actions(NamedTuple):
    """What a person requests for dead letters, by number."""

    retry: frozenset[int] = frozenset()
    drop: frozenset[int] = frozenset()


class DeadLetters:
    """The dead letters of one broker."""

    def __init__(self, database: Database, max_bytes: int) -> None:
        """Read those of an earlier run; invalid ones are set aside.

        Raises:
            OSError: if they cannot be read.
        """
        self._database = database
        self._max_bytes = max_bytes
        self._letters: dict[int, DeadLetter] = {}
        self._sizes: dict[int, int] = {}  # [bytes] By number
        self._taken = 0  # The newest request that was taken
        for number, data in database.read(_DEAD_LETTERS):
            try:
                self._letters[number] = decode_dead_letter(number, data)
                self._sizes[number] = len(data)
            except RecordError as error:
                database.set_aside("dead_letters", number, str(error))

    @property
    def by_vehicle(self) -> dict[int, int]:
        """The number of dead letters of each vehicle."""
        return Counter(letter.post.vehicle_id for letter in self._letters.values())

    def __contains__(self, number: int) -> bool:
        return number in self._letters

    def add(self, number: int, letter: DeadLetter) -> None:
        """Store one; the oldest are removed where there is no space.

        Raises:
            OSError: if the disk refuses.
        """
        data = encode_dead_letter(number, letter)
        while self._letters and sum(self._sizes.values()) + len(data) > self._max_bytes:
            oldest = min(self._letters)
            _LOG.error("dead letter %d is removed: there is no space", oldest)
            self.remove({oldest})
        with self._database.change(len(data)) as rows:
            rows.execute("INSERT OR REPLACE INTO dead_letters VALUES (?, ?)", (number, data))
        self._letters[number], self._sizes[number] = letter, len(data)

    def get(self, number: int) -> Post | None:
        """Give the post of one to be sent again; the letter stays until it is removed."""
        letter = self._letters.get(number)
        if letter is None:
            return None
        return replace(
            letter.post,
            attempts=0,
            may_be_duplicate=True,
            spool_number=None,
            is_inherited=True,
            is_retried=True,
        )

    def remove(self, numbers: Collection[int]) -> None:
        """Remove some.

        Raises:
            OSError: if the disk refuses; the next run finds them again.
        """
        for number in numbers:
            self._letters.pop(number, None)
            self._sizes.pop(number, None)
        with self._database.change() as rows:
            rows.executemany(
                "DELETE FROM dead_letters WHERE number = ?", [(number,) for number in numbers]
            )

    @property
    def highest(self) -> int:
        """The highest number of a dead letter; 0 without any."""
        return max(self._letters, default=0)

    def take_actions(self) -> Actions:
        """Read the actions that a person has requested; `complete_actions` removes them.

        Raises:
            OSError: if they cannot be read.
        """
        requested = self._database.read("SELECT id, action, CAST(number AS INTEGER) FROM requests")
        self._taken = max((identifier for identifier, _, _ in requested), default=0)
        return Actions(
            frozenset(number for _, action, number in requested if action == "retry"),
            frozenset(number for _, action, number in requested if action == "drop"),
        )

    def complete_actions(self) -> None:
        """Remove the actions that were taken: they are carried out.

        Raises:
            OSError: if the disk refuses; they are carried out again, which changes nothing.
        """
        if self._taken:
            with self._database.change() as rows:
                rows.execute("DELETE FROM requests WHERE id <= ?", (self._taken,))
            self._taken = 0


def read_dead_letters(folder: Path) -> Sequence[StoredLetter]:
    """Read the dead letters of a folder without changing it; none if there is no database.

    Raises:
        OSError: if they cannot be read.
    """
    letters = []
    for number, data in read_rows(folder, _DEAD_LETTERS):
        try:
            letters.append(StoredLetter(number, decode_dead_letter(number, data)))
        except RecordError:
            continue  # The broker logs it
    return letters


class Spool:
    """Posts that wait, on disk; for one thread at a time."""

    def __init__(self, database: Database, *, max_bytes: int) -> None:
        """Read the posts of an earlier run; invalid ones are set aside and counted.

        Raises:
            OSError: if they cannot be read.
        """
        self.database = database
        self.dead_letters = DeadLetters(database, max_bytes // DEAD_LETTERS_SHARE)
        self.damaged = 0  # Posts that could not be read
        self._max_bytes = max_bytes
        self._reports: dict[int, int] = {}  # [bytes] By number
        self._pictures: dict[int, int] = {}
        self._evicted: set[int] = set()
        self._released: set[int] = set()  # Not removed from the disk yet
        self._inherited = self._recover()
        with suppress(OSError):
            self.release(frozenset())
        self._number = max(self.dead_letters.highest, *self._reports, *self._pictures, 0)

    def __contains__(self, number: int) -> bool:
        return number in self._reports or number in self._pictures

    def take_inherited(self) -> Sequence[Post]:
        """Give the posts of an earlier run, in order; once."""
        inherited, self._inherited = self._inherited, []
        return inherited

    def next_number(self) -> int:
        """Give a number that no post has had."""
        self._number += 1
        return self._number

    def store_reports(self, posts: Iterable[Post]) -> None:
        """Write posts other than pictures, each under its number, those of one lane in order.

        Raises:
            OSError: if the disk refuses; the first of them may be stored nevertheless.
        """
        encoded = _encoded(posts)
        try:
            self._add_reports(encoded)
        except OSError:
            if len(encoded) == 1:
                raise
            for number, data in encoded.items():
                self._add_reports({number: data})

    def store_pictures(self, posts: Iterable[Post]) -> None:
        """Write pictures, within their share of the space.

        Raises:
            OSError: if there is no space; the first of them may be stored nevertheless.
        """
        reports_bytes = sum(self._reports.values())
        limit = min(self._max_bytes // PICTURES_SHARE, self._max_bytes - reports_bytes)
        for number, data in _encoded(posts).items():
            if sum(self._pictures.values()) + len(data) > limit:
                raise OSError(errno.ENOSPC, "their share is used up")
            self._insert({number: data}, self._pictures)

    def take_evicted(self) -> frozenset[int]:
        """Give the numbers of the pictures that were evicted since the last call."""
        evicted, self._evicted = frozenset(self._evicted), set()
        return evicted

    def release(self, numbers: frozenset[int]) -> None:
        """Remove posts that have their final answer.

        Raises:
            OSError: if the disk refuses; they are removed with the next ones.
        """
        for number in numbers:
            if self._reports.pop(number, None) or self._pictures.pop(number, None):
                self._released.add(number)
        if self._released:
            self._delete(self._released)
            self._released.clear()

    def _add_reports(self, encoded: Mapping[int, bytes]) -> None:
        """Add all or none."""
        size = sum(self._reports.values()) + sum(map(len, encoded.values()))
        if size > self._max_bytes:
            raise OSError(errno.ENOSPC, f"{self._max_bytes // MIB} MiB are used up")
        if size + sum(self._pictures.values()) > self._max_bytes:
            self._evict_pictures()
        try:
            self._insert(encoded, self._reports)
        except OSError:
            if not self._pictures:
                raise
            self._evict_pictures()  # The disk may be full because of them
            self._insert(encoded, self._reports)

    def _evict_pictures(self) -> None:
        self._delete(self._pictures)
        self._evicted |= self._pictures.keys()
        self._pictures.clear()

    def _insert(self, encoded: Mapping[int, bytes], kind: dict[int, int]) -> None:
        is_picture = kind is self._pictures
        with self.database.change(sum(map(len, encoded.values()))) as rows:
            rows.executemany(
                "INSERT OR REPLACE INTO posts VALUES (?, ?, ?)",
                [(number, is_picture, data) for number, data in encoded.items()],
            )
        kind.update({number: len(data) for number, data in encoded.items()})

    def _delete(self, numbers: Collection[int]) -> None:
        ordered = sorted(numbers)
        for start in range(0, len(ordered), ROWS_PER_DELETION):
            some = [(number,) for number in ordered[start : start + ROWS_PER_DELETION]]
            with self.database.change() as rows:
                rows.executemany("DELETE FROM posts WHERE number = ?", some)

    def _recover(self) -> list[Post]:
        """Read the posts of an earlier run; those that became dead letters are released."""
        posts = []
        for number, is_picture, data in self.database.read(_POSTS):
            try:
                post = decode_post(number, data)
            except RecordError as error:
                self.damaged += 1
                self.database.set_aside("posts", number, str(error))
                continue
            if number in self.dead_letters:
                self._released.add(number)
                continue
            (self._pictures if is_picture else self._reports)[number] = len(data)
            posts.append(post)
        return posts


def _encoded(posts: Iterable[Post]) -> dict[int, bytes]:
    return {
        post.spool_number: encode_post(post.spool_number, post)
        for post in posts
        if post.spool_number
    }
