"""Framing of HTTP/1.1: where a request ends in the bytes of a connection; sans-IO.

It reads as much of a head as determines the length of the body (RFC 9112 section 6.3) and leaves
the rest to gunicorn's parser. A head that it cannot frame is the last request of its connection
and is refused by that parser. What the parser would accept, or refuse too late, is
refused here with the status in `FramedRequest.refusal`: a head that is too long, an unknown version
of HTTP, a duplicate of a singleton field (RFC 9110 section 5.3; the parser would join them),
HTTP/1.1 without Host (RFC 9112 section 3.2), and a body that is malformed (RFC 9112 section 7.1) or
too large.

One thread frames the requests of all clients, so the work for a body is bounded by its bytes: the
number of chunks has a limit that grows with the payload.

HEAD and BODY: more bytes are needed. READY: `take` returns the request.

```mermaid
stateDiagram-v2
    HEAD --> BODY: head complete, body expected
    HEAD --> READY: head complete, no body
    HEAD --> READY: head cannot be framed
    BODY --> READY: body complete
    BODY --> READY: too large, or malformed: refused
    READY --> HEAD: taken
```
"""

import re
from collections.abc import Callable
from enum import Enum, auto
from typing import Final, NamedTuple

MAXIMUM_HEAD_BYTES: Final = 65_536
MAXIMUM_BODY_BYTES: Final = 2 * 1024 * 1024
"""Of a body, chunk sizes included; the application has lower limits."""
_HEAD_END: Final = b"\r\n\r\n"
_LONGEST_LINE_BYTES: Final = 8192  # Of a chunk's size with its extensions, or of a trailer
CHUNKS_ALLOWED: Final = 1024
"""Chunks that a body may have, whatever their size."""
LEAST_CHUNK_BYTES: Final = 64
"""Mean payload of further chunks, at least."""
MAXIMUM_TRAILERS: Final = 64
_TOKEN: Final = rb"[!#$%&'*+\-.^_`|~0-9A-Za-z]+"  # RFC 9110 section 5.6.2
_QUOTED: Final = rb'"(?:[\t !#-\[\]-~\x80-\xff]|\\[\t -~\x80-\xff])*"'  # RFC 9110 section 5.6.4
_EXTENSION: Final = rb"[ \t]*;[ \t]*%b(?:[ \t]*=[ \t]*(?:%b|%b))?" % (_TOKEN, _TOKEN, _QUOTED)
_CHUNK_SIZE: Final = re.compile(rb"0*([0-9A-Fa-f]{1,8})(?:%b)*" % _EXTENSION)
_TRAILER: Final = re.compile(rb"(%b):[\t -~\x80-\xff]*" % _TOKEN)
_NO_TRAILERS: Final = frozenset(
    {b"authorization", b"content-length", b"host", b"te", b"trailer", b"transfer-encoding"}
)
"""Fields for framing, routing or authorization (RFC 9110 section 6.5.1)."""
BAD_REQUEST: Final = 400
TOO_LARGE: Final = 413
TOO_LONG_LINE: Final = 414
TOO_LONG_HEAD: Final = 431
UNKNOWN_CODING: Final = 501
UNKNOWN_VERSION: Final = 505
_VERSION: Final = re.compile(rb"HTTP/[0-9]+(?:\.[0-9]+)?")
_VERSIONS: Final = frozenset({b"HTTP/1.0", b"HTTP/1.1"})
_SINGLE_FIELDS: Final = frozenset(
    {
        *(b"authorization", b"content-encoding", b"content-type", b"host", b"idempotency-key"),
        *(b"x-api-key", b"x-jws-signature"),
    }
)
"""Singleton fields: a request with two of one is ambiguous."""
_LENGTH: Final = re.compile(rb"[0-9]+")
_LENGTH_DIGITS: Final = 18
_SHOWN_BYTES: Final = 40


class Stage(Enum):
    """Stage of a request."""

    HEAD = auto()
    BODY = auto()
    READY = auto()


class FramedRequest(NamedTuple):
    """The bytes of one request; `is_whole` if another request may follow on the connection.

    `refusal` is the HTTP status of the answer if the request must not reach the application.
    """

    raw: bytes
    is_whole: bool
    refusal: int | None = None
    reason: str | None = None  # If the status alone does not explain it


