"""Reports of one vehicle: `Reporter` numbers them and marks whose session they belong to.

`TelemetryPublisher` publishes at all times: the registration and the state vectors of a vehicle.

The body of `PUT /vehicles/<vehicle_id>` shows how old its values are: the position has its age in
seconds, and `stale` names what the vehicle has not sent for some time, or everything while its link
is not connected. Old values stay in the body, because the last known position of a lost vehicle is
what one looks for.

A state vector waits for the next position. A vehicle sends its position a few times a second, and a
vector made between two of them would be as old as the last one. The capacity of the battery is a
parameter on most vehicles, not in BATTERY_STATUS.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from afarcloud.state import Alarm, Image, Report, StateVector
from mavlink_broker import effects
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.effects import ConvertedPicture, Effects, VehicleUpdate
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.parameter import ParameterRead
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

    def image(
        self, picture: ConvertedPicture, name: str, of: str, taken_at: float
    ) -> effects.EdgeReport:
        """Give a picture that was taken at a time of the broker's monotonic clock.

        `of` identifies it among all pictures, its name is for people.
        """
        image = Image.model_construct(  # The encoder guarantees format and frame
            vehicle_id=self._vehicle.vehicle_id,
            sequence_number=self._numbers["image"],
            format=picture.format,
            image_size=picture.size_bytes,
            name=f"{name}.{picture.format.value}",
            frame=picture.frame,
        )
        return effects.Result(self._signed(image, "image"), of, taken_at)

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


UPDATE_EVERY_S: Final = 2.0
"""Unless the edge server has requested another interval, because somebody watches."""
UPDATE_LOST_EVERY_S: Final = 30.0
"""Interval for a vehicle that is not connected."""
_NEEDED: Final = frozenset({"position", "attitude"})
"""A state vector needs both."""
STALE_AFTER_S: Final = 5.0
"""Several periods of every requested stream."""
_MESSAGES: Final = {
    "position": "GLOBAL_POSITION_INT",
    "attitude": "ATTITUDE",
    "battery": "BATTERY_STATUS",
}
POSITION_WITHIN_S: Final = 1.0
"""How long a vector waits for a new position; then it has an older one, unless that is stale."""
LARGEST_AH: Final = 100.0
"""A larger value, or 0, is not a capacity."""


@dataclass(slots=True)
class StateVectorSchedule:
    """A period of `every_s` [s]; each vector waits for the first position in its period."""

    every_s: float
    _due_at: float = 0.0

    def is_due(self, now: float, position_age_s: float | None) -> bool:
        """Whether to publish one now; none without any position (None)."""
        late_s = now - self._due_at
        if late_s < 0.0 or position_age_s is None:
            return False
        return position_age_s <= late_s or late_s >= POSITION_WITHIN_S

    def published(self, now: float) -> None:
        """Begin the next period, unless a request was answered before the present one.

        Periods that were missed are not made up for.
        """
        if now < self._due_at:
            return
        self._due_at += self.every_s
        if self._due_at <= now:
            self._due_at = now + self.every_s


class TelemetryPublisher:
    """Publishes the state of one vehicle periodically."""

    def __init__(
        self,
        vehicle: Vehicle,
        reporter: Reporter,
        *,
        state_vector_every_s: float,
        observations_every_s: float,
    ) -> None:
        """Set the periods; with 0 s for observations they come with finished commands only."""
        self._vehicle = vehicle
        self._reporter = reporter
        self._schedule = StateVectorSchedule(state_vector_every_s)
        self._observations_every_s = observations_every_s
        self._observed_at = 0.0
        self._updated_at: float | None = None
        self.update_every_s = UPDATE_EVERY_S
        """Interval of the updates of a vehicle that is reachable."""
        self._last_update: tuple[Any, ...] = ()

    def update(self, mission_id: int | None, now: float, effects: Effects) -> None:
        """Update the vehicle on the edge server: on a change, and periodically."""
        vehicle = self._vehicle
        change = (
            *(vehicle.link.state(now), vehicle.snapshot.armed, vehicle.mode, mission_id),
            *(vehicle.warning, stale(vehicle, now), activity(vehicle)),
        )
        every_s = self.update_every_s if vehicle.is_reachable(now) else UPDATE_LOST_EVERY_S
        due = self._updated_at is None or now - self._updated_at >= every_s
        if not due and change == self._last_update:
            return
        self._updated_at, self._last_update = now, change
        body = description(vehicle, mission_id, now)
        effects.for_edge.append(VehicleUpdate(vehicle.vehicle_id, body))

    def publish_state(self, now: float, effects: Effects) -> bool:
        """Publish a state vector at once; false when the state is not known."""
        vector = self._reporter.state_vector()
        if vector is None or not _NEEDED.isdisjoint(stale(self._vehicle, now)):
            return False
        effects.for_edge.append(vector)
        self._schedule.published(now)
        return True

    def tick(self, now: float, effects: Effects) -> None:
        """Publish what is due of a connected vehicle."""
        if not self._vehicle.is_connected(now):
            return
        if self._schedule.is_due(now, self._vehicle.age_s("GLOBAL_POSITION_INT", now)):
            self.publish_state(now, effects)
        every_s = self._observations_every_s
        due = every_s > 0 and now - self._observed_at >= every_s
        if due and self._vehicle.snapshot.armed:
            self._observed_at = now
            effects.for_edge += self._reporter.observations(now)


def description(vehicle: Vehicle, mission_id: int | None, now: float) -> dict[str, Any]:
    """Describe the vehicle, and how fresh each value is."""
    snapshot = vehicle.snapshot
    body: dict[str, Any] = {
        "link_state": vehicle.link.state(now).value,
        "autopilot": vehicle.family.autopilot,
        "family": vehicle.family.name,
        "version": vehicle.version,
        "mission_id": mission_id,
        "stale": stale(vehicle, now),
        "warning": vehicle.warning,
    }
    if snapshot.armed is not None:
        body |= {"armed": snapshot.armed, "mode": vehicle.mode, "activity": activity(vehicle)}
    if snapshot.position is not None:
        age_s = vehicle.age_s("GLOBAL_POSITION_INT", now)
        body |= {
            "latitude": snapshot.position.latitude_deg,
            "longitude": snapshot.position.longitude_deg,
            "altitude": snapshot.position.altitude_m,
            "position_age": None if age_s is None else round(max(0.0, age_s), 1),
            "speed": round(snapshot.position.speed_m_s, 2),
        }
    if snapshot.attitude is not None:
        body["heading"] = round(snapshot.attitude.yaw_deg, 1) % 360.0
    if snapshot.gps is not None:
        body |= {"gps_fix": snapshot.gps.fix, "satellites": snapshot.gps.satellites}
    if snapshot.battery_fraction is not None:
        body["battery_percentage"] = snapshot.battery_fraction
        body["battery_time_remaining"] = snapshot.battery_time_s
    return body


_ACTIVITIES: Final[Mapping[ModeRole, str]] = {
    ModeRole.MISSION: "mission",
    ModeRole.HOLD: "hold",
    ModeRole.PAUSED: "hold",
    ModeRole.GUIDED: "guided",
    ModeRole.ENDING: "return_or_land",
    ModeRole.OTHER: "manual",
}


def activity(vehicle: Vehicle) -> str | None:
    """Name what the vehicle does in the edge server's terms; None: its modes are not known.

    A vehicle that was ordered to hold and flies its mission on has not obeyed yet.
    """
    if not vehicle.snapshot.armed:
        return "on_ground"
    flies_on = vehicle.mode_role is ModeRole.MISSION  # ArduPilot, with a low battery by default
    obeys = not flies_on or vehicle.mode == vehicle.family.paused_mode
    if vehicle.recovery.paused is not None and obeys:
        return "paused"
    if not vehicle.family.knows_modes:
        return None
    is_failsafe = vehicle.in_failsafe and not flies_on
    return "failsafe" if is_failsafe else _ACTIVITIES[vehicle.mode_role]


def stale(vehicle: Vehicle, now: float) -> list[str]:
    """Name what was received once and not again for some time.

    A battery that the vehicle reports without a value is stale at once: the edge server still
    shows the value before, also one from before a restart of the broker.
    """
    is_connected = vehicle.is_connected(now)
    unknown = {"battery"} if vehicle.snapshot.battery_fraction is None else set()
    ages = {name: vehicle.age_s(kind, now) for name, kind in _MESSAGES.items()}
    return [
        name
        for name, age_s in ages.items()
        if age_s is not None and (age_s > STALE_AFTER_S or not is_connected or name in unknown)
    ]


class BatteryCapacity:
    """Reads the parameter once; until it arrives, the configured capacity counts."""

    def __init__(self, vehicle: Vehicle, configured_ah: float) -> None:
        self._vehicle = vehicle
        self._configured_ah = configured_ah
        self._read: ParameterRead | None = None

    def receive(self, message: Message) -> None:
        """Handle a message that may be the answer."""
        if self._read is not None:
            self._read.receive(message)

    def tick(self, now: float) -> list[Message]:
        """Read as soon as the parameter's name is known; write the value into the snapshot."""
        vehicle, snapshot = self._vehicle, self._vehicle.snapshot
        if snapshot.battery_capacity_ah is None:
            snapshot.battery_capacity_ah = self._configured_ah
        name = vehicle.family.battery_capacity_parameter
        if self._read is None and name is not None:
            self._read = ParameterRead(
                name, vehicle.route, vehicle.round_trip, encoding=vehicle.parameter_encoding
            )
        if self._read is None:
            return []
        messages = self._read.tick(now)
        capacity_ah = (self._read.value or 0.0) / 1e3
        if 0.0 < capacity_ah <= LARGEST_AH:
            snapshot.battery_capacity_ah = capacity_ah
        return messages
