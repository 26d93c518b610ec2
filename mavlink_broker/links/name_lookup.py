"""The numeric address of a host, looked up beside the loop: a name server may take long."""

import socket
import threading
from collections.abc import Callable
from ipaddress import ip_address
from typing import Final

LOOK_AGAIN_S: Final = 30.0
"""How often a name is looked up anew: a vehicle may come back with another address."""
UNKNOWN_AGAIN_S: Final = 2.0
"""How often as long as nobody knows it."""


class HostName:
    """A host, numeric or by name."""

    def __init__(
        self, host: str, on_found: Callable[[], None], family: int = socket.AF_UNSPEC
    ) -> None:
        """Know a host; `on_found` is called from a thread when a look-up has ended."""
        self._host = host
        self._family = family
        self._on_found = on_found
        self._thread: threading.Thread | None = None
        self._next_at = 0.0
        self._numeric = host if _is_numeric(host) else None

    def numeric(self, now: float) -> str | None:
        """Newest numeric address; None where none is known yet."""
        if not _is_numeric(self._host) and now >= self._next_at and not self._is_looking:
            self._next_at = now + (UNKNOWN_AGAIN_S if self._numeric is None else LOOK_AGAIN_S)
            self._thread = threading.Thread(target=self._look_up, name="host-name", daemon=True)
            self._thread.start()
        return self._numeric

    @property
    def _is_looking(self) -> bool:
        return self._thread is not None and self._thread.is_alive()

    def _look_up(self) -> None:
        try:
            found = socket.getaddrinfo(self._host, None, self._family, socket.SOCK_DGRAM)
        except (OSError, UnicodeError):  # The latter of a name that no name server can have
            return
        self._numeric = str(found[0][4][0])
        self._on_found()


def _is_numeric(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True
