"""`run`, the default command: flies the missions of the edge server."""

import logging
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Final

from ulid import ULID

from mavlink_broker import config
from mavlink_broker.app import App
from mavlink_broker.cli.program import (
    FAILED,
    SUCCEEDED,
    Signals,
    SystemClock,
    configure_logging,
    open_database,
    open_link,
)
from mavlink_broker.config import Config
from mavlink_broker.database import Database
from mavlink_broker.edge.bounded_http import EdgeConnection
from mavlink_broker.edge.client import EdgeClient
from mavlink_broker.edge.spool import MIB, Spool
from mavlink_broker.edge.uploads import FrameUploader, LogUploader
from mavlink_broker.effects import Job, LogJob, SendFrames
from mavlink_broker.journal import JournalTable, JournalWriter
from mavlink_broker.pictures.worker_pool import Handler, WorkerPool
from mavlink_broker.supervision import ThreadFailureHook

LAST_POSTS_WITHIN_S: Final = 1.0
"""How long a stopping broker continues to send posts."""

_LOG = logging.getLogger(__name__)


def run(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run until a signal; gives the exit status, 1 if a thread has failed for good.

    Raises:
        UsageError: if the link cannot be opened, or another broker uses the state folder.
    """
    settings = config.load(arguments, environment)
    configure_logging(settings.log_level, settings.log_file)
    database = open_database(settings)
    spool = open_spool(database, settings)
    link = open_link(settings)
    signals, alarm = Signals(), ThreadFailureHook(link.wake)
    edge = EdgeClient(
        settings.edge_url,
        settings.key_file,
        link.wake,
        ca_file=settings.edge_ca_file,
        spool=spool,
        instance_id=database.instance_id,
    )
    edge.start()
    worker_pool = WorkerPool(link.wake, new_uploaders(settings, database.instance_id))
    worker_pool.start()
    journal = JournalWriter(JournalTable(database), link.wake)
    journal.start()
    app = App(settings, link, edge, SystemClock(), lambda: str(ULID()), worker_pool, journal)
    _LOG.info("links %s, edge server %s", " ".join(map(str, link.urls)), settings.edge_url)
    while not (signals.stop or alarm.has_fired):
        app.step()
    worker_pool.stop()
    app.close()
    edge.stop(LAST_POSTS_WITHIN_S)
    journal.close()
    database.close()
    link.close()
    return FAILED if alarm.has_fired else SUCCEEDED


def new_uploaders(settings: Config, instance_id: str) -> dict[type[Job], Handler]:
    """Make what sends vehicles' logs, and frames if there is a frame log, to the edge server."""
    connect = partial(
        EdgeConnection, settings.edge_url, settings.key_file, settings.edge_ca_file, instance_id
    )
    uploaders: dict[type[Job], Handler] = {LogJob: LogUploader(connect)}
    if settings.traffic.tlog_dir is not None:
        uploaders[SendFrames] = FrameUploader(connect, settings.traffic.tlog_dir)
    return uploaders


def open_spool(database: Database, settings: Config) -> Spool | None:
    """Read the spool; None if the state folder cannot be used: the broker flies without it."""
    try:
        return Spool(database, max_bytes=settings.spool_mib * MIB)
    except OSError as error:
        _LOG.warning(
            "posts that wait for the edge server are kept in memory only: %s: %s",
            *(database.folder, error.strerror or error),
        )
        return None
