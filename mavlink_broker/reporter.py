"""Writes one vehicle's reports: numbers them and marks whose session they belong to."""

from collections import Counter
from typing import TypeVar

from afarcloud.state import Alarm, Report, StateVector
from mavlink_broker import effects
from mavlink_broker.translation import telemetry
from mavlink_broker.translation.alarms import Failure
from mavlink_broker.translation.ledger import Ledger
from mavlink_broker.vehicle import Vehicle

ReportType = TypeVar("ReportType", bound=Report)


class Reporter:
    """Numbers run from 0 per kind; they begin again with the broker, as `session_id` shows."""

    def __init__(self, vehicle: Vehicle, session_id: str) -> None:
        self._vehicle = vehicle
        self._numbers: Counter[str] = Counter()
        self.session_id = session_id

    def results(self) -> list[effects.Report]:
        """What is posted for every finished command: pose, then battery, where known."""
        pose = telemetry.pose(self._vehicle.snapshot, **self._next("pose"))
        battery = telemetry.battery(self._vehicle.snapshot, **self._next("battery"))
        reports: list[effects.Report] = []
        if pose is not None:
            reports.append(self._signed(pose, "pose"))
        if battery is not None:
            reports.append(self._signed(battery, "battery"))
        return reports

    def state_vector(self) -> StateVector | None:
        """State of the vehicle now; None while it is unknown."""
        vector = telemetry.state_vector(self._vehicle.snapshot, **self._next("state_vector"))
        return None if vector is None else self._signed(vector, "state_vector")

    def mission(self, ledger: Ledger) -> effects.Report:
        """How far a mission is."""
        return self._signed(ledger.report(**self._next("mission_report")), "mission_report")

    def alarm(self, failure: Failure, mission_id: int | None) -> effects.Report:
        """Something that has failed, and the mission that it ends."""
        alarm = Alarm(
            **self._next("alarm"),
            alarm_type_id=failure.type,
            alarm_code_id=failure.code,
            mission_id=mission_id,
            message=failure.text,
        )
        return self._signed(alarm, "alarm")

    def _next(self, kind: str) -> dict[str, int]:
        return {"vehicle_id": self._vehicle.vehicle_id, "sequence_number": self._numbers[kind]}

    def _signed(self, report: ReportType, kind: str) -> ReportType:
        self._numbers[kind] += 1
        return report.model_copy(update={"session_id": self.session_id})
