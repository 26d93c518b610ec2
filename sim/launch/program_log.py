"""What one program prints, kept in files of bounded size: `edge.log`, `edge.log.1`, ..."""

from pathlib import Path
from typing import BinaryIO, Final

BYTES_MAX: Final = 10 * 1024 * 1024
"""Size at which a log is renamed and another begun."""
KEPT: Final = 3
"""Former logs that are kept; `.1` is the latest."""


class ProgramLog:
    """Appends lines; a medium that refuses costs the lines, never the program that prints them."""

    def __init__(self, path: Path, *, bytes_max: int = BYTES_MAX, kept: int = KEPT) -> None:
        """Append to a file that may exist; it is opened with the first line."""
        self._path = path
        self._bytes_max = bytes_max
        self._kept = kept
        self._file: BinaryIO | None = None
        self.lines_lost = 0

    def append(self, line: bytes) -> bool:
        """Keep a line with its end; gives whether the medium has taken it."""
        try:
            file = self._opened()
            if file.tell() and file.tell() + len(line) > self._bytes_max:
                self._rotate()
                file = self._opened()
            file.write(line)
        except OSError:
            self.lines_lost += 1
            self.close()  # The next line opens whatever is there then
            return False
        return True

    def close(self) -> None:
        """Keep nothing more."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _opened(self) -> BinaryIO:
        if self._file is None:
            self._file = self._path.open("ab", buffering=0)
        return self._file

    def _rotate(self) -> None:
        """Rename every log to the next number; the last is replaced."""
        self.close()
        for number in range(self._kept, 0, -1):
            former = self._numbered(number - 1)
            if former.exists():
                former.replace(self._numbered(number))

    def _numbered(self, number: int) -> Path:
        return self._path.with_name(f"{self._path.name}.{number}") if number else self._path
