"""Counts refused messages of ground stations and logs them periodically."""

import logging
from collections import Counter
from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink

LOG_INTERVAL_S: Final = 10.0
"""Interval of log lines and of STATUSTEXTs: MANUAL_CONTROL may be refused at 25 Hz."""

TEXT_LENGTH: Final = 50
"""Longest text of a STATUSTEXT."""
KINDS_LOGGED: Final = 8
KINDS_KEPT: Final = 500
"""Further kinds are counted as one: endless unknown messages must not fill the memory."""
OTHERS: Final = "other messages"
UNKNOWN: Final = "unknown message"

_LOG = logging.getLogger(__name__)


class Refusals:
    """Counts since the start, by kind of message."""

    def __init__(self) -> None:
        self.count: Counter[str] = Counter()
        self._logged: Counter[str] = Counter()
        self._log_at = 0.0
        self._explained_at: dict[tuple[int, str], float] = {}

    def add(self, message: Message, system: int, now: float) -> str | None:
        """Count a refusal; returns a text for the ground station unless it got one recently."""
        name = name_of(message)
        if name not in self.count and len(self.count) >= KINDS_KEPT:
            name = OTHERS
        self.count[name] += 1
        if now - self._explained_at.get((system, name), now - LOG_INTERVAL_S) < LOG_INTERVAL_S:
            return None
        self._explained_at[system, name] = now
        return f"Denied during a broker mission: {name}"[:TEXT_LENGTH]

    def log_new(self, now: float) -> None:
        """Log the new counts when it is due."""
        new = self.count - self._logged
        if not new or now < self._log_at:
            return
        self._log_at = now + LOG_INTERVAL_S
        self._logged = self.count.copy()
        what = ", ".join(f"{number} {name}" for name, number in new.most_common(KINDS_LOGGED))
        what += f", and {len(new) - KINDS_LOGGED} more kinds" if len(new) > KINDS_LOGGED else ""
        _LOG.warning("refused to ground stations: %s", what)


def name_of(message: Message) -> str:
    """Name of a message in the counts; a command by the name of its MAV_CMD."""
    kind: str = message.get_type()
    if isinstance(message, mavlink.MAVLink_unknown):
        return UNKNOWN
    if kind not in {"COMMAND_LONG", "COMMAND_INT"}:
        return kind
    entry = mavlink.enums["MAV_CMD"].get(message.command)
    if entry is None:
        return f"command {message.command}"
    return str(entry.name).removeprefix("MAV_CMD_")
