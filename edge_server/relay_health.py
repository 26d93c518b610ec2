"""Health of the relay, from other processes: by its lock, its tally and the supervisor's tally.

A relay that hangs keeps its lock and the last state in its tally. The holder of the lock therefore
notes in the lock file when its loop ran last, which no other process writes.
"""

import fcntl
import os
import time
from typing import Final, NamedTuple

from edge_server.config import Config
from edge_server.outbox.counts import UPLINK, UplinkState
from edge_server.store.files import tally
from edge_server.store.files.tally import PART_DEATHS, Tally

STALLED_AFTER_S: Final = 60.0
"""The loop runs every second and does not wait for the cloud; of what it does wait for, the longest
is a statement of PostgreSQL (30 s)."""
_RELAY: Final = "relay"
_RAN_AT: Final = "ran_at"
"""Monotonic time [s], which all processes of a machine share, since its boot."""


class Activity:
    """The note of when the relay's loop ran last; for the process that holds the lock."""

    def __init__(self, config: Config) -> None:
        """Use the lock file, and note that the loop runs."""
        self._tally = Tally(config.relay_lock_path)
        self.note()

    def note(self) -> None:
        """Note that the loop runs; costs no system call."""
        self._tally.put(_RAN_AT, value=time.monotonic())


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
    if _is_stalled(config):
        return UplinkState.STALLED
    state = tally.read(config.relay_tally_path).get(UPLINK, {}).get((), UplinkState.OPEN)
    return UplinkState(int(state)) if state in set(UplinkState) else UplinkState.OPEN


def _is_stalled(config: Config) -> bool:
    """Whether the loop has not run for long; one without a note, on a full disk, is trusted."""
    ran_at = tally.read(config.relay_lock_path).get(_RAN_AT, {}).get((), float("inf"))
    return time.monotonic() - ran_at > STALLED_AFTER_S


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
