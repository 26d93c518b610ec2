"""What a vehicle reports of its own health, as AFarCloud's alarms.

Every alarm has one or more signals, each of one message. A signal has failed when it was healthy
and has been unhealthy for two seconds. An alarm is raised once, and again only after all of its
signals were healthy in between. It is not raised while a cause of it is unhealthy: then that alarm
is raised.

What was healthy in a flight is noted (`healthy`): a part that fails while the link is away, or
while the broker is restarted, has failed all the same, though the vehicle has landed by then.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from afarcloud.enumerations import AlarmCode, AlarmType
from afarcloud.state import MESSAGE_LENGTH
from mavlink_broker.autopilots.status_texts import TextMeaning, means
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.microservices.link_state import MIN_MESSAGES, FrameLoss, PeriodicSource
from mavlink_broker.vehicle.measurements import HUMIDITY, OBSERVED, alarm_parameters, readings

DEBOUNCE_S: Final = 2.0
CHECK_EVERY_S: Final = 0.1
SOURCES_KEPT: Final = 16
PARAMETERS_HOLD_S: Final = 30.0
"""As long as the slowest alarm takes to be raised."""


class Failure(NamedTuple):
    """One of AFarCloud's alarms."""

    code: AlarmCode
    text: str

    @property
    def type(self) -> AlarmType:
        """Codes from 50 on are functions."""
        if self.code >= AlarmCode.FUNCTION_LOCALISATION:
            return AlarmType.FUNCTION_UNAVAILABLE
        return AlarmType.EQUIPMENT_FAILURE


SONAR: Final = Failure(AlarmCode.EQUIPMENT_SONAR, "range finder failed")
PROPELLERS: Final = Failure(AlarmCode.EQUIPMENT_PROPELLERS, "motor failed")
IMU: Final = Failure(AlarmCode.EQUIPMENT_IMU, "inertial sensors failed")
CAMERA: Final = Failure(AlarmCode.EQUIPMENT_CAMERA, "the camera is silent")
GPS: Final = Failure(AlarmCode.EQUIPMENT_GPS, "GPS lost")
HUMIDITY_SENSOR: Final = Failure(
    AlarmCode.EQUIPMENT_HUMIDITY_SENSOR, "the humidity sensor is silent"
)
LOCALISATION: Final = Failure(
    AlarmCode.FUNCTION_LOCALISATION, "the vehicle does not know where it is"
)
PROPULSION: Final = Failure(AlarmCode.FUNCTION_PROPULSION, "propulsion failed")
BATTERY: Final = Failure(
    AlarmCode.FUNCTION_PROPULSION, "the battery cannot keep the vehicle in the air"
)
FENCE: Final = Failure(AlarmCode.FUNCTION_NAVIGATION, "geofence breached")
HUMIDITY_SENSING: Final = Failure(
    AlarmCode.FUNCTION_HUMIDITY_SENSING, "the humidity sensor measures nothing"
)

CAUSES: Final[Mapping[AlarmCode, frozenset[AlarmCode]]] = {
    AlarmCode.FUNCTION_LOCALISATION: frozenset({AlarmCode.EQUIPMENT_GPS, AlarmCode.EQUIPMENT_IMU}),
    AlarmCode.FUNCTION_PROPULSION: frozenset({AlarmCode.EQUIPMENT_PROPELLERS}),
    AlarmCode.FUNCTION_HUMIDITY_SENSING: frozenset({AlarmCode.EQUIPMENT_HUMIDITY_SENSOR}),
}
"""Functions that fail with a part of the vehicle."""


def is_navigation_failure(texts: str) -> bool:
    """Whether a failsafe acts because the wind is too strong for the mission.

    No other message gives the reason of a failsafe; a low battery and a lost link have no code.
    """
    return means(texts, TextMeaning.WIND_TOO_STRONG)


def mission_error(reason: str) -> Failure:
    """The alarm of a vehicle that cannot continue its mission."""
    return Failure(AlarmCode.FUNCTION_NAVIGATION, f"mission error: {reason}"[:MESSAGE_LENGTH])


class _Signal(NamedTuple):
    source: str
    failure: Failure
    is_unhealthy: bool


_SENSORS: Final = (
    (
        mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION | mavlink.MAV_SYS_STATUS_SENSOR_PROXIMITY,
        SONAR,
    ),
    (mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS, PROPELLERS),
    (mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL, IMU),
    (mavlink.MAV_SYS_STATUS_SENSOR_GPS, GPS),
    (mavlink.MAV_SYS_STATUS_AHRS, LOCALISATION),
    (mavlink.MAV_SYS_STATUS_SENSOR_PROPULSION, PROPULSION),
    (mavlink.MAV_SYS_STATUS_GEOFENCE, FENCE),
)
"""MAV_SYS_STATUS_SENSOR, any of them, and what their failure means."""


