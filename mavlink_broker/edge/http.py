"""One HTTP connection to the edge server, and which of its answers are final.

The access key is read from its file when it is needed, because the edge server may not have
written it yet, or may have written a new one.

NoKeyError  there is no key to ask with
"""

from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

from mavlink_broker.edge.bounded_http import Answer, BoundedHttp

TIMEOUT_S: Final = 10.0
"""To connect, and for each read."""
WHOLE_S: Final = 120.0
"""For a whole exchange beyond what the edge server was asked to wait: a picture on a slow link."""
MOST_BYTES: Final = 64 << 20
"""Of an answer."""

_TRY_AGAIN: Final = frozenset(
    {
        HTTPStatus.UNAUTHORIZED,
        HTTPStatus.FORBIDDEN,
        HTTPStatus.REQUEST_TIMEOUT,
        HTTPStatus.TOO_EARLY,
        HTTPStatus.TOO_MANY_REQUESTS,
    }
)


_ON_PURPOSE: Final = _TRY_AGAIN | {HTTPStatus.SERVICE_UNAVAILABLE, HTTPStatus.INSUFFICIENT_STORAGE}


class NoKeyError(Exception):
    """The edge server has not written the broker's key yet."""


class Door:
    """One thread's connection to the edge server."""

    def __init__(self, url: str, key_file: Path, ca_file: Path | None) -> None:
        self._url = url.rstrip("/")
        self._key_file = key_file
        self._http = BoundedHttp(True if ca_file is None else str(ca_file))
        self._key: str | None = None

    def request(
        self,
        method: str,
        path: str,
        wait_s: float = 0.0,
        *,
        body: Any = None,
        headers: Mapping[str, str] | None = None,
    ) -> Answer:
        """Ask once; the edge server may take `wait_s` longer than usual.

        Raises:
            requests.RequestException: if there is no whole answer, whatever the reason.
            NoKeyError: if there is no key to ask with.
        """
        response = self._http.exchange(
            method,
            self._url + path,
            within_s=wait_s + WHOLE_S,
            timeouts_s=(TIMEOUT_S, wait_s + TIMEOUT_S),
            most_bytes=MOST_BYTES,
            headers={"Authorization": f"Bearer {self._read_key()}", **(headers or {})},
            body=body,
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


def is_final(status_code: int) -> bool:
    """Whether an answer would be the same if the request were repeated."""
    if status_code in _TRY_AGAIN:
        return False
    return 200 <= status_code < 300 or 400 <= status_code < 500


def waits_on_purpose(status_code: int) -> bool:
    """Whether the edge server refuses for now, until something changes that is not the request."""
    return status_code in _ON_PURPOSE
