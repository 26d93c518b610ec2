"""`run`, which is also what the program does when nothing is asked for: serve the edge server."""

import logging
from collections.abc import Mapping, Sequence
from typing import Final

from ulid import ULID

from mavlink_broker import config
from mavlink_broker.app import App
from mavlink_broker.cli.program import (
    FAILED,
    SUCCEEDED,
    Signals,
    SystemClock,
    UsageError,
    begin_log,
    open_link,
)
from mavlink_broker.config import Config
from mavlink_broker.edge.client import EdgeClient
from mavlink_broker.edge.spool import MIB, Spool, SpoolBusyError, SpoolError
from mavlink_broker.recovery.folder import JournalFolder
from mavlink_broker.recovery.writer import JournalWriter
from mavlink_broker.supervision import Alarm
from mavlink_broker.worker_pool import Workshop

LAST_POSTS_WITHIN_S: Final = 1.0
"""How long a stopping broker goes on telling what it has to tell."""

_LOG = logging.getLogger(__name__)


def run(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run until told to stop; gives the exit status, 1 if a thread has failed for good.

    Raises:
        UsageError: if the link cannot be opened, or another broker has the state folder.
    """
    settings = config.load(arguments, environment)
    begin_log(settings.log_level, settings.log_file)
    spool = open_spool(settings)
    link = open_link(settings)
    signals, alarm = Signals(), Alarm(link.wake)
    edge = EdgeClient(
        settings.edge_url,
        settings.key_file,
        link.wake,
        ca_file=settings.edge_ca_file,
        spool=spool,
    )
    edge.start()
    workshop = Workshop(link.wake)
    workshop.start()
    journal = JournalWriter(JournalFolder(settings.journal), link.wake)
    app = App(settings, link, edge, SystemClock(), lambda: str(ULID()), workshop, journal)
    _LOG.info("links %s, edge server %s", " ".join(map(str, link.urls)), settings.edge_url)
    while not (signals.stop or alarm.is_raised):
        app.step()
    workshop.stop()
    app.close()
    edge.stop(LAST_POSTS_WITHIN_S)
    journal.close()
    link.close()
    return FAILED if alarm.is_raised else SUCCEEDED


def open_spool(settings: Config) -> Spool | None:
    """Take the state folder; None if it cannot be used, which is no reason not to fly.

    Raises:
        UsageError: if another broker has it.
    """
    try:
        return Spool(settings.spool, most_bytes=settings.spool_mib * MIB)
    except SpoolBusyError as error:
        raise UsageError(f"{error}; each broker needs a STATE_DIR of its own") from error
    except SpoolError as error:
        _LOG.warning("what waits for the edge server is kept in memory alone: %s", error)
        return None
