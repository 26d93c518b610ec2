"""HTTP exchanges with a timeout for the whole exchange and a limit on the size of the answer.

The timeouts of `requests` hold for each single read: a server that sends one byte every few
seconds, also in its headers, blocks a thread for ever. Here a timer shuts the connection down when
the time for the whole exchange is over, in any phase: TLS handshake, headers or body. The timer
holds a duplicate of the socket's descriptor, because TLS detaches the first one; shutting down one
of them ends the reads of both.

A name lookup waits for the system's resolver, which has timeouts of its own.

The edge server's relay has a module of the same name with another mechanism. The programs meet
only on the wire and their shared vocabulary contains no HTTP, so neither may import the other's
module; and they limit different things. The relay sends thousands of small records a second on
connections that stay open: it limits the wait for an answer, in the reader of the answer, at no
cost per request. The broker sends few requests, also to unknown web servers, and sends whole
pictures: connecting, the TLS handshake and sending are part of the timeout, and they block outside
any reader. The price is one timer thread per exchange, some 50 us.

`EdgeConnection` is the connection to the edge server. Its key is read from the file when it is
needed: the edge server may write the file after the broker has started, or replace it.

NoKeyError     the key file does not exist or cannot be read
TooLargeError  the answer is longer than the limit
"""

import json
import logging
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final, Self
from urllib.parse import urlsplit

import requests
from requests.adapters import HTTPAdapter
from urllib3 import HTTPConnectionPool, HTTPSConnectionPool
from urllib3.connection import HTTPConnection, HTTPSConnection
from urllib3.exceptions import HeaderParsingError, HTTPError

CHUNK_BYTES: Final = 64 * 1024
_REASON_CHARACTERS: Final = 200
_REASONS_REPORTED: Final = 32
UPDATE_INTERVAL: Final = "Update-Interval"
"""Header of the answer to an update of a vehicle: seconds until the next one is wanted."""
_BOTH_DIRECTIONS: Final = 2
"""SHUT_RDWR."""


class TooLargeError(requests.RequestException):
    """The answer is longer than the limit."""


class NoKeyError(requests.RequestException):
    """The broker's key file does not exist or cannot be read."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A complete answer."""

    status_code: int
    body: bytes
    update_interval: str | None = None
    """The header `UPDATE_INTERVAL`."""

    @property
    def text(self) -> str:
        """The body as text; invalid UTF-8 is replaced."""
        return self.body.decode("utf-8", "replace")

    def json(self) -> Any:
        """Parse the body as JSON.

        Raises:
            requests.RequestException: if it is not JSON.
        """
        try:
            return json.loads(self.body)
        except (ValueError, RecursionError) as error:
            raise requests.exceptions.InvalidJSONError(str(error)) from error


class _Exchange:
    """One exchange of this thread: shuts its connection down at the timeout."""

    def __init__(self, within_s: float) -> None:
        self._lock = threading.Lock()
        self._sockets: list[Any] = []  # Duplicates
        self._timer = threading.Timer(within_s, self._expire)
        self._timer.daemon = True
        self._timer.name = "http-deadline"
        self.has_expired = False

    def __enter__(self) -> Self:
        _current.exchange = self
        self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        _current.exchange = None
        with self._lock:
            sockets, self._sockets = self._sockets, []
        for duplicate in sockets:
            duplicate.close()

    def watch(self, duplicate: Any) -> None:
        with self._lock:
            self._sockets.append(duplicate)
            has_expired = self.has_expired
        if has_expired:
            _shut_down(duplicate)

    def _expire(self) -> None:
        with self._lock:
            self.has_expired = True
            for duplicate in self._sockets:
                _shut_down(duplicate)


class _Current(threading.local):
    """The running exchange of each thread."""

    exchange: _Exchange | None = None


_current = _Current()


def _shut_down(duplicate: Any) -> None:
    with suppress(OSError):  # It was closed meanwhile
        duplicate.shutdown(_BOTH_DIRECTIONS)


