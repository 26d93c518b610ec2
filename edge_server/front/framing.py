"""Where a request of HTTP/1.1 ends in what a connection receives; sans-IO.

It reads as much of a head as gives the length of the body (RFC 9112 section 6.3) and leaves the
rest to the server's parser. A head that it cannot frame goes to that parser as it is, as the last
request of its connection: the parser refuses it. What the parser would take or find too late is
refused here, with the status in `Taken.refusal`: a head that is too long, a version of HTTP that
does not exist, a field that may stand once and stands twice (RFC 9110 section 5.3; the parser would
join them), and a body that is broken (RFC 9112 section 7.1) or too large.

One thread frames the requests of all clients, so the work for a body is bounded by its bytes: the
number of chunks has a limit that grows with the payload.

HEAD and BODY: more bytes are needed. READY: a request can be taken.

```mermaid
stateDiagram-v2
    HEAD --> BODY: head complete, body expected
    HEAD --> READY: head complete, no body
    HEAD --> READY: no head that can be framed
    BODY --> READY: body complete
    BODY --> READY: too large, or a broken chunk: refused
    READY --> HEAD: taken
```
"""

import re
from collections.abc import Callable
from enum import Enum, auto
from typing import Final, NamedTuple

MAXIMUM_HEAD_BYTES: Final = 65_536
MAXIMUM_BODY_BYTES: Final = 2 * 1024 * 1024
"""Of a body that is kept here, chunk sizes included; the application refuses smaller ones."""
_HEAD_END: Final = b"\r\n\r\n"
_LONGEST_LINE_BYTES: Final = 8192  # Of a chunk's size with its extensions, or of a trailer
CHUNKS_ALLOWED: Final = 1024
"""So many chunks a body may have, however little is in them."""
LEAST_CHUNK_BYTES: Final = 64
"""Mean payload of the chunks beyond those."""
MAXIMUM_TRAILERS: Final = 64
_TOKEN: Final = rb"[!#$%&'*+\-.^_`|~0-9A-Za-z]+"  # RFC 9110 section 5.6.2
_QUOTED: Final = rb'"(?:[\t !#-\[\]-~\x80-\xff]|\\[\t -~\x80-\xff])*"'  # RFC 9110 section 5.6.4
_EXTENSION: Final = rb"[ \t]*;[ \t]*%b(?:[ \t]*=[ \t]*(?:%b|%b))?" % (_TOKEN, _TOKEN, _QUOTED)
_CHUNK_SIZE: Final = re.compile(rb"0*([0-9A-Fa-f]{1,8})(?:%b)*" % _EXTENSION)
_TRAILER: Final = re.compile(rb"(%b):[\t -~\x80-\xff]*" % _TOKEN)
_NO_TRAILERS: Final = frozenset(
    {b"authorization", b"content-length", b"host", b"te", b"trailer", b"transfer-encoding"}
)
"""Fields that say how a message is framed, routed or authorized (RFC 9110 section 6.5.1)."""
BAD_REQUEST: Final = 400
TOO_LARGE: Final = 413
TOO_LONG_LINE: Final = 414
TOO_LONG_HEAD: Final = 431
UNKNOWN_CODING: Final = 501
UNKNOWN_VERSION: Final = 505
_VERSION: Final = re.compile(rb"HTTP/[0-9]+(?:\.[0-9]+)?")
_VERSIONS: Final = frozenset({b"HTTP/1.0", b"HTTP/1.1"})
_ONCE: Final = frozenset(
    {
        *(b"authorization", b"content-encoding", b"content-type", b"host", b"idempotency-key"),
        *(b"x-api-key", b"x-jws-signature"),
    }
)
"""Fields of which two cannot both be meant."""
_LENGTH: Final = re.compile(rb"[0-9]{1,18}")


class Stage(Enum):
    """How far a request has come."""

    HEAD = auto()
    BODY = auto()
    READY = auto()


class Taken(NamedTuple):
    """The bytes of one request; `is_whole` when the next one may follow behind them.

    `refusal` is the HTTP status of the answer when the request must not reach the application.
    """

    raw: bytes
    is_whole: bool
    refusal: int | None = None
    why: str | None = None  # Where the status alone does not show it


