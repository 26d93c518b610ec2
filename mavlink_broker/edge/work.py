"""Work that the edge server assigns: missions, events, requests for a state vector."""

import re
from dataclasses import dataclass
from typing import Final, TypeAlias

from afarcloud.plan import Event, Geofence, Mission, RallyPoint
from afarcloud.state import MissionReport
from mavlink_broker.planning.situation import Spot

_ULID: Final = re.compile(r"[0-7][0-9A-HJKMNP-TV-Z]{25}")


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionWork:
    """A mission to fly; `report` is the last one that the edge server has of it."""

    work_id: int
    plan_id: str
    vehicle_id: int
    mission: Mission
    geofence: Geofence | None = None  # Of its plan
    rally_points: tuple[RallyPoint, ...] = ()  # Of its plan
    was_accepted: bool = False  # By an earlier run of the broker
    report: MissionReport | None = None
    reported_at: float | None = None  # [s] Time of that report, on the broker's clock
    expires_at: float | None = None  # [s] On the broker's clock

    @property
    def key(self) -> tuple[int, str, int]:
        """Its identity; the number alone starts again with a new edge server."""
        return self.work_id, self.plan_id, self.mission.mission_id

    @property
    def plan_ulid(self) -> str | None:
        """The plan's id, if it is a ULID, as a report requires."""
        return self.plan_id if _ULID.fullmatch(self.plan_id) else None

    @property
    def rally_spots(self) -> tuple[Spot, ...]:
        """Positions that the vehicle may return to besides home."""
        return tuple(Spot(p.latitude, p.longitude, p.altitude) for p in self.rally_points)

    @property
    def name(self) -> str:
        """The identity as text, without the mission's number."""
        return f"{self.work_id}/{self.plan_id}"


@dataclass(frozen=True, slots=True, kw_only=True)
class StateVectorWork:
    """A request for a fresh state vector of one vehicle, or of all."""

    work_id: int
    vehicle_id: int | None
    expires_at: float | None = None  # [s] On the broker's clock


@dataclass(frozen=True, slots=True, kw_only=True)
class EventWork:
    """An event that interrupts a flight; it is assigned again until it has been answered."""

    work_id: int
    event: Event
    was_accepted: bool = False  # By an earlier run of the broker, which did not complete it
    expires_at: float | None = None  # [s] On the broker's clock

    @property
    def vehicle_id(self) -> int:
        """The vehicle that it concerns."""
        return self.event.vehicle_id


@dataclass(frozen=True, slots=True)
class AcceptanceResult:
    """The edge server's answer to a mission that the broker has accepted.

    A mission whose acceptance is not confirmed must not be flown: it was cancelled, has expired or
    has ended, or the acceptance has failed.
    """

    work_id: int
    is_confirmed: bool
    reason: str = ""  # Why it must not be flown, as the edge server states it
    has_failed: bool = False  # The edge server still waits for the mission: it must be reported


Work: TypeAlias = MissionWork | StateVectorWork | EventWork
