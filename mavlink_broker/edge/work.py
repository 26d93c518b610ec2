"""Work as the edge server hands it out."""

import re
from dataclasses import dataclass
from typing import Final, TypeAlias

from afarcloud.plan import Event, Geofence, Mission, RallyPoint
from afarcloud.state import MissionReport
from mavlink_broker.planning.situation import Spot

_ULID: Final = re.compile(r"[0-7][0-9A-HJKMNP-TV-Z]{25}")


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionWork:
    """A mission to fly; `report` is the last one that the edge server holds of it."""

    work_id: int
    plan_id: str
    vehicle_id: int
    mission: Mission
    geofence: Geofence | None = None  # Of its plan
    rally_points: tuple[RallyPoint, ...] = ()  # Of its plan
    was_accepted: bool = False  # By an earlier run of the broker
    report: MissionReport | None = None
    reported_at: float | None = None  # [s] When that was told, on the broker's clock
    expires_at: float | None = None  # [s] On the broker's clock

    @property
    def key(self) -> tuple[int, str, int]:
        """What tells it from every other; the number alone restarts with a fresh edge server."""
        return self.work_id, self.plan_id, self.mission.mission_id

    @property
    def plan_ulid(self) -> str | None:
        """The plan's id, where it has the form that a report may carry."""
        return self.plan_id if _ULID.fullmatch(self.plan_id) else None

    @property
    def rally_spots(self) -> tuple[Spot, ...]:
        """Where it may return to besides home."""
        return tuple(Spot(p.latitude, p.longitude, p.altitude) for p in self.rally_points)

    @property
    def name(self) -> str:
        """The same as text, without the mission's number."""
        return f"{self.work_id}/{self.plan_id}"


@dataclass(frozen=True, slots=True, kw_only=True)
class StateVectorWork:
    """A wish for a fresh state vector of one vehicle, or of all."""

    work_id: int
    vehicle_id: int | None
    expires_at: float | None = None  # [s] On the broker's clock


@dataclass(frozen=True, slots=True, kw_only=True)
class EventWork:
    """An interruption of what a vehicle flies; it may come again until it has been answered."""

    work_id: int
    event: Event
    was_accepted: bool = False  # By an earlier run of the broker, which did not see it through
    expires_at: float | None = None  # [s] On the broker's clock

    @property
    def vehicle_id(self) -> int:
        """Whom it is for."""
        return self.event.vehicle_id


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the edge server answers to a mission that we have accepted.

    One that does not hold was cancelled, has expired or has ended: it must not be flown.
    """

    work_id: int
    holds: bool
    reason: str = ""  # Why it must not be flown, in the edge server's words


Work: TypeAlias = MissionWork | StateVectorWork | EventWork
