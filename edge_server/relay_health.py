"""Health of the relay, from other processes: by its lock, its tally and the supervisor's tally."""

import fcntl
import os
from typing import Final, NamedTuple

from edge_server.config import Config
from edge_server.outbox.counts import UPLINK, UplinkState
from edge_server.store.files import tally
from edge_server.store.files.tally import PART_DEATHS

_RELAY: Final = "relay"


class RelayHealth(NamedTuple):
    """State of the uplink, and the number of exits of the relay."""

    uplink: UplinkState
    deaths: int


def read(config: Config) -> RelayHealth:
    """Read the health of the relay."""
    deaths = tally.read(config.supervisor_tally_path).get(PART_DEATHS, {}).get((_RELAY,), 0.0)
    return RelayHealth(_uplink(config), int(deaths))


def _uplink(config: Config) -> UplinkState:
    if not _runs(config):
        return UplinkState.STOPPED
    state = tally.read(config.relay_tally_path).get(UPLINK, {}).get((), UplinkState.OPEN)
    return UplinkState(int(state)) if state in set(UplinkState) else UplinkState.OPEN


def _runs(config: Config) -> bool:
    """Whether a relay holds the lock; a free one is taken for a moment."""
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
