"""`python -m mavlink_broker`: the broker as a program."""

import logging
import os
import signal
import sys
import time
from datetime import UTC, datetime
from types import FrameType

from ulid import ULID

from mavlink_broker import config
from mavlink_broker.app import App
from mavlink_broker.edge_client import EdgeClient
from mavlink_broker.link import PortBusyError, UdpLink

LAST_POSTS_WITHIN_S = 1.0
"""How long a stopping broker goes on telling what it has to tell."""

_LOG = logging.getLogger("mavlink_broker")


class SystemClock:
    """The machine's clock."""

    def monotonic(self) -> float:  # a clock is handed in as an object
        """Seconds that never go back."""
        return time.monotonic()

    def utc(self) -> datetime:  # as above
        """Time of day."""
        return datetime.now(UTC)


class _Signals:
    """Remembers that the program was asked to stop."""

    def __init__(self) -> None:
        self.stop = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, number: int, frame: FrameType | None) -> None:
        del number, frame
        self.stop = True


def main() -> int:
    """Run until told to stop; gives the exit status."""
    settings = config.load(sys.argv[1:], os.environ)
    logging.basicConfig(
        level=settings.log_level, format="%(asctime)s %(levelname)s %(name)s: %(message)s"
    )
    try:
        link = UdpLink(settings.mavlink_host, settings.mavlink_port)
    except PortBusyError as error:
        print(f"mavlink_broker: {error}", file=sys.stderr)
        return 2
    signals = _Signals()
    edge = EdgeClient(
        settings.edge_url, settings.key_file, link.wake, ca_file=settings.edge_ca_file
    )
    edge.start()
    app = App(settings, link, edge, SystemClock(), lambda: str(ULID()))
    _LOG.info("listening on UDP %d, edge server %s", link.port, settings.edge_url)
    while not signals.stop:
        app.step()
    edge.stop(LAST_POSTS_WITHIN_S)
    link.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
