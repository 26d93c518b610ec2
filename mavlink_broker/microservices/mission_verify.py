"""Verifies before a flight that the vehicle holds the uploaded plan.

MISSION_CURRENT must report the id of the acknowledgement. For vehicles without ids and for
uncertain uploads, the plan is read back and compared.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.message_rates import request_message
from mavlink_broker.microservices.mission_download import Downloaded, MissionDownload, NotDownloaded
from mavlink_broker.microservices.mission_protocol import ID_NAMES
from mavlink_broker.microservices.round_trip import RoundTrip

ID_ATTEMPTS: Final = 6

Comparison: TypeAlias = Callable[[Sequence[Message]], str | None]
"""Returns the first difference from the uploaded plan, or None."""


@dataclass(frozen=True, slots=True)
class Verified:
    """The vehicle holds exactly the uploaded plan."""


@dataclass(frozen=True, slots=True)
class Different:
    """The vehicle holds another plan."""

    reason: str


class ReadBackFailed(Different):
    """The plan could not be read back; the link may be lost."""


VerifyOutcome: TypeAlias = Verified | Different


class MissionVerify:
    """One verification; `opaque_id` is that of the acknowledgement, 0 without one."""

    def __init__(
        self,
        opaque_id: int,
        difference: Comparison,
        route: Route,
        round_trip: RoundTrip,
        *,
        mission_type: int = mavlink.MAV_MISSION_TYPE_MISSION,
        as_floats: bool = False,
    ) -> None:
        self._type = mission_type
        self._as_floats = as_floats
        self._opaque_id = opaque_id
        self._difference = difference
        self._route = route
        self._round_trip = round_trip
        self._attempts = 0
        self._deadline = 0.0
        self._download: MissionDownload | None = None
        self.outcome: VerifyOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Request the id, or the items if there is no id."""
        return self._request_id(now) if self._opaque_id else self._read_back(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the mission protocol."""
        if self.outcome is not None:
            return []
        if self._download is not None:
            return [*self._download.receive(message, now), *self._compare()]
        is_current = message.get_type() == "MISSION_CURRENT"
        if is_current and getattr(message, ID_NAMES[self._type]) == self._opaque_id:
            self.outcome = Verified()
        return []

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue; without the right id the plan is read back."""
        if self.outcome is not None:
            return []
        if self._download is not None:
            return [*self._download.tick(now), *self._compare()]
        if now < self._deadline:
            return []
        return self._request_id(now) if self._attempts < ID_ATTEMPTS else self._read_back(now)

    def _request_id(self, now: float) -> list[Message]:
        self._attempts += 1
        self._deadline = now + self._round_trip.timeout_s
        return [request_message(self._route, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)]

    def _read_back(self, now: float) -> list[Message]:
        self._download = MissionDownload(
            self._route, self._round_trip, mission_type=self._type, as_floats=self._as_floats
        )
        return self._download.start(now)

    def _compare(self) -> list[Message]:
        match self._download.outcome if self._download else None:
            case Downloaded(items):
                difference = self._difference(items)
                self.outcome = Different(difference) if difference else Verified()
            case NotDownloaded(reason):
                self.outcome = ReadBackFailed(reason)
            case _:
                pass
        return []
