"""Lines to a stream whose reader may block: the control loop does not wait for it.

A terminal that is paused, or a program that stops reading our pipe, blocks a `print`. So a thread
writes the lines of a paced vehicle. Lines for which there is no room, or that the stream refuses,
are lost and counted; their number is written before the next line.
"""

from queue import Empty, Full, Queue
from threading import Lock, Thread
from typing import Final, TextIO

WAITING_MAX: Final = 1000
"""Length of the queue."""
_CLOSE_S: Final = 1.0


class LineWriter:
    """Writes lines in a thread."""

    def __init__(self, stream: TextIO, *, waiting_max: int = WAITING_MAX) -> None:
        """Begin to write to a stream."""
        self._stream = stream
        self._lines: Queue[str | int | None] = Queue(waiting_max)  # A number is of lines lost
        self._lost = 0
        self._lock = Lock()
        self._writing_thread = Thread(target=self._write, name="lines", daemon=True)
        self._writing_thread.start()

    def write(self, line: str) -> None:
        """Queue a line without its end; it is lost while the queue is full."""
        with self._lock:
            lost, self._lost = self._lost, 0
        try:
            if lost:
                self._lines.put_nowait(lost)
                lost = 0
            self._lines.put_nowait(line)
        except Full:
            self._count_lost(lost + 1)

    def close(self) -> None:
        """Write the queued lines; waits at most one second for a blocked stream."""
        try:
            self._lines.put(None, timeout=_CLOSE_S)
        except Full:
            return
        self._writing_thread.join(_CLOSE_S)

    def _count_lost(self, number: int) -> None:
        with self._lock:
            self._lost += number

    def _write(self) -> None:
        while True:
            lines, ends = self._waiting()
            try:
                self._print(lines)
            except UnicodeEncodeError:  # Nothing is written then: one line costs itself only
                for line in lines:
                    self._try(line)
            except (OSError, ValueError):  # Its reader is gone, or it is closed
                self._count_lost(sum(map(_number, lines)))
            if ends:
                return

    def _try(self, line: str | int) -> None:
        try:
            self._print([line])
        except (OSError, ValueError):
            self._count_lost(_number(line))

    def _print(self, lines: list[str | int]) -> None:
        self._stream.write("".join(f"{_text(line)}\n" for line in lines))
        self._stream.flush()

    def _waiting(self) -> tuple[list[str | int], bool]:
        """All lines that wait, at least one; and whether it was closed behind them."""
        line = self._lines.get()
        lines: list[str | int] = []
        while line is not None:
            lines.append(line)
            try:
                line = self._lines.get_nowait()
            except Empty:
                return lines, False
        return lines, True


def _text(line: str | int) -> str:
    return line if isinstance(line, str) else f"{line} lines lost: not written in time, or refused"


def _number(line: str | int) -> int:
    """How many lines are lost with this one."""
    return 1 if isinstance(line, str) else line
