"""Resolves host names on a thread, because a name server may take long."""

import socket
import threading
from collections.abc import Callable
from ipaddress import ip_address
from typing import Final

LOOKUP_INTERVAL_S: Final = 30.0
"""Interval at which a known name is resolved again: a vehicle may return with another address."""
UNKNOWN_LOOKUP_INTERVAL_S: Final = 2.0
"""The same while the name is unknown."""


class HostName:
    """A host, given as an address or a name."""

    def __init__(
        self, host: str, on_found: Callable[[], None], family: int = socket.AF_UNSPEC
    ) -> None:
        """Take a host; `on_found` is called from a thread after each successful lookup."""
        self._host = host
        self._family = family
        self._on_found = on_found
        self._thread: threading.Thread | None = None
        self._next_at = 0.0
        self._numeric = host if _is_numeric(host) else None

    def numeric(self, now: float) -> str | None:
        """Latest numeric address; None while none is known."""
        if not _is_numeric(self._host) and now >= self._next_at and not self._is_resolving:
            self._next_at = now + (
                UNKNOWN_LOOKUP_INTERVAL_S if self._numeric is None else LOOKUP_INTERVAL_S
            )
            self._thread = threading.Thread(target=self._resolve, name="host-name", daemon=True)
            self._thread.start()
        return self._numeric

    @property
    def _is_resolving(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _resolve(self) -> None:
        try:
            found = socket.getaddrinfo(self._host, None, self._family, socket.SOCK_DGRAM)
        except (OSError, UnicodeError):  # UnicodeError: the name is not a valid host name
            return
        self._numeric = str(found[0][4][0])
        self._on_found()


def _is_numeric(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True
