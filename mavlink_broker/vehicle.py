"""One vehicle as the broker sees it: its link, its family, its newest words."""

from collections import deque
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from mavlink_broker.dialect import Message, mavlink
from mavlink_broker.protocol.heartbeat import LinkState, LinkWatch
from mavlink_broker.protocol.reboot import RebootWatch
from mavlink_broker.protocol.round_trip import RoundTrip
from mavlink_broker.protocol.route import Route
from mavlink_broker.translation.families import GENERIC, Family, family_of
from mavlink_broker.translation.modes import ModeRole
from mavlink_broker.translation.telemetry import Snapshot

WORDS_KEPT: Final = 8


class Words(NamedTuple):
    """One STATUSTEXT of warning or worse."""

    time: float
    text: str


@dataclass(slots=True)
class Vehicle:
    """Everything known of one vehicle."""

    vehicle_id: int
    route: Route
    family: Family = GENERIC
    snapshot: Snapshot = field(default_factory=Snapshot)
    link: LinkWatch = field(default_factory=LinkWatch)
    round_trip: RoundTrip = field(default_factory=RoundTrip)
    _reboots: RebootWatch = field(default_factory=RebootWatch)
    _words: deque[Words] = field(default_factory=lambda: deque(maxlen=WORDS_KEPT))

    def take(self, message: Message, now: float) -> bool:
        """Learn from a message of the vehicle; true when it proves that it was restarted."""
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.link.heard(now)
            self.family = family_of(message.autopilot)
        elif kind == "STATUSTEXT" and message.severity <= mavlink.MAV_SEVERITY_WARNING:
            self._words.append(Words(now, message.text.strip()))
        rebooted = hasattr(message, "time_boot_ms") and self._reboots.sample(message.time_boot_ms)
        if rebooted:
            self.snapshot.forget()
            self._words.clear()
        self.snapshot.take(message)
        return rebooted

    def link_state(self, now: float) -> LinkState:
        """Judge its link."""
        return self.link.state(now)

    def is_heard(self, now: float) -> bool:
        """Whether it can be spoken to; a stale link may still come back."""
        return self.link.state(now) is not LinkState.LOST

    @property
    def mode(self) -> str:
        """Name of its flight mode."""
        return self.family.mode_name(self.snapshot.base_mode, self.snapshot.custom_mode)

    @property
    def mode_role(self) -> ModeRole:
        """What its flight mode means to a mission."""
        return self.family.mode_role(self.mode)

    def words_since(self, time: float) -> str | None:
        """Its latest complaint since a time, or None."""
        return next((w.text for w in reversed(self._words) if w.time >= time and w.text), None)
