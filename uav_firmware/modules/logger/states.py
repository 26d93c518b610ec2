"""Whether a log is being written.

    IDLE --WANTED--> RECORDING --UNWANTED--> FINISHING --UNWANTED--> IDLE
    FINISHING --WANTED--> RECORDING
    IDLE, RECORDING --REFUSED--> BROKEN --UNWANTED--> IDLE
    FINISHING --REFUSED--> IDLE

Events come twice a second. FINISHING keeps the moment after the end. A medium that has refused
is asked again for the next flight.
"""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final


class Logging(Enum):
    """Where the log stands."""

    IDLE = auto()
    RECORDING = auto()
    FINISHING = auto()
    BROKEN = auto()


class LoggingEvent(Enum):
    """What moves it on."""

    WANTED = auto()  # SDLOG_MODE wants a log now
    UNWANTED = auto()
    REFUSED = auto()  # the medium has refused


TRANSITIONS: Final[Mapping[tuple[Logging, LoggingEvent], Logging]] = {
    (Logging.IDLE, LoggingEvent.WANTED): Logging.RECORDING,
    (Logging.IDLE, LoggingEvent.REFUSED): Logging.BROKEN,
    (Logging.RECORDING, LoggingEvent.UNWANTED): Logging.FINISHING,
    (Logging.RECORDING, LoggingEvent.REFUSED): Logging.BROKEN,
    (Logging.FINISHING, LoggingEvent.WANTED): Logging.RECORDING,
    (Logging.FINISHING, LoggingEvent.UNWANTED): Logging.IDLE,
    (Logging.FINISHING, LoggingEvent.REFUSED): Logging.IDLE,
    (Logging.BROKEN, LoggingEvent.UNWANTED): Logging.IDLE,
}


def next_state(state: Logging, event: LoggingEvent) -> Logging:
    """Follow the table; an event that it does not name changes nothing."""
    return TRANSITIONS.get((state, event), state)


def wanted(mode: int, *, armed: bool, flown: bool) -> bool:
    """Whether SDLOG_MODE wants a log; `flown` tells of an armed time since boot.

    Negative never, 0 while armed, 1 until the first disarming, 2 always.
    """
    if mode < 0:
        return False
    if mode == 0:
        return armed
    return armed or mode == 2 or not flown
