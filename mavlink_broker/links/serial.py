"""MAVLink over a serial line: a telemetry radio, a cable, or a pseudo-terminal.

8 data bits, no parity, one stop bit, no flow control, by the standard library's termios. A missing
or unplugged device is opened again every second.
"""

import errno
import fcntl
import os
import termios
from typing import Final

from mavlink_broker.links.link import (
    Arrival,
    LinkError,
    RateLimiter,
    RetryTimer,
    SinglePeerLink,
    Stream,
)
from mavlink_broker.links.url import LinkUrl

LOOKUP_INTERVAL_S: Final = 1.0
_CHARACTERS: Final = 6
"""Index in the result of tcgetattr, after the four modes, input speed and output speed."""


class SerialLink(SinglePeerLink):
    """A serial device."""

    def __init__(self, url: LinkUrl, number: int) -> None:
        """Prepare a line; `step` opens it.

        Raises:
            LinkError: if the system does not support that speed.
        """
        if not hasattr(termios, f"B{url.port}"):
            raise LinkError(f"{url}: {url.port} is not a supported baud rate")
        super().__init__(url, number, RetryTimer(url, LOOKUP_INTERVAL_S))
        self._rate_limiter = RateLimiter(url.port)

    def radio_status(self, free_percent: int) -> None:
        """Write more slowly while the radio's buffer is full."""
        self._rate_limiter.report(free_percent)

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Open the device when it is due, else read and write."""
        if self._stream is None:
            if now >= self._retry.at:
                self._open(now)
            return []
        return self._transfer(self._stream, ready, now)

    def _release(self) -> None:
        if self._stream is not None:
            os.close(self._stream.descriptor)

    def _open(self, now: float) -> None:
        try:
            descriptor = _open_line(self.url.host, self.url.port)
        except (OSError, termios.error) as error:
            self._retry.failed(now, str(error.args[-1] if error.args else error))
            return
        self._stream = Stream(descriptor, rate_limiter=self._rate_limiter)
        self._retry.opened()


def _lock(descriptor: int) -> None:
    """Lock a device: two readers would each get a part of its bytes.

    Raises:
        OSError: if another program has locked it.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise OSError(errno.EBUSY, "another program uses it") from error


def _open_line(path: str, baud: int) -> int:
    """Open a device in raw mode, locked for this program.

    Raises:
        OSError: if it cannot be opened.
        termios.error: if it is not a terminal.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        _lock(descriptor)
        characters = termios.tcgetattr(descriptor)[_CHARACTERS]
        characters[termios.VMIN] = 1  # An empty read then means that the device is gone
        characters[termios.VTIME] = 0
        speed = getattr(termios, f"B{baud}")
        control = termios.CS8 | termios.CREAD | termios.CLOCAL
        raw = [0, 0, control, 0, speed, speed, characters]
        termios.tcsetattr(descriptor, termios.TCSANOW, raw)
        termios.tcflush(descriptor, termios.TCIFLUSH)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor
