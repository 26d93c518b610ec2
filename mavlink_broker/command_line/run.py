"""`run`, which is also what the program does when nothing is asked for: serve the edge server."""

import logging
from collections.abc import Mapping, Sequence
from typing import Final

from ulid import ULID

from mavlink_broker import config
from mavlink_broker.app import App
from mavlink_broker.command_line.program import (
    SUCCEEDED,
    Signals,
    SystemClock,
    begin_log,
    open_link,
)
from mavlink_broker.edge_client import EdgeClient
from mavlink_broker.workshop import Workshop

LAST_POSTS_WITHIN_S: Final = 1.0
"""How long a stopping broker goes on telling what it has to tell."""

_LOG = logging.getLogger(__name__)


def run(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run until told to stop; gives the exit status.

    Raises:
        UsageError: if the link cannot be opened.
    """
    settings = config.load(arguments, environment)
    begin_log(settings.log_level)
    link = open_link(settings)
    signals = Signals()
    edge = EdgeClient(
        settings.edge_url, settings.key_file, link.wake, ca_file=settings.edge_ca_file
    )
    edge.start()
    workshop = Workshop(link.wake)
    workshop.start()
    app = App(settings, link, edge, SystemClock(), lambda: str(ULID()), workshop)
    _LOG.info("links %s, edge server %s", " ".join(map(str, link.urls)), settings.edge_url)
    while not signals.stop:
        app.step()
    workshop.stop()
    edge.stop(LAST_POSTS_WITHIN_S)
    app.close()
    link.close()
    return SUCCEEDED
