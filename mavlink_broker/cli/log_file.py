"""The broker's log in files of bounded size: `broker.log`, `broker.log.1`, ...

A disk that refuses costs the lines that it does not take, and never the program; that it refuses is
logged once, to the standard error.
"""

import logging
import sys
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Final

BYTES_MAX: Final = 10 * 1024 * 1024
"""Size at which a file is renamed and the next one begun."""
KEPT: Final = 4
"""Former files that are kept; `.1` is the latest."""


class LogFile(RotatingFileHandler):
    """Writes lines, each with its level and time."""

    def __init__(self, path: Path, *, bytes_max: int = BYTES_MAX, kept: int = KEPT) -> None:
        """Write to a file, which is opened with the first line."""
        super().__init__(path, maxBytes=bytes_max, backupCount=kept, encoding="utf-8", delay=True)
        self._path = path
        self.lines_lost = 0

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802  # logging's name
        """Count a line that was not taken."""
        error = sys.exc_info()[1]
        if not isinstance(error, OSError):
            super().handleError(record)
            return
        if not self.lines_lost:
            sys.stderr.write(f"{self._path} takes no lines: {error.strerror}\n")
        self.lines_lost += 1
