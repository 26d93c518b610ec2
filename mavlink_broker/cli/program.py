"""What every long-running command needs of the machine: clock, signals, log, output, link.

The log goes to the standard error and, on request, to files of limited size: `broker.log`,
`broker.log.1`, ... If the disk refuses, lines are lost and the program goes on; the first refusal
is written to the standard error.

UsageError          the command cannot start; one sentence and the exit status
  +- LinkBusyError  another program uses the link
"""

import argparse
import logging
import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path
from types import FrameType
from typing import Final

from farm_flight_bridge import program_name
from farm_flight_bridge.log_stream import UnblockedStreamHandler, standard_error
from mavlink_broker import config
from mavlink_broker.config import Config
from mavlink_broker.database import Database, DatabaseBusyError
from mavlink_broker.links.hub import Hub, open_links
from mavlink_broker.links.link import LinkError, PortBusyError
from mavlink_broker.links.url import LinkUrl, LinkUrlError

SUCCEEDED: Final = 0
FAILED: Final = 1
MISUSED: Final = 2
INTERRUPTED: Final = 130
"""The status that shells give to a program that SIGINT has ended."""
TERMINATED: Final = 143
HUNG_UP: Final = 129
_STATUSES: Final = {
    signal.SIGINT: INTERRUPTED,
    signal.SIGTERM: TERMINATED,
    signal.SIGHUP: HUNG_UP,
}

_EARLIER_FILES: Final = ("spool.words", "spool.pictures", "spool.dead", "vehicle-*.json")
"""Files of the spool and the journal before they were in one database."""
MAX_LOG_BYTES: Final = 10 * 1024 * 1024
"""Size at which a file is renamed and the next one is begun."""
MAX_LOG_FILES: Final = 4
"""Former files; `.1` is the latest."""


_LOG = logging.getLogger(__name__)
_LOG_FORMAT: Final = "%(asctime)s %(levelname)s %(name)s: %(message)s"


class UsageError(Exception):
    """The command cannot start."""

    def __init__(self, sentence: str, status: int = MISUSED) -> None:
        super().__init__(sentence)
        self.status = status


class LinkBusyError(UsageError):
    """Another program uses the link."""


class SystemClock:
    """The machine's clock."""

    def monotonic(self) -> float:  # a clock is passed as an object
        """Give seconds that never decrease."""
        return time.monotonic()

    def utc(self) -> datetime:  # as above
        """Give the time of day."""
        return datetime.now(UTC)


class Signals:
    """Counts the signals that ask the program to stop."""

    def __init__(self) -> None:
        self.count = 0
        self.status = SUCCEEDED  # The exit status of the last signal
        for number in _STATUSES:
            if number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
                continue  # Set by nohup; `&` in a script ignores SIGINT too, which must end us
            signal.signal(number, self._note)

    @property
    def stop(self) -> bool:
        """Whether a signal was received."""
        return self.count > 0

    def _note(self, number: int, frame: FrameType | None) -> None:
        del frame
        self.count += 1
        self.status = _STATUSES[signal.Signals(number)]


class OutputWriter:
    """Writes lines to the standard output until it fails.

    A program that flies vehicles must not end because its reader has ended, or a disk is full.
    """

    def __init__(self) -> None:
        self._is_open = True

    def write(self, line: str) -> None:
        """Write a line, unless a line before has failed."""
        if not self._is_open:
            return
        try:
            print_output(line)
        except UsageError as error:
            self._is_open = False
            _LOG.warning("no more output is written: %s", error)


def print_output(text: str) -> None:
    """Print on the standard output.

    Raises:
        UsageError: if its reader has ended, or there is no space.
    """
    try:
        print(text, flush=True)
    except OSError as error:
        null = os.open(os.devnull, os.O_WRONLY)  # For output that is flushed at the exit
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
        raise UsageError(f"the standard output: {error.strerror}") from None


