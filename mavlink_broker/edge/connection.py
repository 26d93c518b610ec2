"""One HTTP connection to the edge server, and which of its status codes are final.

The access key is read from its file when it is needed: the edge server may write the file after
the broker has started, or replace it.

NoKeyError  the key file does not exist or cannot be read
"""

from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from mavlink_broker.edge.bounded_http import Answer, BoundedHttp

TIMEOUT_S: Final = 10.0
"""To connect, and for each read."""
EXCHANGE_TIMEOUT_S: Final = 120.0
"""For a whole exchange, without the long poll: a picture on a slow link."""
MAX_ANSWER_BYTES: Final = 64 << 20
INSTANCE_HEADER: Final = "Broker-Instance"

_RETRIED: Final = frozenset(
    {
        HTTPStatus.UNAUTHORIZED,
        HTTPStatus.FORBIDDEN,
        HTTPStatus.REQUEST_TIMEOUT,
        HTTPStatus.TOO_EARLY,
        HTTPStatus.TOO_MANY_REQUESTS,
    }
)
_TEMPORARY: Final = _RETRIED | {HTTPStatus.SERVICE_UNAVAILABLE, HTTPStatus.INSUFFICIENT_STORAGE}


class NoKeyError(Exception):
    """The broker's key file does not exist or cannot be read."""


class EdgeConnection:
    """One thread's connection to the edge server, open until the end of its `with` block."""

    def __init__(
        self, url: str, key_file: Path, ca_file: Path | None, instance_id: str = ""
    ) -> None:
        """Connect to the edge server's URL; `instance_id` distinguishes brokers with one key."""
        self._headers = {INSTANCE_HEADER: instance_id} if instance_id else {}
        self._url = url.rstrip("/")
        self._key_file = key_file
        self._http = BoundedHttp(True if ca_file is None else str(ca_file))
        self._key: str | None = None

    def __enter__(self) -> Self:
        """Keep the connection open between requests until the end of the block."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the connection."""
        self._http.__exit__(kind, error, trace)

    def request(
        self,
        method: str,
        path: str,
        wait_s: float = 0.0,
        *,
        body: Any = None,
        headers: Mapping[str, str] | None = None,
    ) -> Answer:
        """Send one request; the timeouts are `wait_s` longer than usual, for a long poll.

        Raises:
            requests.RequestException: if no complete answer arrives, for any reason.
            NoKeyError: if there is no access key.
        """
        response = self._http.exchange(
            method,
            self._url + path,
            within_s=wait_s + EXCHANGE_TIMEOUT_S,
            timeouts_s=(TIMEOUT_S, wait_s + TIMEOUT_S),
            max_bytes=MAX_ANSWER_BYTES,
            headers={
                "Authorization": f"Bearer {self._read_key()}",
                **self._headers,
                **(headers or {}),
            },
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
    """Whether a repeated request would get the same answer."""
    if status_code in _RETRIED:
        return False
    return 200 <= status_code < 300 or 400 <= status_code < 500


def is_temporary_refusal(status_code: int) -> bool:
    """Whether the edge server refuses until a condition outside the request changes."""
    return status_code in _TEMPORARY
