"""The connection to the edge server, with the access key.

The key is read from its file when it is needed: the edge server may write the file after the broker
has started, or replace it.

NoKeyError  the key file does not exist or cannot be read
"""

from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

import requests

from mavlink_broker.edge.bounded_http import Answer, BoundedHttp

TIMEOUT_S: Final = 10.0
"""To connect, and for each read."""
EXCHANGE_TIMEOUT_S: Final = 120.0
"""For a whole exchange, without the long poll: a picture on a slow link."""
MAX_ANSWER_BYTES: Final = 64 << 20
INSTANCE_HEADER: Final = "Broker-Instance"


class NoKeyError(requests.RequestException):
    """The broker's key file does not exist or cannot be read."""


class EdgeConnection(BoundedHttp):
    """One thread's connection to the edge server, open until the end of its `with` block."""

    def __init__(
        self, url: str, key_file: Path, ca_file: Path | None, instance_id: str = ""
    ) -> None:
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
