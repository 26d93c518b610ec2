"""Orders to break and to mend, from outside, while a vehicle flies: lines added to a file.

    echo "motor_loss motor=2" >> var/vehicle-1/faults.txt

A plain file needs no tool, no port and no permission beyond those of the folder, outlives
both sides, and can be read afterwards. What became of each order, and when each fault began
and ended, stands in `faults.log` beside it.
"""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from sim.fault_schedule import Fault

ORDERS_NAME: Final = "faults.txt"
LOG_NAME: Final = "faults.log"
_MOST_AT_ONCE: Final = 65_536  # [bytes]
_LONGEST_LINE: Final = 1000  # [characters]


class FaultConsole:
    """The two files of one vehicle, new and empty at the start.

    Raises:
        OSError: if they cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._orders = os.open(folder / ORDERS_NAME, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
        try:
            self._log = (folder / LOG_NAME).open("w", encoding="utf-8", newline="\n")
        except OSError:
            os.close(self._orders)
            raise
        self._offset = 0
        self._rest = b""
        self._active: tuple[Fault, ...] = ()

    def poll(self) -> list[str]:
        """Lines that have been added since the last call; none waits for its end.

        Raises:
            OSError: if the file cannot be read any more.
        """
        size = os.fstat(self._orders).st_size
        if size < self._offset:  # Written anew by `>` instead of `>>`
            self._offset, self._rest = 0, b""
        if size == self._offset:
            return []
        new = os.pread(self._orders, _MOST_AT_ONCE, self._offset)
        self._offset += len(new)
        *lines, self._rest = (self._rest + new).split(b"\n")
        self._rest = self._rest[-_LONGEST_LINE:]
        texts = (line[:_LONGEST_LINE].decode("utf-8", "replace").strip() for line in lines)
        return [text for text in texts if text and not text.startswith("#")]

    def note(self, time_us: int, text: str) -> None:
        """Write a line to the log.

        Raises:
            OSError: if it cannot be written.
        """
        self._log.write(f"{time_us * 1e-6:.3f} s {text}\n")
        self._log.flush()

    def note_active(self, time_us: int, active: Iterable[Fault]) -> None:
        """Write down what has begun and what has ended since the last call."""
        now = tuple(active)
        if now == self._active:
            return
        for fault in self._active:
            if fault not in now:
                self.note(time_us, f"ended: {described(fault)}")
        for fault in now:
            if fault not in self._active:
                self.note(time_us, f"began: {described(fault)}")
        self._active = now

    def close(self) -> None:
        """Close both files; a second call does nothing."""
        if not self._log.closed:
            self._log.close()
            os.close(self._orders)


def described(fault: Fault) -> str:
    """A fault as an order would name it."""
    return " ".join((fault.kind, *(f"{name}={value:g}" for name, value in fault.values.items())))