class _BrokenHeaders(logging.Filter):
    """Reports headers that urllib3 cannot read in one line, once for each server and reason.

    Such an answer is used all the same: cameras send them, and what the edge server answers is a
    JSON object, which is whole or cannot be read. A length that cannot be read is an error.
    """

    def __init__(self) -> None:
        super().__init__()
        self._known: set[tuple[str, str]] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        """Rewrite a record about broken headers; whether a record is logged."""
        error = record.exc_info[1] if record.exc_info else None
        if not isinstance(error, HeaderParsingError) or not isinstance(record.args, tuple):
            return True
        server, reason = urlsplit(str(record.args[0])).netloc, str(error)[:_REASON_CHARACTERS]
        record.msg = "an answer of %s has headers that cannot be read: %s"
        record.args, record.exc_info = (server, reason), None
        is_new = (server, reason) not in self._known and len(self._known) < _REASONS_REPORTED
        self._known |= {(server, reason)} if is_new else set()
        return is_new


logging.getLogger("urllib3.connection").addFilter(_BrokenHeaders())


class _InterruptibleConnection(HTTPConnection):
    """A connection that the exchange of its thread can shut down."""

    _duplicate: Any = None

    def _new_conn(self) -> Any:
        connection = super()._new_conn()
        self._duplicate = connection.dup()
        self._register()
        return connection

    def putrequest(self, *arguments: Any, **named: Any) -> None:
        """Begin a request; the connection may be a reused one."""
        self._register()
        super().putrequest(*arguments, **named)

    def close(self) -> None:
        """Close the connection and its duplicate."""
        super().close()
        duplicate, self._duplicate = self._duplicate, None
        if duplicate is not None:
            duplicate.close()

    def _register(self) -> None:
        """Give the exchange its own duplicate: the answer may outlive the connection."""
        if self._duplicate is not None and _current.exchange is not None:
            _current.exchange.watch(self._duplicate.dup())


class _InterruptibleTlsConnection(_InterruptibleConnection, HTTPSConnection):
    """The same over TLS."""


class _Pool(HTTPConnectionPool):
    ConnectionCls = _InterruptibleConnection


class _TlsPool(HTTPSConnectionPool):
    ConnectionCls = _InterruptibleTlsConnection


class _Adapter(HTTPAdapter):
    def init_poolmanager(self, *arguments: Any, **named: Any) -> None:
        super().init_poolmanager(*arguments, **named)
        self.poolmanager.pool_classes_by_scheme = {"http": _Pool, "https": _TlsPool}


class BoundedHttp:
    """One thread's connections to web servers, open until the end of its `with` block.

    It uses no proxies and follows no redirects.
    """

    def __init__(self, verify: bool | str = True) -> None:  # noqa: FBT001, FBT002  # requests' name
        """Verify certificates against a CA file (`verify` is its path) or the default CAs."""
        self._http = requests.Session()
        self._http.trust_env = False
        self._http.verify = verify
        for scheme in ("http://", "https://"):
            self._http.mount(scheme, _Adapter())

    def __enter__(self) -> Self:
        """Keep connections open between exchanges until the end of the block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close all connections."""
        self._http.close()

    def exchange(
        self,
        method: str,
        url: str,
        *,
        within_s: float,
        timeouts_s: tuple[float, float],
        max_bytes: int,
        headers: Mapping[str, str] | None = None,
        body: Any = None,
        data: bytes | None = None,
    ) -> Answer:
        """Send one request and read its answer.

        `within_s` limits the whole exchange, `timeouts_s` are those to connect and for each read;
        `body` is sent as JSON, `data` as it is.

        Raises:
            requests.RequestException: if no complete answer arrives within the limits.
        """
        with _Exchange(within_s) as exchange:
            try:
                with self._http.request(
                    method,
                    url,
                    headers={"Accept-Encoding": "identity", **(headers or {})},
                    json=body,
                    data=data,
                    timeout=timeouts_s,
                    allow_redirects=False,
                    stream=True,
                ) as response:
                    answer = Answer(
                        response.status_code,
                        _body(response, max_bytes),
                        response.headers.get(UPDATE_INTERVAL),
                    )
            except TooLargeError:
                raise
            except (OSError, ValueError) as error:
                if exchange.has_expired:
                    raise requests.Timeout(_timeout_text(within_s)) from error
                if isinstance(error, requests.RequestException):
                    raise
                raise requests.RequestException(str(error)) from error
            if exchange.has_expired:
                raise requests.Timeout(_timeout_text(within_s))
        return answer


