"""Lines to a stream that may be stuck: whoever reads it, the control loop does not wait for him.

A terminal that is paused, or a program that stops reading our pipe, blocks a `print`. So a thread
writes the lines of a paced vehicle. Lines for which there is no room are lost and counted; the
next line that can be written says how many.
"""

from queue import Empty, Full, Queue
from threading import Thread
from typing import Final, TextIO

WAITING_MAX: Final = 1000
"""Lines that may wait."""
_CLOSE_S: Final = 1.0


class LineWriter:
    """Writes lines beside the loop."""

    def __init__(self, stream: TextIO, *, waiting_max: int = WAITING_MAX) -> None:
        """Begin to write to a stream."""
        self._stream = stream
        self._lines: Queue[str | None] = Queue(waiting_max)
        self._lost = 0
        self._thread = Thread(target=self._write, name="lines", daemon=True)
        self._thread.start()

    def write(self, line: str) -> None:
        """Write a line soon, without its end; it is lost where too many wait."""
        if self._lost:
            lost = f"{self._lost} lines lost: nobody has read them in time"
            try:
                self._lines.put_nowait(lost)
            except Full:
                self._lost += 1
                return
            self._lost = 0
        try:
            self._lines.put_nowait(line)
        except Full:
            self._lost += 1

    def close(self) -> None:
        """Write what waits; a stream that is stuck is waited for no longer than a second."""
        try:
            self._lines.put(None, timeout=_CLOSE_S)
        except Full:
            return
        self._thread.join(_CLOSE_S)

    def _write(self) -> None:
        while True:
            lines, ends = self._waiting()
            try:
                self._stream.write("".join(f"{line}\n" for line in lines))
                self._stream.flush()
            except OSError:
                return  # Nobody reads it any more: the vehicle flies on without a word
            if ends:
                return

    def _waiting(self) -> tuple[list[str], bool]:
        """All lines that wait, at least one; and whether it was closed behind them."""
        line = self._lines.get()
        lines: list[str] = []
        while line is not None:
            lines.append(line)
            try:
                line = self._lines.get_nowait()
            except Empty:
                return lines, False
        return lines, True