def configure_logging(level: str, file: Path | None = None) -> None:
    """Log to the standard error, and to a file of limited size if one is named.

    pymavlink logs a line for every old frame; the broker counts them and logs twice a minute.
    """
    handlers = [UnblockedStreamHandler(standard_error())]
    logging.basicConfig(level=level, format=_LOG_FORMAT, handlers=handlers)
    logging.getLogger("pymavlink").setLevel(logging.WARNING)
    if file is not None:
        handler = LogFile(file)
        handler.setFormatter(logging.Formatter(_LOG_FORMAT))
        logging.getLogger().addHandler(handler)


class LogFile(RotatingFileHandler):
    """Writes lines, each with its level and time."""

    def __init__(
        self, path: Path, *, max_bytes: int = MAX_LOG_BYTES, max_files: int = MAX_LOG_FILES
    ) -> None:
        """Write to a file, which is created with the first line."""
        super().__init__(
            path, maxBytes=max_bytes, backupCount=max_files, encoding="utf-8", delay=True
        )
        self._path = path
        self.lines_lost = 0

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802  # logging's name
        """Count a line that was not written."""
        error = sys.exc_info()[1]
        if not isinstance(error, OSError):
            super().handleError(record)
            return
        self.lines_lost += 1
        if self.lines_lost == 1:  # This line comes here too
            _LOG.error("%s cannot be written: %s", self._path, error.strerror)


@contextmanager
def link_errors() -> Iterator[None]:
    """Give the errors of links as reasons why the command cannot start.

    Raises:
        LinkBusyError: if another program uses a link.
        UsageError: if a link cannot be opened, now or later.
    """
    try:
        yield
    except PortBusyError as error:
        raise LinkBusyError(str(error)) from error
    except LinkError as error:
        raise UsageError(str(error)) from error


def open_link(settings: Config) -> Hub:
    """Open the links of vehicles and ground stations.

    Raises:
        LinkBusyError, UsageError: as of `link_errors`.
    """
    with link_errors():
        return open_links([*settings.vehicle_links, *settings.traffic.forward])


def open_database(settings: Config) -> Database:
    """Open the broker's database; where the disk refuses, its users try again or go on without it.

    Raises:
        UsageError: if another broker uses the folder.
    """
    database = Database(settings.database_folder)
    try:
        database.open()
    except DatabaseBusyError as error:
        raise UsageError(f"{error.strerror}; each broker needs a STATE_DIR of its own") from error
    except OSError:
        return database  # Spool and journal log it
    files = (path for glob in _EARLIER_FILES for path in database.folder.glob(glob))
    if unread := [path.name for path in files if path.stat().st_size]:
        _LOG.warning("%s: files of an earlier format are not read: %s", database.folder, unread)
    return database


def offline_parser(
    environment: Mapping[str, str], *, command: str, description: str
) -> argparse.ArgumentParser:
    """Make the parser of a command without an edge server: settings, `--connect`, `--json`."""
    parser = config.settings_parser(
        environment, prog=f"{program_name('mavlink_broker')} {command}", description=description
    )
    parser.set_defaults(log_level=environment.get("LOG_LEVEL") or "WARNING")
    parser.add_argument("--connect", metavar="URL", help="the vehicles' link: udp://0.0.0.0:14540")
    parser.add_argument("--json", action="store_true", help="as lines of JSON")
    return parser


def add_state_dir(parser: argparse.ArgumentParser, environment: Mapping[str, str]) -> None:
    """Add the setting of the folder that a broker keeps its state in."""
    parser.add_argument(
        "--state-dir",
        type=Path,
        default=Path(environment.get("STATE_DIR") or "var"),
        help="folder of the broker's state: %(default)s (environment: STATE_DIR)",
    )


def with_link(settings: Config, url: str | None) -> Config:
    """Give the settings with another link, if one is named.

    Raises:
        UsageError: if the URL is invalid.
    """
    if url is None:
        return settings
    return replace(settings, traffic=replace(settings.traffic, links=(parse_link(url),)))


def parse_link(text: str) -> LinkUrl:
    """Read the URL of a link.

    Raises:
        UsageError: if it is invalid.
    """
    try:
        return LinkUrl.parse(text)
    except LinkUrlError as error:
        raise UsageError(str(error)) from error
