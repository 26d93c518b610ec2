"""Counts what ground stations were refused, and says so now and then."""

import logging
from collections import Counter
from typing import Final

from mavlink_broker.mavlink.dialect import Message, mavlink

TELL_EVERY_S: Final = 10.0
"""At most one line in so long; a stick refused at 25 Hz is one fact."""

TEXT_LENGTH: Final = 50
"""Of a STATUSTEXT."""
KINDS_TOLD: Final = 8
KINDS_KEPT: Final = 500
"""More kinds than that are one: an endless series of unknown messages must not fill memory."""
OTHERS: Final = "other messages"
UNKNOWN: Final = "unknown message"

_LOG = logging.getLogger(__name__)


class Refusals:
    """The counts since the start, by what was refused."""

    def __init__(self) -> None:
        self.count: Counter[str] = Counter()
        self._told: Counter[str] = Counter()
        self._tell_at = 0.0
        self._said_at: dict[tuple[int, str], float] = {}

    def add(self, message: Message, system: int, now: float) -> str | None:
        """Count a refusal; gives a sentence for the ground station, unless it has had it."""
        name = name_of(message)
        if name not in self.count and len(self.count) >= KINDS_KEPT:
            name = OTHERS
        self.count[name] += 1
        if now - self._said_at.get((system, name), now - TELL_EVERY_S) < TELL_EVERY_S:
            return None
        self._said_at[system, name] = now
        return f"A mission of the broker runs: no {name}"[:TEXT_LENGTH]

    def tell(self, now: float) -> None:
        """Write the counts down when it is time."""
        new = self.count - self._told
        if not new or now < self._tell_at:
            return
        self._tell_at = now + TELL_EVERY_S
        self._told = self.count.copy()
        what = ", ".join(f"{number} {name}" for name, number in new.most_common(KINDS_TOLD))
        what += f", and {len(new) - KINDS_TOLD} kinds more" if len(new) > KINDS_TOLD else ""
        _LOG.warning("refused to ground stations: %s", what)


def name_of(message: Message) -> str:
    """What a message is called when it is refused; a command by its own name."""
    kind: str = message.get_type()
    if isinstance(message, mavlink.MAVLink_unknown):
        return UNKNOWN
    if kind not in {"COMMAND_LONG", "COMMAND_INT"}:
        return kind
    entry = mavlink.enums["MAV_CMD"].get(message.command)
    if entry is None:
        return f"command {message.command}"
    return str(entry.name).removeprefix("MAV_CMD_")
