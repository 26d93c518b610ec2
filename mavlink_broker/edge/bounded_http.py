"""HTTP exchanges with a deadline for the whole of them, and a bound to what is read.

The timeouts of `requests` hold for each single read: a server that sends one byte every few
seconds, in its headers too, keeps a thread for ever. Here a timer shuts the connection down when
the time for the whole exchange is over, whatever it is waiting for: the handshake, the headers or
the body. The timer holds a duplicate of the socket's descriptor, since TLS takes the first one
over; shutting one down ends the reads of both.

A name that is looked up waits for the system's resolver, which has timeouts of its own.

The edge server's relay has a module of this name and purpose with another mechanism. Programs meet
only on the wire and the vocabulary that they share knows no HTTP, so that neither may import the
other's; and they bound different things. The relay sends small records, thousands a second, on
connections that stay open: it bounds the wait for an answer, in the reader of the answer, at no
cost per request. The broker asks seldom, also web servers that it has never met, and sends whole
pictures: connecting, the TLS handshake and sending take part in the deadline, and those block
where no reader stands. A timer's thread per exchange, some 50 us, is the price.
"""

import json
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Final, Self

import requests
from requests.adapters import HTTPAdapter
from urllib3 import HTTPConnectionPool, HTTPSConnectionPool
from urllib3.connection import HTTPConnection, HTTPSConnection

CHUNK_BYTES: Final = 64 * 1024
_BOTH_DIRECTIONS: Final = 2
"""SHUT_RDWR."""


class TooLargeError(requests.RequestException):
    """The answer has more bytes than were allowed."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A whole answer."""

    status_code: int
    body: bytes

    @property
    def text(self) -> str:
        """The body as text; bytes that are no UTF-8 are replaced."""
        return self.body.decode("utf-8", "replace")

    def json(self) -> Any:
        """Read the body.

        Raises:
            requests.RequestException: if it is no JSON.
        """
        try:
            return json.loads(self.body)
        except (ValueError, RecursionError) as error:
            raise requests.exceptions.InvalidJSONError(str(error)) from error


class _Exchange:
    """One exchange of this thread: shuts its connection down when its time is over."""

    def __init__(self, within_s: float) -> None:
        self._lock = threading.Lock()
        self._taps: list[Any] = []  # Duplicates of sockets
        self._timer = threading.Timer(within_s, self._end)
        self._timer.daemon = True
        self._timer.name = "http-deadline"
        self.is_over = False

    def __enter__(self) -> Self:
        _current.exchange = self
        self._timer.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        del kind, error, trace
        self._timer.cancel()
        _current.exchange = None
        with self._lock:
            taps, self._taps = self._taps, []
        for tap in taps:
            tap.close()

    def watch(self, tap: Any) -> None:
        with self._lock:
            self._taps.append(tap)
            is_over = self.is_over
        if is_over:
            _shut_down(tap)

    def _end(self) -> None:
        with self._lock:
            self.is_over = True
            for tap in self._taps:
                _shut_down(tap)


class _Current(threading.local):
    """The exchange that a thread is busy with."""

    exchange: _Exchange | None = None


_current = _Current()


def _shut_down(tap: Any) -> None:
    with suppress(OSError):  # It was closed meanwhile
        tap.shutdown(_BOTH_DIRECTIONS)


class _Tapped(HTTPConnection):
    """A connection that the exchange of its thread can shut down."""

    _tap: Any = None

    def _new_conn(self) -> Any:
        fresh = super()._new_conn()
        self._tap = fresh.dup()
        self._show()
        return fresh

    def putrequest(self, *arguments: Any, **named: Any) -> None:
        """Begin a request, on a connection that may have been used before."""
        self._show()
        super().putrequest(*arguments, **named)

    def close(self) -> None:
        """Close the connection and its duplicate."""
        super().close()
        tap, self._tap = self._tap, None
        if tap is not None:
            tap.close()

    def _show(self) -> None:
        """Give the exchange a duplicate of its own: the answer may outlive the connection."""
        if self._tap is not None and _current.exchange is not None:
            _current.exchange.watch(self._tap.dup())


class _TappedTls(_Tapped, HTTPSConnection):
    """The same with TLS."""


class _Pool(HTTPConnectionPool):
    ConnectionCls = _Tapped


class _TlsPool(HTTPSConnectionPool):
    ConnectionCls = _TappedTls


class _Adapter(HTTPAdapter):
    """Makes connections that can be shut down."""

    def init_poolmanager(self, *arguments: Any, **named: Any) -> None:
        super().init_poolmanager(*arguments, **named)
        self.poolmanager.pool_classes_by_scheme = {"http": _Pool, "https": _TlsPool}


class BoundedHttp:
    """One thread's connections to web servers; no proxies, no redirects."""

    def __init__(self, verify: bool | str = True) -> None:  # noqa: FBT001, FBT002  # requests' word
        """Take who vouches for certificates: a file of authorities, or the usual ones."""
        self._http = requests.Session()
        self._http.trust_env = False
        self._http.verify = verify
        for scheme in ("http://", "https://"):
            self._http.mount(scheme, _Adapter())

    def exchange(
        self,
        method: str,
        url: str,
        *,
        within_s: float,
        timeouts_s: tuple[float, float],
        most_bytes: int,
        headers: Mapping[str, str] | None = None,
        body: Any = None,
    ) -> Answer:
        """Ask once: `within_s` for all of it, `timeouts_s` to connect and for each read.

        `body` is sent as JSON.

        Raises:
            requests.RequestException: if there is no whole answer within the bounds.
        """
        asked = {"Accept-Encoding": "identity", **(headers or {})}
        with _Exchange(within_s) as one:
            try:
                with self._http.request(
                    method,
                    url,
                    headers=asked,
                    json=body,
                    timeout=timeouts_s,
                    allow_redirects=False,
                    stream=True,
                ) as response:
                    answer = Answer(response.status_code, _body(response, most_bytes))
            except TooLargeError:
                raise
            except (OSError, ValueError) as error:
                if one.is_over:
                    raise requests.Timeout(_late(within_s)) from error
                if isinstance(error, requests.RequestException):
                    raise
                raise requests.RequestException(str(error)) from error
            if one.is_over:
                raise requests.Timeout(_late(within_s))
        return answer


def _late(within_s: float) -> str:
    return f"no whole answer within {within_s:.0f} s"


def _body(response: requests.Response, most_bytes: int) -> bytes:
    body = bytearray()
    for chunk in response.iter_content(CHUNK_BYTES):
        body += chunk
        if len(body) > most_bytes:
            raise TooLargeError(f"it has more than {most_bytes} bytes")
    return bytes(body)
