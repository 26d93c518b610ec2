"""Replaces the edge server for one plan: reads it, assigns its missions, receives the reports.

The plan is what the user names: a file, or `-` for the standard input. Every form that the edge
server accepts is accepted: envelopes, bare missions, imported spellings. The rules of a whole plan
are checked too, with the limits of an unregistered vehicle.
"""

import base64
import logging
import sys
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from afarcloud import rules, wire
from afarcloud.annex import in_seconds
from afarcloud.enumerations import EventType, Profile, Status
from afarcloud.faults import DocumentError, Fault
from afarcloud.flyable import VehicleLimits
from afarcloud.numbers import format_time
from afarcloud.plan import Geofence, Mission, Plan, RallyPoint
from mavlink_broker.cli.program import FAILED, UsageError
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.wire import AcceptanceResult

STANDARD_INPUT: Final = "-"
_IMAGE: Final = wire.Kind.IMAGE.value
_REPORT: Final = wire.Kind.MISSION_REPORT.value
_VEHICLES: Final = "vehicles"
_LOG = logging.getLogger(__name__)
_INVALID_NAMES: Final = frozenset({"", ".", ".."})


def read_plan(path: str, now: datetime) -> tuple[Plan, tuple[str, ...]]:
    """Give the plan and the warnings of the rules.

    Raises:
        UsageError: if it cannot be read, or may not be flown.
    """
    try:
        plan = wire.read_plan(_bytes(path))
    except DocumentError as error:
        raise UsageError(_sentences(path, error.faults), FAILED) from error
    limits = {mission.vehicle_id: VehicleLimits() for mission in plan.missions}
    result = rules.check(plan, limits, now)
    if result.faults:
        raise UsageError(_sentences(path, result.faults), FAILED)
    return plan, tuple(f"{warning.path}: {warning.message}" for warning in result.warnings)


def select_missions(
    plan: Plan, mission_id: int | None, vehicle_id: int | None
) -> tuple[Mission, ...]:
    """Give the selected missions, or all; times in seconds.

    Raises:
        UsageError: if the plan has no such mission.
    """
    missions = tuple(
        mission
        for mission in plan.missions
        if mission_id in {None, mission.mission_id} and vehicle_id in {None, mission.vehicle_id}
    )
    if not missions:
        there = ", ".join(f"{m.mission_id} (vehicle {m.vehicle_id})" for m in plan.missions)
        raise UsageError(f"the plan has no such mission, only {there}")
    is_annex = plan.profile is Profile.ANNEX
    return tuple(in_seconds(mission) for mission in missions) if is_annex else missions


def _bytes(path: str) -> bytes:
    if path == STANDARD_INPUT:
        return sys.stdin.buffer.read()
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error


def _sentences(path: str, faults: Sequence[Fault]) -> str:
    lines = (f"{fault.path or 'document'}: {fault.message}" for fault in faults)
    return "\n".join((f"{path} cannot be flown:", *(f"  {line}" for line in lines)))


class LocalEdge:
    """Work and reports in memory; `on_report` receives every report: its kind and body.

    A mission is over with its terminal report, or when its work was refused.
    """

    def __init__(
        self,
        missions: Sequence[Mission],
        on_report: Callable[[str, dict[str, Any]], None],
        *,
        expires_at: datetime | None = None,
        geofence: Geofence | None = None,
        rally_points: Sequence[RallyPoint] = (),
        folder: Path | None = None,
    ) -> None:
        self._on_report = on_report
        self._folder = folder
        self._expires_at = None if expires_at is None else format_time(expires_at)
        self._rally_points = [wire.write(point) for point in rally_points]
        self._geofence = None if geofence is None else wire.write(geofence)
        self._missions = dict(enumerate(missions, 1))
        self._new: list[dict[str, Any]] = []
        self._accepted: list[int] = []
        self._next_id = len(self._missions) + 1
        self.statuses = {mission.mission_id: Status.NOT_STARTED for mission in missions}

    @property
    def is_over(self) -> bool:
        """Whether every mission has ended."""
        return all(status.is_terminal for status in self.statuses.values())

    @property
    def all_finished(self) -> bool:
        """Whether every mission was flown to its end."""
        return all(status is Status.FINISHED for status in self.statuses.values())

    def dispatch(self) -> None:
        """Assign the missions."""
        for number, mission in self._missions.items():
            self._new.append(
                {
                    "id": number,
                    "kind": "mission",
                    "vehicle_id": mission.vehicle_id,
                    "plan_id": "local",
                    "expires_at": self._expires_at,
                    "geofence": self._geofence,
                    "rally_points": self._rally_points,
                    "mission": wire.write(mission),
                }
            )

    def abort(self, kind: EventType) -> None:
        """Interrupt every mission that has not ended."""
        for mission in self._missions.values():
            if not self.statuses[mission.mission_id].is_terminal:
                event = {"vehicle_id": mission.vehicle_id, "event_type_id": int(kind)}
                self._new.append({"id": self._next_id, "kind": "event", "event": event})
                self._next_id += 1

    def take_work(self) -> list[dict[str, Any]]:
        """Give new work."""
        work, self._new = self._new, []
        return work

    def take_acceptance_results(self) -> list[AcceptanceResult]:
        """Confirm every mission that was accepted."""
        accepted, self._accepted = self._accepted, []
        return [AcceptanceResult(number, is_confirmed=True) for number in accepted]

    @property
    def waiting_pictures(self) -> int:
        """Always 0: pictures are stored at once."""
        return 0

    def update_interval_of(self, vehicle_id: int) -> float | None:
        """Always None: nobody watches."""
        del vehicle_id
        return None

    def dead_letters_of(self, vehicle_id: int) -> int:
        """Always 0: every post is accepted."""
        del vehicle_id
        return 0

    def post(self, post: Post) -> None:
        """Receive a post of a vehicle's session."""
        first, *more = post.path.strip("/").split("/")
        if first == "broker":
            self._acknowledged(int(more[1]), post.body)
            return
        if first == _VEHICLES:
            self._on_report("vehicle", {"vehicle_id": int(more[0])} | post.body)
            return
        if first == _IMAGE:
            self._save(post.body)
        if first == _REPORT:
            self._reported(post.body)
        self._on_report(first, post.body)

    def _acknowledged(self, work_id: int, body: dict[str, Any]) -> None:
        mission = self._missions.get(work_id)
        if body["status"] == "accepted":
            self._accepted.append(work_id)
        if mission is not None and body["status"] == "refused":
            self._end(mission.mission_id, Status.FAILED)

    def _reported(self, report: dict[str, Any]) -> None:
        self._end(report["mission_id"], Status(report["mission_status_id"]))

    def _end(self, mission_id: int, status: Status) -> None:
        if mission_id in self.statuses and not self.statuses[mission_id].is_terminal:
            self.statuses[mission_id] = status

    def _save(self, image: dict[str, Any]) -> None:
        """Store a picture under its own name, which the vocabulary has validated."""
        if self._folder is None:
            return
        name = image["name"]
        if name in _INVALID_NAMES:
            name = f"{image['sequence_number']}.{image['format']}"
        folder = self._folder / f"vehicle-{image['vehicle_id']}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(base64.b64decode(image["frame"], validate=True))
        except OSError as error:
            _LOG.warning("%s is not stored: %s", folder / name, error.strerror)
