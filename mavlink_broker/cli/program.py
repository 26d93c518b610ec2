"""What every long-running command needs of the machine: a clock, signals, a log, a link.

UsageError      what was asked for cannot be begun; one sentence, and the exit status
  +- BusyError  another program has the link
"""

import argparse
import logging
import os
import signal
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Final

from mavlink_broker import config
from mavlink_broker.cli.log_file import LogFile
from mavlink_broker.config import Config
from mavlink_broker.links.hub import Hub, open_links
from mavlink_broker.links.link import LinkError, PortBusyError
from mavlink_broker.links.url import LinkUrl, LinkUrlError

SUCCEEDED: Final = 0
FAILED: Final = 1
MISUSED: Final = 2
INTERRUPTED: Final = 130
"""As shells tell of a program that SIGINT has ended."""
TERMINATED: Final = 143
HUNG_UP: Final = 129
_STATUSES: Final = {
    signal.SIGINT: INTERRUPTED,
    signal.SIGTERM: TERMINATED,
    signal.SIGHUP: HUNG_UP,
}

_LOG = logging.getLogger(__name__)
_LOG_FORMAT: Final = "%(asctime)s %(levelname)s %(name)s: %(message)s"


class UsageError(Exception):
    """What was asked for cannot be begun."""

    def __init__(self, sentence: str, status: int = MISUSED) -> None:
        super().__init__(sentence)
        self.status = status


class BusyError(UsageError):
    """Another program has the link."""


class SystemClock:
    """The machine's clock."""

    def monotonic(self) -> float:  # a clock is handed in as an object
        """Seconds that never go back."""
        return time.monotonic()

    def utc(self) -> datetime:  # as above
        """Time of day."""
        return datetime.now(UTC)


class Signals:
    """Remembers that the program was asked to stop, and how often."""

    def __init__(self) -> None:
        self.count = 0
        self.status = SUCCEEDED  # That tells which signal it was
        for number in _STATUSES:
            if number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
                continue  # As nohup wants it; `&` in a script ignores SIGINT too, which ends us
            signal.signal(number, self._note)

    @property
    def stop(self) -> bool:
        """Whether any came."""
        return self.count > 0

    def _note(self, number: int, frame: FrameType | None) -> None:
        del frame
        self.count += 1
        self.status = _STATUSES[signal.Signals(number)]


class Voice:
    """Says lines on the standard output for as long as that takes them.

    What flies vehicles must not end because its reader has gone, or a disk is full.
    """

    def __init__(self) -> None:
        self._is_heard = True

    def say(self, line: str) -> None:
        """Say a line, or nothing."""
        if not self._is_heard:
            return
        try:
            put(line)
        except UsageError as error:
            self._is_heard = False
            _LOG.warning("nothing more is said: %s", error)


def put(text: str) -> None:
    """Print on the standard output.

    Raises:
        UsageError: if nobody reads it, or it has no room.
    """
    try:
        print(text, flush=True)
    except OSError as error:
        nowhere = os.open(os.devnull, os.O_WRONLY)  # For what is still to be flushed at the end
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
        raise UsageError(f"the standard output: {error.strerror}") from None


def begin_log(level: str, file: Path | None = None) -> None:
    """Log to the standard error, and to a file of bounded size where one is named.

    pymavlink logs a line for every old frame, which the guard counts and logs twice a minute.
    """
    logging.basicConfig(level=level, format=_LOG_FORMAT)
    logging.getLogger("pymavlink").setLevel(logging.WARNING)
    if file is not None:
        handler = LogFile(file)
        handler.setFormatter(logging.Formatter(_LOG_FORMAT))
        logging.getLogger().addHandler(handler)


def open_link(settings: Config) -> Hub:
    """Open the links of vehicles and ground stations.

    Raises:
        BusyError: if another program has one.
        UsageError: if one cannot be opened, and will not come by itself.
    """
    try:
        return open_links([*settings.vehicle_links, *settings.traffic.forward])
    except PortBusyError as error:
        raise BusyError(str(error)) from error
    except LinkError as error:
        raise UsageError(str(error)) from error


def terminal_parser(
    environment: Mapping[str, str], *, word: str, description: str
) -> argparse.ArgumentParser:
    """Begin the options of a word that needs no edge server: settings, `--connect`, `--json`."""
    parser = config.settings_parser(
        environment, prog=f"mavlink_broker {word}", description=description
    )
    parser.set_defaults(log_level=environment.get("LOG_LEVEL") or "WARNING")
    parser.add_argument("--connect", metavar="URL", help="the vehicles' link: udp://0.0.0.0:14540")
    parser.add_argument("--json", action="store_true", help="as lines of JSON")
    return parser


def connected(settings: Config, url: str | None) -> Config:
    """Give the settings with another link, where one is asked for.

    Raises:
        UsageError: if it is none.
    """
    if url is None:
        return settings
    try:
        link = LinkUrl.parse(url)
    except LinkUrlError as error:
        raise UsageError(str(error)) from error
    return replace(settings, traffic=replace(settings.traffic, links=(link,)))