def unhealthy_parts(bits: int) -> str:
    """Name what MAV_SYS_STATUS_SENSOR bits show unhealthy, without what has failed with a part."""
    failures = [failure for mask, failure in _SENSORS if bits & mask]
    codes = {failure.code for failure in failures}
    own = (one for one in failures if not codes & CAUSES.get(one.code, frozenset()))
    return "; ".join(f"unhealthy now: {failure.text}" for failure in own)


_NOTED: Final = frozenset(failure for _, failure in _SENSORS)
"""What the vehicle itself reports of its parts; a camera is noted by its heartbeats."""


def _name(source: str, failure: Failure) -> str:
    """Name of a signal in the journal."""
    return f"{source}: {failure.text}"


def _system_status(message: Message) -> Iterator[_Signal]:
    """SYS_STATUS(1): what is present and enabled is watched."""
    watched = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
    failed = watched & ~message.onboard_control_sensors_health
    for bits, failure in _SENSORS:
        if watched & bits:
            yield _Signal("SYS_STATUS", failure, bool(failed & bits))


def _estimator_status(message: Message) -> Iterator[_Signal]:
    """ESTIMATOR_STATUS(230) of PX4, EKF_STATUS_REPORT(193) of ArduPilot: the same low bits.

    ESTIMATOR_CONST_POS_MODE is no failure: PX4 sets it whenever the vehicle is at rest
    (`ekf_helper.cpp`), and both take POS_HORIZ_ABS away from a position that they only assume.
    """
    needed = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_POS_HORIZ_ABS
    is_unhealthy = message.flags & needed != needed
    yield _Signal(message.get_type(), LOCALISATION, is_unhealthy)


def _fence_status(message: Message) -> Iterator[_Signal]:
    yield _Signal("FENCE_STATUS", FENCE, message.breach_status != 0)


_POWERLESS: Final = frozenset(
    {
        mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY,
        mavlink.MAV_BATTERY_CHARGE_STATE_FAILED,
    }
)


def _battery_status(message: Message) -> Iterator[_Signal]:
    """BATTERY_STATUS(147): a low battery is no failure; one that ends the flight by force is."""
    yield _Signal(f"BATTERY_STATUS {message.id}", BATTERY, message.charge_state in _POWERLESS)


_READERS: Final[Mapping[str, Callable[[Message], Iterator[_Signal]]]] = {
    "SYS_STATUS": _system_status,
    "ESTIMATOR_STATUS": _estimator_status,
    "EKF_STATUS_REPORT": _estimator_status,
    "FENCE_STATUS": _fence_status,
    "BATTERY_STATUS": _battery_status,
}


LASTING: Final = frozenset({BATTERY})
"""An empty battery recovers for moments on the ground: it is raised once a flight."""


@dataclass(slots=True)
class _Health:
    failure: Failure
    was_healthy: bool = False
    unhealthy_since: float | None = None

    def take(self, now: float, *, is_unhealthy: bool) -> None:
        if not is_unhealthy:
            self.was_healthy, self.unhealthy_since = True, None
        elif self.unhealthy_since is None:
            self.unhealthy_since = now

    @property
    def is_unhealthy(self) -> bool:
        return self.was_healthy and self.unhealthy_since is not None

    def has_failed(self, now: float) -> bool:
        return self.is_unhealthy and now - (self.unhealthy_since or now) >= DEBOUNCE_S


