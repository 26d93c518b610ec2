"""What a vehicle says of its own health, as AFarCloud's alarms.

Every alarm has one or more signs, each told by one message. A sign has failed when it was well
and has been ill for two seconds. An alarm is told once, and again only after all of its signs
were well in between; not while a cause of it is ill, for that is the alarm to tell.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from afarcloud.enumerations import AlarmCode, AlarmType
from mavlink_broker.autopilots.status_texts import alarm_parameters
from mavlink_broker.mavlink.dialect import Message, mavlink, source_of
from mavlink_broker.microservices.silence import LinkLoss, Voice
from mavlink_broker.vehicle.measurements import HUMIDITY, OBSERVED, readings

DEBOUNCE_S: Final = 2.0
JUDGE_EVERY_S: Final = 0.1
SOURCES_KEPT: Final = 16
PARAMETERS_HOLD_S: Final = 30.0
"""As long as the slowest alarm takes to be believed."""


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


_WIND_BEYOND_LIMIT: Final = re.compile(r"wind[^;]*\b(too strong|limit)", re.IGNORECASE)
"""Own vehicle: "Wind too strong: RETURN"; PX4 1.14: "Wind speed is above limit"."""


def is_navigation_failure(texts: str) -> bool:
    """Whether a failsafe says that it flies because the air does not let the mission be flown.

    No other message says why a failsafe acts; a low battery and a lost link have no code.
    """
    return _WIND_BEYOND_LIMIT.search(texts) is not None


def mission_error(reason: str) -> Failure:
    """What a vehicle that cannot go on with its mission is told as."""
    return Failure(AlarmCode.FUNCTION_NAVIGATION, f"mission error: {reason}"[:1000])


class _Sign(NamedTuple):
    source: str
    failure: Failure
    is_ill: bool


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


def _system_status(message: Message) -> Iterator[_Sign]:
    """SYS_STATUS(1): what is present and enabled is watched."""
    watched = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
    failed = watched & ~message.onboard_control_sensors_health
    for bits, failure in _SENSORS:
        if watched & bits:
            yield _Sign("SYS_STATUS", failure, bool(failed & bits))


def _estimator_status(message: Message) -> Iterator[_Sign]:
    """ESTIMATOR_STATUS(230) of PX4, EKF_STATUS_REPORT(193) of ArduPilot: the same low bits.

    ESTIMATOR_CONST_POS_MODE is no failure: PX4 sets it whenever the vehicle is at rest
    (`ekf_helper.cpp`), and both take POS_HORIZ_ABS away from a position that they only assume.
    """
    needed = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_POS_HORIZ_ABS
    is_ill = message.flags & needed != needed
    yield _Sign(message.get_type(), LOCALISATION, is_ill)


def _fence_status(message: Message) -> Iterator[_Sign]:
    yield _Sign("FENCE_STATUS", FENCE, message.breach_status != 0)


_POWERLESS: Final = frozenset(
    {
        mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY,
        mavlink.MAV_BATTERY_CHARGE_STATE_FAILED,
    }
)


def _battery_status(message: Message) -> Iterator[_Sign]:
    """BATTERY_STATUS(147): a low battery is no failure; one that ends the flight by force is."""
    yield _Sign(f"BATTERY_STATUS {message.id}", BATTERY, message.charge_state in _POWERLESS)


_READERS: Final[Mapping[str, Callable[[Message], Iterator[_Sign]]]] = {
    "SYS_STATUS": _system_status,
    "ESTIMATOR_STATUS": _estimator_status,
    "EKF_STATUS_REPORT": _estimator_status,
    "FENCE_STATUS": _fence_status,
    "BATTERY_STATUS": _battery_status,
}


@dataclass(slots=True)
class _Health:
    failure: Failure
    was_well: bool = False
    ill_since: float | None = None

    def take(self, now: float, *, is_ill: bool) -> None:
        if not is_ill:
            self.was_well, self.ill_since = True, None
        elif self.ill_since is None:
            self.ill_since = now

    @property
    def is_ill(self) -> bool:
        return self.was_well and self.ill_since is not None

    def has_failed(self, now: float) -> bool:
        return self.is_ill and now - (self.ill_since or now) >= DEBOUNCE_S


@dataclass(slots=True)
class AlarmWatch:
    """Watches one vehicle."""

    _signs: dict[tuple[str, AlarmCode], _Health] = field(default_factory=dict)
    _voices: dict[tuple[str, AlarmCode], Voice] = field(default_factory=dict)
    _told: set[AlarmCode] = field(default_factory=set)
    _parameters: tuple[float, tuple[float, float]] | None = None  # And when they were told
    _loss: LinkLoss = field(default_factory=LinkLoss)
    _judge_at: float = 0.0

    def receive(self, message: Message, now: float) -> None:
        """Take a message of the autopilot."""
        self._loss.take(message)
        parameters = alarm_parameters(message)
        if parameters is not None:
            self._parameters = now, parameters
        reader = _READERS.get(message.get_type())
        for source, failure, is_ill in reader(message) if reader is not None else ():
            self._take(source, failure, now, is_ill=is_ill)
        self.observe(message, now)

    def observe(self, message: Message, now: float) -> None:
        """Take a message of any component: what measures the humidity speaks regularly."""
        if message.get_type() not in OBSERVED:
            return
        for reading in readings(message):
            if reading.quantity.observed_property == HUMIDITY:
                source = f"{source_of(message).component} {reading.sensor}"
                self._heard(source, HUMIDITY_SENSOR, now)
                self._take(source, HUMIDITY_SENSING, now, is_ill=reading.value is None)

    def camera_heard(self, now: float) -> None:
        """Take a heartbeat of the vehicle's camera."""
        self._heard("camera", CAMERA, now)

    def tick(self, now: float, *, is_connected: bool) -> list[Failure]:
        """Judge; gives what has failed and was not told. While nobody is heard nothing is ill."""
        if now < self._judge_at:
            return []
        self._judge_at = now + JUDGE_EVERY_S
        for (source, _), voice in self._voices.items():
            failure = CAMERA if source == "camera" else HUMIDITY_SENSOR
            is_silent = voice.is_silent(now, self._loss.share)
            if not is_connected and not is_silent:
                voice.excuse(now)
            self._take_silence(source, failure, now, is_silent=is_silent)
        return [failure for failure in self._failed(now) if self._is_to_tell(failure)]

    def take_parameters(self, now: float) -> tuple[float, float]:
        """Give what the vehicle has told of its newest alarm, once."""
        told, self._parameters = self._parameters, None
        return told[1] if told is not None and now - told[0] <= PARAMETERS_HOLD_S else (0.0, 0.0)

    def forget(self) -> None:
        """Begin anew: the vehicle was restarted, or its link was lost."""
        self._parameters = None
        self._signs.clear()
        self._voices.clear()
        self._told.clear()

    def _take(self, source: str, failure: Failure, now: float, *, is_ill: bool) -> None:
        key = source, failure.code
        if key in self._signs or len(self._signs) < len(_SENSORS) + SOURCES_KEPT:
            self._signs.setdefault(key, _Health(failure)).take(now, is_ill=is_ill)

    def _take_silence(self, source: str, failure: Failure, now: float, *, is_silent: bool) -> None:
        """Take whether a voice is there; silence has been waited for long enough already."""
        self._take(source, failure, now - DEBOUNCE_S, is_ill=is_silent)

    def _heard(self, source: str, failure: Failure, now: float) -> None:
        voice = self._voices.get((source, failure.code))
        if voice is not None:
            voice.heard(now)
        elif len(self._voices) < SOURCES_KEPT:
            self._voices[source, failure.code] = Voice(now)

    def _failed(self, now: float) -> list[Failure]:
        """Everything that has failed, once each."""
        failed = {
            health.failure.code: health.failure
            for health in self._signs.values()
            if health.has_failed(now)
        }
        ill = {health.failure.code for health in self._signs.values() if health.is_ill}
        self._told &= ill
        return [
            failure
            for code, failure in sorted(failed.items())
            if not ill & CAUSES.get(code, frozenset())
        ]

    def _is_to_tell(self, failure: Failure) -> bool:
        is_news = failure.code not in self._told
        self._told.add(failure.code)
        return is_news
