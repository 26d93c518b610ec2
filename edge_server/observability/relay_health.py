"""How the relay is, seen from another process: by its lock, its tally and its supervisor's."""

import fcntl
import os
from typing import Final, NamedTuple

from edge_server.config import Config
from edge_server.outbox.counting import UPLINK, Uplink
from edge_server.store import tally
from edge_server.store.tally import PART_DEATHS

_RELAY: Final = "relay"


class RelayHealth(NamedTuple):
    """The state of the uplink, and how often a relay of this state folder has died."""

    uplink: Uplink
    deaths: int


def look(config: Config) -> RelayHealth:
    """See how the relay is now."""
    deaths = tally.read(config.supervisor_tally_path).get(PART_DEATHS, {}).get((_RELAY,), 0.0)
    return RelayHealth(_uplink(config), int(deaths))


def _uplink(config: Config) -> Uplink:
    if not _runs(config):
        return Uplink.STOPPED
    said = tally.read(config.relay_tally_path).get(UPLINK, {}).get((), Uplink.OPEN)
    return Uplink(int(said)) if said in set(Uplink) else Uplink.OPEN


def _runs(config: Config) -> bool:
    """Whether somebody holds the relay's lock; a free one is held here for a moment."""
    try:
        descriptor = os.open(config.relay_lock_path, os.O_RDONLY | os.O_CLOEXEC)
    except FileNotFoundError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    else:
        return False
    finally:
        os.close(descriptor)
