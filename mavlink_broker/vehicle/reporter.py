"""Writes one vehicle's reports: numbers them and marks whose session they belong to."""

from collections import Counter
from typing import TypeVar

from afarcloud.state import Alarm, Image, Report, StateVector
from mavlink_broker import effects
from mavlink_broker.effects import ConvertedPicture
from mavlink_broker.vehicle import telemetry
from mavlink_broker.vehicle.alarms import Failure
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.vehicle import Vehicle

ReportType = TypeVar("ReportType", bound=Report)


class Reporter:
    """Numbers run from 0 per kind; they begin again with the broker, as `session_id` shows."""

    def __init__(self, vehicle: Vehicle, session_id: str) -> None:
        self._vehicle = vehicle
        self._numbers: Counter[str] = Counter()
        self.session_id = session_id

    def results(self, of: str, now: float) -> list[effects.EdgeReport]:
        """What is posted for a finished command: pose, observations, battery, where known.

        They show this moment, at which the command has ended; `of` is its name. Its
        pictures follow when they have been fetched.
        """
        snapshot = self._vehicle.snapshot
        reports: list[tuple[str, effects.Report]] = []
        pose = telemetry.pose(snapshot, **self._next("pose"))
        if pose is not None:
            reports.append((of, self._signed(pose, "pose")))
        lists = self._vehicle.observations.lists(snapshot, now, **self._next("observation"))
        for number, measured in enumerate(lists, start=1):
            reports.append((f"{of}/{number}", self._signed(measured, "observation")))
        battery = telemetry.battery(snapshot, **self._next("battery"))
        if battery is not None:
            reports.append((of, self._signed(battery, "battery")))
        return [effects.Result(report, name) for name, report in reports]

    def landing(self, of: str) -> list[effects.EdgeReport]:
        """Where the vehicle has landed after a mission that was aborted or has failed."""
        pose = telemetry.pose(self._vehicle.snapshot, **self._next("pose"))
        return [] if pose is None else [effects.Result(self._signed(pose, "pose"), of)]

    def observations(self, now: float) -> list[effects.Report]:
        """The newest measurements, during a mission."""
        snapshot = self._vehicle.snapshot
        lists = self._vehicle.observations.lists(snapshot, now, **self._next("observation"))
        return [self._signed(measured, "observation") for measured in lists]

    def image(self, picture: ConvertedPicture, name: str, of: str) -> effects.EdgeReport:
        """Give a picture; `of` identifies it among all pictures, its name is for people."""
        image = Image.model_construct(  # The encoder guarantees format and frame
            vehicle_id=self._vehicle.vehicle_id,
            sequence_number=self._numbers["image"],
            format=picture.format,
            image_size=picture.size_bytes,
            name=f"{name}.{picture.format.value}",
            frame=picture.frame,
        )
        return effects.Result(self._signed(image, "image"), of)

    def state_vector(self) -> StateVector | None:
        """State of the vehicle now; None while it is unknown."""
        vector = telemetry.state_vector(self._vehicle.snapshot, **self._next("state_vector"))
        return None if vector is None else self._signed(vector, "state_vector")

    def mission(self, ledger: MissionLedger) -> effects.Report:
        """How far a mission is."""
        return self._signed(ledger.report(**self._next("mission_report")), "mission_report")

    def alarm(
        self,
        failure: Failure,
        mission_id: int | None,
        parameters: tuple[float, float] = (0.0, 0.0),
    ) -> effects.Report:
        """Something that has failed, and the mission that it ends."""
        alarm = Alarm(
            **self._next("alarm"),
            alarm_type_id=failure.type,
            alarm_code_id=failure.code,
            param_array=parameters,
            mission_id=mission_id,
            message=failure.text,
        )
        return self._signed(alarm, "alarm")

    def _next(self, kind: str) -> dict[str, int]:
        return {"vehicle_id": self._vehicle.vehicle_id, "sequence_number": self._numbers[kind]}

    def _signed(self, report: ReportType, kind: str) -> ReportType:
        self._numbers[kind] += 1
        return report.model_copy(update={"session_id": self.session_id})