TIMEOUT_S: Final = 10.0
"""To connect, and for each read."""
EXCHANGE_TIMEOUT_S: Final = 120.0
"""For a whole exchange, without the long poll: a picture on a slow link."""
MAX_ANSWER_BYTES: Final = 64 << 20
INSTANCE_HEADER: Final = "Broker-Instance"


class EdgeConnection(BoundedHttp):
    """One thread's connection to the edge server, open until the end of its `with` block."""

    def __init__(self, url: str, key_file: Path, ca_file: Path | None, instance_id: str) -> None:
        """Connect to the edge server's URL; `instance_id` distinguishes brokers with one key."""
        super().__init__(True if ca_file is None else str(ca_file))
        self._headers = {INSTANCE_HEADER: instance_id} if instance_id else {}
        self._url = url.rstrip("/")
        self._key_file = key_file
        self._key: str | None = None

    def request(
        self,
        method: str,
        path: str,
        wait_s: float = 0.0,
        *,
        body: Any = None,
        data: bytes | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> Answer:
        """Send one request; the timeouts are `wait_s` longer than usual, for a long poll.

        `body` is sent as JSON, or else `data` as it is.

        Raises:
            requests.RequestException: if no complete answer arrives, for any reason; NoKeyError if
                there is no access key.
        """
        response = self.exchange(
            method,
            self._url + path,
            within_s=wait_s + EXCHANGE_TIMEOUT_S,
            timeouts_s=(TIMEOUT_S, wait_s + TIMEOUT_S),
            max_bytes=MAX_ANSWER_BYTES,
            headers={
                "Authorization": f"Bearer {self._read_key()}",
                **self._headers,
                **({} if data is None else {"Content-Type": "application/octet-stream"}),
                **(headers or {}),
            },
            body=body,
            data=data,
        )
        if response.status_code == HTTPStatus.UNAUTHORIZED:
            self._key = None
        return response

    def _read_key(self) -> str:
        if self._key is None:
            try:
                self._key = self._key_file.read_text(encoding="ascii").strip()
            except OSError as error:
                raise NoKeyError(f"no key in {self._key_file}: {error.strerror}") from error
            except UnicodeDecodeError as error:
                raise NoKeyError(f"no key in {self._key_file}: {error}") from error
        return self._key


def cause_of(error: Exception) -> str:
    """Text of why an exchange has failed: the system's own where a library's is around it."""
    first: BaseException = error
    if error.args and isinstance(error.args[0], HTTPError):
        while (cause := first.__cause__ or first.__context__) is not None:
            first = cause
    return str(first) or type(first).__name__


def _timeout_text(within_s: float) -> str:
    return f"no complete answer within {within_s:.0f} s"


def _body(response: requests.Response, max_bytes: int) -> bytes:
    length = response.headers.get("Content-Length", "0").strip()
    if not (length.isascii() and length.isdigit()):
        # http.client would read to the end of the connection, and take any end for the whole
        raise requests.exceptions.InvalidHeader(f"{length[:40]!r} is no Content-Length")
    body = bytearray()
    for chunk in response.iter_content(CHUNK_BYTES):
        body += chunk
        if len(body) > max_bytes:
            raise TooLargeError(f"the answer is longer than {max_bytes} bytes")
    return bytes(body)