class _RefusedError(Exception):
    """The body is malformed or too large; `status` is the HTTP status of the answer."""

    def __init__(self, status: int) -> None:
        super().__init__(status)
        self.status = status


class RequestFraming:
    """Splits the bytes of one connection into requests."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._start_request()

    def _start_request(self) -> None:
        self.stage = Stage.HEAD
        self._searched = 0  # The end of the head is not before this offset
        self._end: int | None = None  # Of the request, once known
        self._next_chunk: int | None = None  # Offset of the next chunk size or trailer
        self._in_trailers = False
        self._chunks = 0
        self._payload_bytes = 0
        self._trailers = 0
        self._is_whole = True
        self._refusal: int | None = None
        self._reason: str | None = None
        self.wants_continue = False

    @property
    def kept_bytes(self) -> int:
        """Size of the buffer."""
        return len(self._buffer)

    def feed(self, data: bytes) -> None:
        """Add received bytes."""
        self._buffer += data
        self._advance()

    def take(self) -> FramedRequest:
        """Return the request that is ready; the bytes after it start the next one."""
        end = len(self._buffer) if self._end is None else self._end
        request = FramedRequest(
            bytes(self._buffer[:end]), self._is_whole, self._refusal, self._reason
        )
        del self._buffer[:end]
        self._start_request()
        if self._buffer and request.is_whole:
            self._advance()
        return request

    def _advance(self) -> None:
        if self.stage is Stage.HEAD:
            self._find_head_end()
        if self.stage is Stage.BODY:
            try:
                self._find_end()
            except _RefusedError as error:
                self._refuse(error.status)

    def _refuse(self, refusal: int | None = None, reason: str | None = None) -> None:
        """End the request as refused, here or by the parser; no other can follow it."""
        self._reason = reason
        self._end = None
        self._is_whole = False
        self._refusal = refusal
        self.stage = Stage.READY

    def _find_head_end(self) -> None:
        end = self._buffer.find(_HEAD_END, self._searched)
        if end < 0:
            self._searched = max(len(self._buffer) - len(_HEAD_END) + 1, 0)
        if end > MAXIMUM_HEAD_BYTES or (end < 0 and len(self._buffer) > MAXIMUM_HEAD_BYTES):
            is_one_line = self._buffer.find(b"\r\n", 0, MAXIMUM_HEAD_BYTES) < 0
            self._refuse(TOO_LONG_LINE if is_one_line else TOO_LONG_HEAD)
        elif end >= 0:
            self._read_head(bytes(self._buffer[:end]), end + len(_HEAD_END))

    def _read_head(self, head: bytes, body: int) -> None:
        """Determine from a head where the request ends; `body` is the offset of the body."""
        version = head.partition(b"\r\n")[0].rpartition(b" ")[2]
        if _VERSION.fullmatch(version) and version not in _VERSIONS:
            self._refuse(UNKNOWN_VERSION)
            return
        fields = _fields(head)
        twice = next(
            (name for name in sorted(_SINGLE_FIELDS) if len(fields.get(name, ())) > 1), None
        )
        if twice is not None:
            self._refuse(BAD_REQUEST, f"the header field {twice.decode().title()} is present twice")
            return
        if version == b"HTTP/1.1" and b"host" not in fields:
            self._refuse(BAD_REQUEST, "the header field Host is missing")
            return
        codings, lengths = fields.get(b"transfer-encoding"), fields.get(b"content-length")
        expected = [value.lower() for value in fields.get(b"expect", [])]
        # HTTP/1.0 has no interim responses (RFC 9110 section 10.1.1)
        self.wants_continue = expected == [b"100-continue"] and version != b"HTTP/1.0"
        if codings is not None:
            if lengths is not None or [one.lower() for one in codings] != [b"chunked"]:
                both = "the header fields Content-Length and Transfer-Encoding exclude each other"
                self._refuse(_refusal_of_codings(codings), None if lengths is None else both)
                return
            self._next_chunk = body
        elif lengths is not None:
            reason = _fault_of_lengths(lengths)
            if reason is not None:
                self._refuse(BAD_REQUEST, reason)
                return
            if len(lengths[0]) > _LENGTH_DIGITS or int(lengths[0]) > MAXIMUM_BODY_BYTES:
                self._refuse()
                return
            self._end = body + int(lengths[0])
        else:
            self._end = body
        self.stage = Stage.BODY

    def _find_end(self) -> None:
        while self._next_chunk is not None:
            if not self._read_chunk(self._next_chunk):
                break
        if self._next_chunk is None and self._end is not None and len(self._buffer) >= self._end:
            self.stage = Stage.READY
        elif len(self._buffer) > MAXIMUM_HEAD_BYTES + MAXIMUM_BODY_BYTES:
            raise _RefusedError(TOO_LARGE)

    def _read_chunk(self, place: int) -> bool:
        """Read a chunk or a trailer; false if it is incomplete; sets the end after the last one."""
        line_end = self._buffer.find(b"\r\n", place, place + _LONGEST_LINE_BYTES)
        if line_end < 0:
            if len(self._buffer) - place >= _LONGEST_LINE_BYTES:
                raise _RefusedError(BAD_REQUEST)
            return False
        line = bytes(self._buffer[place:line_end])
        after = line_end + 2
        if self._in_trailers:
            self._read_trailer(line, after)
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

    def _read_trailer(self, line: bytes, after: int) -> None:
        if not line:
            self._next_chunk, self._end = None, after
            return
        self._trailers += 1
        found = _TRAILER.fullmatch(line)
        if not found or found[1].lower() in _NO_TRAILERS or self._trailers > MAXIMUM_TRAILERS:
            raise _RefusedError(BAD_REQUEST)
        self._next_chunk = after


def _fault_of_lengths(lengths: list[bytes]) -> str | None:
    """Say what is wrong with the values of Content-Length; None if there is one number."""
    if len(lengths) > 1:
        return "the header field Content-Length is present twice"
    if _LENGTH.fullmatch(lengths[0]):
        return None
    shown = lengths[0][:_SHOWN_BYTES].decode("ascii", "backslashreplace")
    return f'the header field Content-Length must be the number of bytes of the body, not "{shown}"'


def _refusal_of_codings(codings: list[bytes]) -> int:
    """Give the status for transfer codings other than `chunked` alone (RFC 9112 section 6.1)."""
    names = {one.strip(b" \t").lower() for one in b",".join(codings).split(b",")}
    return BAD_REQUEST if names == {b"chunked"} else UNKNOWN_CODING


def _fields(head: bytes) -> dict[bytes, list[bytes]]:
    """Give the header fields by lower-case name; skips the request line."""
    found: dict[bytes, list[bytes]] = {}
    for line in head.split(b"\r\n")[1:]:
        name, _, value = line.partition(b":")
        found.setdefault(name.lower(), []).append(value.strip(b" \t"))
    return found


class Lane(Enum):
    """A group of requests with threads of its own, which others cannot occupy."""

    GENERAL = auto()
    BROKER = auto()
    URGENT = auto()


_URGENT: Final = re.compile(rb"(?:POST|PUT|DELETE) /events?[/? ]")
_BROKER: Final = re.compile(rb"[A-Z]+ /broker/")
_BEARER: Final = re.compile(rb"\r\nauthorization:[ \t]*bearer[ \t]+([!-~]+)", re.IGNORECASE)
_API_KEY: Final = re.compile(rb"\r\nx-api-key:[ \t]*([!-~]+)", re.IGNORECASE)
_SESSION: Final = re.compile(
    rb"\r\ncookie:(?:[^\r\n]*?[ \t;])?session=(fs_[0-9a-f]{8}_[0-9a-f]{64})", re.IGNORECASE
)


def lane_of(raw: bytes, is_known: Callable[[str], bool]) -> Lane:
    """Choose the threads for a request: events, such as aborts, and the broker have their own.

    The broker has, because an abort must also reach the vehicle. A request without a key or session
    that `is_known` does not get them: it would be refused, and while the database stalls a refusal
    takes time too.
    """
    lane = Lane.GENERAL
    if _URGENT.match(raw):
        lane = Lane.URGENT
    elif _BROKER.match(raw):
        lane = Lane.BROKER
    return lane if lane is Lane.GENERAL or is_known(_key_of(raw)) else Lane.GENERAL


def _key_of(raw: bytes) -> str:
    """Give the access key of a request, or the secret of its session; "" without one."""
    head = raw[: raw.find(_HEAD_END)]
    found = _BEARER.search(head) or _API_KEY.search(head) or _SESSION.search(head)
    return found[1].decode("ascii") if found else ""