class _RefusedError(Exception):
    """The body cannot be framed, or is too large; `status` is the HTTP status of the answer."""

    def __init__(self, status: int) -> None:
        super().__init__(status)
        self.status = status


class RequestFraming:
    """The bytes of one connection, cut into requests."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._start_request()

    def _start_request(self) -> None:
        self.stage = Stage.HEAD
        self._searched = 0  # Up to here there is no end of the head
        self._end: int | None = None  # Of the request, when it is known
        self._next_chunk: int | None = None  # Where the next size, or trailer, begins
        self._in_trailers = False
        self._chunks = 0
        self._payload_bytes = 0
        self._trailers = 0
        self._is_whole = True
        self._refusal: int | None = None
        self._why: str | None = None
        self.wants_continue = False

    @property
    def kept_bytes(self) -> int:
        """How much is kept for this connection."""
        return len(self._buffer)

    def feed(self, data: bytes) -> None:
        """Take in what was received."""
        self._buffer += data
        self._advance()

    def take(self) -> Taken:
        """Take the request that is ready; the bytes behind it begin the next one."""
        end = len(self._buffer) if self._end is None else self._end
        taken = Taken(bytes(self._buffer[:end]), self._is_whole, self._refusal, self._why)
        del self._buffer[:end]
        self._start_request()
        if self._buffer and taken.is_whole:
            self._advance()
        return taken

    def _advance(self) -> None:
        if self.stage is Stage.HEAD:
            self._look_for_head()
        if self.stage is Stage.BODY:
            try:
                self._look_for_end()
            except _RefusedError as error:
                self._give_up(error.status)

    def _give_up(self, refusal: int | None = None, why: str | None = None) -> None:
        """Refuse what is here, or let the parser refuse it; nothing can follow it."""
        self._why = why
        self._end = None
        self._is_whole = False
        self._refusal = refusal
        self.stage = Stage.READY

    def _look_for_head(self) -> None:
        end = self._buffer.find(_HEAD_END, self._searched)
        if end < 0:
            self._searched = max(len(self._buffer) - len(_HEAD_END) + 1, 0)
        if end > MAXIMUM_HEAD_BYTES or (end < 0 and len(self._buffer) > MAXIMUM_HEAD_BYTES):
            is_one_line = self._buffer.find(b"\r\n", 0, MAXIMUM_HEAD_BYTES) < 0
            self._give_up(TOO_LONG_LINE if is_one_line else TOO_LONG_HEAD)
        elif end >= 0:
            self._read_head(bytes(self._buffer[:end]), end + len(_HEAD_END))

    def _read_head(self, head: bytes, body: int) -> None:
        """Take from a head where its request ends; `body` is where its body begins."""
        version = head.partition(b"\r\n")[0].rpartition(b" ")[2]
        if _VERSION.fullmatch(version) and version not in _VERSIONS:
            self._give_up(UNKNOWN_VERSION)
            return
        fields = _fields(head)
        twice = next((name for name in sorted(_ONCE) if len(fields.get(name, ())) > 1), None)
        if twice is not None:
            self._give_up(BAD_REQUEST, f"the field {twice.decode().title()} stands there twice")
            return
        codings, lengths = fields.get(b"transfer-encoding"), fields.get(b"content-length")
        expected = [value.lower() for value in fields.get(b"expect", [])]
        # HTTP/1.0 knows no interim answer (RFC 9110 section 10.1.1)
        self.wants_continue = expected == [b"100-continue"] and version != b"HTTP/1.0"
        if codings is not None:
            if lengths is not None or [one.lower() for one in codings] != [b"chunked"]:
                self._give_up(_refusal_of_codings(codings))
                return
            self._next_chunk = body
        elif lengths is not None:
            if len(set(lengths)) != 1 or not _LENGTH.fullmatch(lengths[0]):
                self._give_up()
                return
            if int(lengths[0]) > MAXIMUM_BODY_BYTES:
                self._give_up()
                return
            self._end = body + int(lengths[0])
        else:
            self._end = body
        self.stage = Stage.BODY

    def _look_for_end(self) -> None:
        while self._next_chunk is not None:
            if not self._take_chunk(self._next_chunk):
                break
        if self._next_chunk is None and self._end is not None and len(self._buffer) >= self._end:
            self.stage = Stage.READY
        elif len(self._buffer) > MAXIMUM_HEAD_BYTES + MAXIMUM_BODY_BYTES:
            raise _RefusedError(TOO_LARGE)

    def _take_chunk(self, place: int) -> bool:
        """Pass a chunk or a trailer, if all of it is here; sets the end behind the last one."""
        line_end = self._buffer.find(b"\r\n", place, place + _LONGEST_LINE_BYTES)
        if line_end < 0:
            if len(self._buffer) - place >= _LONGEST_LINE_BYTES:
                raise _RefusedError(BAD_REQUEST)
            return False
        line = bytes(self._buffer[place:line_end])
        after = line_end + 2
        if self._in_trailers:
            self._take_trailer(line, after)
            return True
        found = _CHUNK_SIZE.fullmatch(line)
        if not found:
            raise _RefusedError(BAD_REQUEST)
        size = int(found[1], 16)
        if size > MAXIMUM_BODY_BYTES:
            raise _RefusedError(TOO_LARGE)
        if size == 0:
            self._in_trailers = True
            self._next_chunk = after
            return True
        if len(self._buffer) < after + size + 2:
            return False
        if self._buffer[after + size : after + size + 2] != b"\r\n":
            raise _RefusedError(BAD_REQUEST)
        self._chunks += 1
        self._payload_bytes += size
        if self._chunks > CHUNKS_ALLOWED + self._payload_bytes // LEAST_CHUNK_BYTES:
            raise _RefusedError(TOO_LARGE)
        self._next_chunk = after + size + 2
        return True

    def _take_trailer(self, line: bytes, after: int) -> None:
        if not line:
            self._next_chunk, self._end = None, after
            return
        self._trailers += 1
        found = _TRAILER.fullmatch(line)
        if not found or found[1].lower() in _NO_TRAILERS or self._trailers > MAXIMUM_TRAILERS:
            raise _RefusedError(BAD_REQUEST)
        self._next_chunk = after


def _refusal_of_codings(codings: list[bytes]) -> int:
    """Give the status for transfer codings that are not `chunked` alone (RFC 9112 section 6.1)."""
    names = {one.strip(b" \t").lower() for one in b",".join(codings).split(b",")}
    return BAD_REQUEST if names == {b"chunked"} else UNKNOWN_CODING


def _fields(head: bytes) -> dict[bytes, list[bytes]]:
    """Give the header fields by their lower-case names; the first line is the request's."""
    found: dict[bytes, list[bytes]] = {}
    for line in head.split(b"\r\n")[1:]:
        name, _, value = line.partition(b":")
        found.setdefault(name.lower(), []).append(value.strip(b" \t"))
    return found