@dataclass(slots=True)
class AlarmMonitor:
    """Watches one vehicle."""

    _signals: dict[tuple[str, AlarmCode], _Health] = field(default_factory=dict)
    _periodic_sources: dict[tuple[str, AlarmCode], PeriodicSource] = field(default_factory=dict)
    _raised: set[Failure] = field(default_factory=set)
    _expected: frozenset[str] = frozenset()  # Signals that were healthy before this monitor began
    _was_armed: bool = False
    _parameters: tuple[float, tuple[float, float]] | None = None  # And when they were received
    _loss: FrameLoss = field(default_factory=FrameLoss)
    _check_at: float = 0.0

    def receive(self, message: Message, now: float) -> None:
        """Handle a message of the autopilot."""
        self._loss.take(message)
        kind = message.get_type()
        if kind == "TUNNEL" and (parameters := alarm_parameters(message)) is not None:
            self._parameters = now, parameters
        if kind == "HEARTBEAT":
            is_armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            self._follow_arming(is_armed=is_armed)
        reader = _READERS.get(kind)
        for source, failure, is_unhealthy in reader(message) if reader is not None else ():
            self._take(source, failure, now, is_unhealthy=is_unhealthy)
        self.observe(message, now)

    def _follow_arming(self, *, is_armed: bool) -> None:
        """Raise lasting failures anew in the next flight."""
        if is_armed and not self._was_armed:
            self._raised -= LASTING
        self._was_armed = is_armed

    def observe(self, message: Message, now: float) -> None:
        """Handle a message of any component: a humidity sensor sends periodically."""
        if message.get_type() not in OBSERVED:
            return
        for reading in readings(message):
            if reading.quantity.observed_property == HUMIDITY:
                source = f"{source_of(message).component} {reading.sensor}"
                self._received(source, HUMIDITY_SENSOR, now)
                self._take(source, HUMIDITY_SENSING, now, is_unhealthy=reading.value is None)

    def camera_received(self, now: float) -> None:
        """Handle a heartbeat of the vehicle's camera."""
        self._received("camera", CAMERA, now)

    def expect_camera(self, now: float) -> None:
        """Expect heartbeats of a camera that was received before this monitor has begun."""
        camera = self._periodic_sources.setdefault(("camera", CAMERA.code), PeriodicSource(now))
        camera.count = max(camera.count, MIN_MESSAGES)

    @property
    def expects_camera(self) -> bool:
        """Whether so many heartbeats of a camera were received that its silence is an alarm."""
        camera = self._periodic_sources.get(("camera", CAMERA.code))
        return camera is not None and camera.count >= MIN_MESSAGES

    def expect_healthy(self, noted: Iterable[str]) -> None:
        """Take these signals as healthy before this monitor has received them."""
        self._expected = frozenset(noted)
        for (source, _), one in self._signals.items():
            one.was_healthy |= _name(source, one.failure) in self._expected

    @property
    def healthy(self) -> tuple[str, ...]:
        """Names of the signals whose failure is an alarm that was not raised; to be noted."""
        known = {
            _name(source, one.failure)
            for (source, _), one in self._signals.items()
            if one.was_healthy and one.failure in _NOTED
        }
        raised = {failure.text for failure in self._raised}
        names = known | self._expected
        return tuple(sorted(name for name in names if name.partition(": ")[2] not in raised))

    def tick(self, now: float, *, is_connected: bool) -> list[Failure]:
        """Give what has failed and was not raised yet; nothing while the link is away."""
        if now < self._check_at:
            return []
        self._check_at = now + CHECK_EVERY_S
        for (source, _), periodic in self._periodic_sources.items():
            failure = CAMERA if source == "camera" else HUMIDITY_SENSOR
            is_silent = periodic.is_silent(now, self._loss.ratio)
            if not is_connected and not is_silent:
                periodic.restart_timer(now)
            silent_since = now - DEBOUNCE_S  # The timeout of the source is the debounce
            self._take(source, failure, silent_since, is_unhealthy=is_silent)
        return [failure for failure in self._failed(now) if self._is_new(failure)]

    def take_parameters(self, now: float) -> tuple[float, float]:
        """Give the parameters that the vehicle has sent with its newest alarm, once."""
        received, self._parameters = self._parameters, None
        if received is None or now - received[0] > PARAMETERS_HOLD_S:
            return 0.0, 0.0
        return received[1]

    def forget(self) -> None:
        """Begin anew: the vehicle was restarted, or its link was lost."""
        self._parameters = None
        self._signals.clear()
        self._periodic_sources.clear()
        self._raised.clear()
        self._expected = frozenset()

    def _take(self, source: str, failure: Failure, now: float, *, is_unhealthy: bool) -> None:
        key = source, failure.code
        if key in self._signals or len(self._signals) < len(_SENSORS) + SOURCES_KEPT:
            health = self._signals.setdefault(
                key, _Health(failure, was_healthy=_name(source, failure) in self._expected)
            )
            health.take(now, is_unhealthy=is_unhealthy)

    def _received(self, source: str, failure: Failure, now: float) -> None:
        periodic = self._periodic_sources.get((source, failure.code))
        if periodic is not None:
            periodic.received(now)
        elif len(self._periodic_sources) < SOURCES_KEPT:
            self._periodic_sources[source, failure.code] = PeriodicSource(now)

    def _failed(self, now: float) -> list[Failure]:
        """Everything that has failed, each once."""
        failed = {one.failure for one in self._signals.values() if one.has_failed(now)}
        unhealthy = {one.failure for one in self._signals.values() if one.is_unhealthy}
        self._raised &= unhealthy | LASTING
        codes = {failure.code for failure in unhealthy}
        return [
            failure
            for failure in sorted(failed)
            if not codes & CAUSES.get(failure.code, frozenset())
        ]

    def _is_new(self, failure: Failure) -> bool:
        is_new = failure not in self._raised
        self._raised.add(failure)
        return is_new
