"""Reads the work that the edge server hands out, once each.

The edge server may give the same work again: after a restart on either side everything
unfinished is asked for anew.

WorkError  a piece of work that cannot be read, with its number where it has one
"""

from collections import OrderedDict
from collections.abc import Mapping
from datetime import datetime
from typing import Any, Final, Literal

from pydantic import AwareDatetime, BaseModel, StrictInt, ValidationError

from afarcloud.plan import Event, Geofence, Mission, RallyPoint
from afarcloud.state import MissionReport
from mavlink_broker.edge.work import EventWork, MissionWork, StateVectorWork, Work

REMEMBERED: Final = 10_000


class WorkError(Exception):
    """Work that cannot be read."""

    def __init__(self, work_id: int | None, reason: str) -> None:
        super().__init__(reason)
        self.work_id = work_id


class _RawWork(BaseModel):
    """What every piece of work has; a field that we do not know is the edge server's affair."""

    id: StrictInt
    expires_at: AwareDatetime | None = None

    def deadline(self, now: float, utc: datetime) -> float | None:
        """Give the expiry on the program's clock."""
        if self.expires_at is None:
            return None
        return now + (self.expires_at - utc).total_seconds()


class _RawMission(_RawWork):
    plan_id: str | None = None
    state: Literal["queued", "accepted"] = "queued"
    mission: Mission
    geofence: Geofence | None = None
    rally_points: tuple[RallyPoint, ...] = ()
    report: dict[str, Any] | None = None


class _RawStateVector(_RawWork):
    vehicle_id: StrictInt | None = None
    sequence_number: StrictInt | None = None


class _RawEvent(_RawWork):
    state: Literal["queued", "accepted"] = "queued"
    event: Event


class Inbox:
    """Remembers what was taken."""

    def __init__(self) -> None:
        self._taken: OrderedDict[tuple[Any, ...], None] = OrderedDict()

    def read(self, raw: Mapping[str, Any], now: float, utc: datetime) -> Work | None:
        """Turn raw work into its type; None when it was taken before.

        Raises:
            WorkError: if it cannot be read.
        """
        number = raw.get("id")
        work_id = number if isinstance(number, int) and not isinstance(number, bool) else None
        try:
            work, key = _read(raw, now, utc)
        except ValidationError as error:
            first = error.errors()[0]
            path = ".".join(str(step) for step in first["loc"])
            raise WorkError(work_id, f"work cannot be read: {path}: {first['msg']}") from error
        if work is None:
            raise WorkError(work_id, f"work of kind {raw.get('kind')} is not done here")
        return work if self._is_new(key) else None

    def _is_new(self, key: tuple[Any, ...]) -> bool:
        if key in self._taken:
            return False
        self._taken[key] = None
        if len(self._taken) > REMEMBERED:
            self._taken.popitem(last=False)
        return True


def _read(raw: Mapping[str, Any], now: float, utc: datetime) -> tuple[Work | None, tuple[Any, ...]]:
    """Give the work and what tells it from every other."""
    match raw.get("kind"):
        case "mission":
            mission = _mission(_RawMission.model_validate(raw), now, utc)
            return mission, mission.key
        case "latest_state_vector":
            wish = _RawStateVector.model_validate(raw)
            work = StateVectorWork(
                work_id=wish.id,
                vehicle_id=wish.vehicle_id,
                expires_at=wish.deadline(now, utc),
            )
            return work, (wish.id, "latest_state_vector", wish.sequence_number)
        case "event":
            event = _RawEvent.model_validate(raw)
            order = EventWork(
                work_id=event.id,
                event=event.event,
                was_accepted=event.state == "accepted",
                expires_at=event.deadline(now, utc),
            )
            return order, (event.id, "event", repr(event.event))
        case _:
            return None, ()


def _mission(raw: _RawMission, now: float, utc: datetime) -> MissionWork:
    report = None if raw.report is None else _report(raw.report)
    told_at = None if report is None else report.recorded_at
    return MissionWork(
        work_id=raw.id,
        plan_id=str(raw.plan_id),
        vehicle_id=raw.mission.vehicle_id,
        mission=raw.mission,
        geofence=raw.geofence,
        rally_points=raw.rally_points,
        was_accepted=raw.state == "accepted",
        report=report,
        reported_at=None if told_at is None else now + (told_at - utc).total_seconds(),
        expires_at=raw.deadline(now, utc),
    )


def _report(raw: Mapping[str, Any]) -> MissionReport:
    """Read the last report; what the edge server added to it is its own affair."""
    known = {name: value for name, value in raw.items() if name in MissionReport.model_fields}
    return MissionReport.model_validate(known)
