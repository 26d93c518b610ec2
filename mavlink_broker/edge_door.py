"""One HTTP connection to the edge server, and which of its answers are final.

The access key is read from its file when it is needed, because the edge server may not have
written it yet, or may have written a new one.

NoKeyError  there is no key to ask with
"""

from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

import requests

TIMEOUT_S: Final = 10.0

_TRY_AGAIN: Final = frozenset(
    {
        HTTPStatus.UNAUTHORIZED,
        HTTPStatus.FORBIDDEN,
        HTTPStatus.REQUEST_TIMEOUT,
        HTTPStatus.TOO_EARLY,
        HTTPStatus.TOO_MANY_REQUESTS,
    }
)


class NoKeyError(Exception):
    """The edge server has not written the broker's key yet."""


class Door:
    """One thread's connection to the edge server."""

    def __init__(self, url: str, key_file: Path, ca_file: Path | None) -> None:
        self._url = url.rstrip("/")
        self._key_file = key_file
        self._http = requests.Session()
        self._http.trust_env = False
        if ca_file is not None:
            self._http.verify = str(ca_file)
        self._key: str | None = None

    def request(self, method: str, path: str, timeout_s: float, **how: Any) -> requests.Response:
        """Ask once.

        Raises:
            requests.RequestException: if there is no answer.
            NoKeyError: if there is no key to ask with.
        """
        headers = {"Authorization": f"Bearer {self._read_key()}", **how.pop("headers", {})}
        response = self._http.request(
            method,
            self._url + path,
            headers=headers,
            timeout=(TIMEOUT_S, timeout_s),
            allow_redirects=False,
            **how,
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
