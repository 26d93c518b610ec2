"""MAVLink over a serial line: a telemetry radio, a cable, or a pseudo-terminal.

8 data bits, no parity, one stop bit, no flow control, by the standard library's termios. A device
that is not there, or is pulled out, is looked for every second.
"""

import errno
import fcntl
import os
import termios
from typing import Final

from mavlink_broker.links.link import Arrival, LinkError, Retry
from mavlink_broker.links.one_peer import OnePeerLink
from mavlink_broker.links.pace import Pace
from mavlink_broker.links.stream import QUEUE_BYTES, Stream
from mavlink_broker.links.url import LinkUrl

LOOK_AGAIN_S: Final = 1.0
_CHARACTERS: Final = 6
"""Place in what tcgetattr gives; before them the four modes, input and output speed."""


class SerialLink(OnePeerLink):
    """Implements `mavlink_broker.links.link.Link` on a device."""

    def __init__(self, url: LinkUrl, number: int) -> None:
        """Prepare a line; it is opened by `step`.

        Raises:
            LinkError: if no line has that speed.
        """
        if not hasattr(termios, f"B{url.port}"):
            raise LinkError(f"{url}: {url.port} baud is no speed of a serial line")
        super().__init__(url, number, Retry(url, LOOK_AGAIN_S))
        self._pace = Pace(url.port)

    def writers(self) -> list[int]:
        """The open device while something waits for it."""
        return [self._stream.descriptor] if self._stream and self._stream.is_behind else []

    def due_at(self) -> float | None:
        """When the device is looked for again."""
        return None if self._stream else self._retry.at

    def radio(self, free_percent: int) -> None:
        """Write slower while the radio's buffer is full."""
        self._pace.report(free_percent)

    def step(self, ready: frozenset[int], now: float) -> list[Arrival]:
        """Open the device when it is time, else read and write."""
        if self._stream is None:
            if now >= self._retry.at:
                self._open(now)
            return []
        return self._exchange(self._stream, ready, now)

    def _release(self) -> None:
        if self._stream is not None:
            os.close(self._stream.descriptor)

    def _open(self, now: float) -> None:
        try:
            descriptor = _open_line(self.url.host, self.url.port)
        except (OSError, termios.error) as error:
            self._retry.failed(now, str(error.args[-1] if error.args else error))
            return
        self._stream = Stream(descriptor, QUEUE_BYTES, self._pace)
        self._retry.opened()


def _take_for_us(descriptor: int) -> None:
    """Lock a device: two readers would share its bytes.

    Raises:
        OSError: if another program has locked it.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise OSError(errno.EBUSY, "another program uses it") from error


def _open_line(path: str, baud: int) -> int:
    """Open a device raw at a speed, for this program alone.

    Raises:
        OSError: if it cannot be opened.
        termios.error: if it is no terminal.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        _take_for_us(descriptor)
        characters = termios.tcgetattr(descriptor)[_CHARACTERS]
        characters[termios.VMIN] = 1  # So that reading nothing means that the line is gone
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