class Lane(Enum):
    """Threads that are kept for some requests, so that no others can take all of them."""

    GENERAL = auto()
    BROKER = auto()
    URGENT = auto()


_URGENT: Final = re.compile(rb"(?:POST|PUT|DELETE) /events?[/? ]")
_BROKER: Final = re.compile(rb"[A-Z]+ /broker/")
_BEARER: Final = re.compile(rb"\r\nauthorization:[ \t]*bearer[ \t]+([!-~]+)", re.IGNORECASE)
_API_KEY: Final = re.compile(rb"\r\nx-api-key:[ \t]*([!-~]+)", re.IGNORECASE)


def lane_of(raw: bytes, is_known: Callable[[str], bool]) -> Lane:
    """Say which threads serve a request: events, which an abort is, and the broker have their own.

    Of the broker's requests, because an abort is of use only when it reaches a vehicle. Who shows
    no key that `is_known` has no part in either: it would be refused there, and while the database
    stalls even a refusal takes its time.
    """
    lane = Lane.GENERAL
    if _URGENT.match(raw):
        lane = Lane.URGENT
    elif _BROKER.match(raw):
        lane = Lane.BROKER
    return lane if lane is Lane.GENERAL or is_known(_shown_key(raw)) else Lane.GENERAL


def _shown_key(raw: bytes) -> str:
    """Give the access key of a request; empty where there is none."""
    head = raw[: raw.find(_HEAD_END)]
    found = _BEARER.search(head) or _API_KEY.search(head)
    return found[1].decode("ascii") if found else ""
