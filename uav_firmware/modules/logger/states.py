"""State machine of the log file.

    IDLE --WANTED--> RECORDING --UNWANTED--> FINISHING --UNWANTED--> IDLE
    FINISHING --WANTED--> RECORDING
    IDLE, RECORDING --STORAGE_ERROR--> BROKEN --UNWANTED--> IDLE
    FINISHING --STORAGE_ERROR--> IDLE

Events come twice a second. FINISHING logs half a second more after the end. After a storage error
the next flight tries again.
"""

from collections.abc import Mapping
from enum import Enum, auto
from typing import Final


class Logging(Enum):
    """State of the log file."""

    IDLE = auto()
    RECORDING = auto()
    FINISHING = auto()
    BROKEN = auto()


class LoggingEvent(Enum):
    """Cause of a transition."""

    WANTED = auto()  # SDLOG_MODE wants a log now
    UNWANTED = auto()
    STORAGE_ERROR = auto()  # A storage error


TRANSITIONS: Final[Mapping[tuple[Logging, LoggingEvent], Logging]] = {
    (Logging.IDLE, LoggingEvent.WANTED): Logging.RECORDING,
    (Logging.IDLE, LoggingEvent.STORAGE_ERROR): Logging.BROKEN,
    (Logging.RECORDING, LoggingEvent.UNWANTED): Logging.FINISHING,
    (Logging.RECORDING, LoggingEvent.STORAGE_ERROR): Logging.BROKEN,
    (Logging.FINISHING, LoggingEvent.WANTED): Logging.RECORDING,
    (Logging.FINISHING, LoggingEvent.UNWANTED): Logging.IDLE,
    (Logging.FINISHING, LoggingEvent.STORAGE_ERROR): Logging.IDLE,
    (Logging.BROKEN, LoggingEvent.UNWANTED): Logging.IDLE,
}


def next_state(state: Logging, event: LoggingEvent) -> Logging:
    """Return the state after an event; an event without a transition changes nothing."""
    return TRANSITIONS.get((state, event), state)


def wanted(mode: int, *, armed: bool, flown: bool) -> bool:
    """Whether SDLOG_MODE asks for a log; `flown` means that the vehicle was armed since boot.

    Negative never, 0 while armed, 1 until the first disarming, 2 always.
    """
    if mode < 0:
        return False
    if mode == 0:
        return armed
    return armed or mode == 2 or not flown
