"""Measurements of the environment: which messages carry them, and the lists that are posted.

Units are UCUM. A reading without a value shows that its source sends but does not measure: NaN,
infinity, and what lies outside the sensor's possible range, where vehicles put "invalid".

A measurement keeps the place and the time at which it was made. One that is older than a few
seconds belongs to another place and is not posted.

The project's own autopilot sends contents of AFarCloud's model for which MAVLink has no message in
TUNNEL(385). The payload types are in the range for private use; the payload is a JSON array in
UTF-8:

    0xAFC1  [resource id, observed property, result value, result unit], one observation
    0xAFC2  [first, second], the two parameters of the alarm that comes next
"""

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from afarcloud.state import Observation, ObservationList
from mavlink_broker.mavlink.dialect import Message, source_of
from mavlink_broker.vehicle.telemetry import Position, Snapshot

CELSIUS, PERCENT, LUX, METRE_PER_SECOND = "Cel", "%", "lx", "m/s"
DEGREE, HECTOPASCAL, ONE = "deg", "hPa", "1"
HUMIDITY: Final = "relative_humidity"
STILL_AIR_M_S: Final = 0.1
"""Wind below it has no direction."""
_SIGNIFICANT: Final = 2.0
"""Wind below this multiple of its accuracy, where the vehicle sends one, is not reported."""
_NOT_IN_NAMES: Final = re.compile(r"[^A-Za-z0-9_.-]")
FRESH_S: Final = 5.0
"""Greatest age of a measurement, by the vehicle's clock."""
RECEIVED_WITHIN_S: Final = 30.0
"""The same by the broker's clock: after a lost link the vehicle's clock is as old as the rest."""
SOURCES_KEPT: Final = 64
"""Limits the memory that new names of a vehicle can fill."""
LIST_LENGTH: Final = 10
"""Limit of AFarCloud's ObservationList; more observations make another list."""


class Quantity(NamedTuple):
    """What is measured, in which unit, and what a sensor of it can show."""

    observed_property: str
    unit: str
    lowest: float = -math.inf
    highest: float = math.inf


class Reading(NamedTuple):
    """One value of one sensor; None where the sensor has none."""

    sensor: str  # Distinct from the other sensors of its component
    quantity: Quantity
    value: float | None


AIR_TEMPERATURE: Final = Quantity("air_temperature", CELSIUS, -90.0, 85.0)
AIR_HUMIDITY: Final = Quantity(HUMIDITY, PERCENT, 0.0, 100.0)
SOIL_TEMPERATURE: Final = Quantity("soil_temperature", CELSIUS, -90.0, 85.0)
SOIL_MOISTURE: Final = Quantity("soil_moisture", PERCENT, 0.0, 100.0)  # By volume
ILLUMINANCE: Final = Quantity("illuminance", LUX, 0.0)
WIND_SPEED: Final = Quantity("wind_speed", METRE_PER_SECOND, 0.0, 150.0)
WIND_DIRECTION: Final = Quantity("wind_direction", DEGREE, 0.0, 360.0)  # Whence, from north
AIR_PRESSURE: Final = Quantity("air_pressure", HECTOPASCAL, 100.0, 1200.0)
BAROMETER_TEMPERATURE: Final = Quantity("barometer_temperature", CELSIUS, -90.0, 125.0)

NAMED: Final[Mapping[str, Quantity]] = {
    "temp_air": AIR_TEMPERATURE,
    "hum_air": AIR_HUMIDITY,
    "temp_soil": SOIL_TEMPERATURE,
    "soil_moist": SOIL_MOISTURE,
    "light": ILLUMINANCE,
    "wind_speed": WIND_SPEED,
    "wind_dir": WIND_DIRECTION,
    "press_air": AIR_PRESSURE,
}
"""Names of NAMED_VALUE_FLOAT(251) and NAMED_VALUE_INT(252); every other has the unit 1."""


def readings(message: Message) -> Iterator[Reading]:
    """Give the measurements of a message; most messages have none."""
    reader = _READERS.get(message.get_type())
    if reader is not None:
        for sensor, quantity, value in reader(message):
            possible = math.isfinite(value) and quantity.lowest <= value <= quantity.highest
            yield Reading(sensor, quantity, value if possible else None)


_Values = Iterator[tuple[str, Quantity, float]]


def _hygrometer(message: Message) -> _Values:
    """HYGROMETER_SENSOR(12920): hundredths of a degree and of a percent."""
    sensor = f"hygrometer{message.id}"
    yield sensor, AIR_TEMPERATURE, message.temperature / 100.0
    yield sensor, AIR_HUMIDITY, message.humidity / 100.0


def _named(message: Message) -> _Values:
    name = _NOT_IN_NAMES.sub("", str(message.name))
    if name:
        yield name, NAMED.get(name, Quantity(name, ONE)), float(message.value)


def _wind_cov(message: Message) -> _Values:
    """WIND_COV(231): where the air moves to, north and east, m/s."""
    speed_m_s = math.hypot(message.wind_x, message.wind_y)
    if message.horiz_accuracy > 0.0 and speed_m_s <= _SIGNIFICANT * message.horiz_accuracy:
        speed_m_s = math.nan  # Below it there is none
    yield from _wind(speed_m_s, math.degrees(math.atan2(-message.wind_y, -message.wind_x)))


def _ardupilot_wind(message: Message) -> _Values:
    """WIND(168): where it comes from, degrees, and m/s."""
    yield from _wind(message.speed, message.direction)


def _wind(speed_m_s: float, from_deg: float) -> _Values:
    yield "wind", WIND_SPEED, speed_m_s
    if speed_m_s >= STILL_AIR_M_S:
        yield "wind", WIND_DIRECTION, from_deg % 360.0


def _pressure(message: Message) -> _Values:
    """SCALED_PRESSURE(29): the barometer's own temperature is not that of the air."""
    yield "barometer", AIR_PRESSURE, message.press_abs
    yield "barometer", BAROMETER_TEMPERATURE, message.temperature / 100.0


_READERS: Final[Mapping[str, Callable[[Message], _Values]]] = {
    "HYGROMETER_SENSOR": _hygrometer,
    "NAMED_VALUE_FLOAT": _named,
    "NAMED_VALUE_INT": _named,
    "WIND_COV": _wind_cov,
    "WIND": _ardupilot_wind,
    "SCALED_PRESSURE": _pressure,
}
OBSERVED: Final = frozenset(_READERS)
"""Messages with measurements, of any component."""
MEASURED: Final = OBSERVED | {"TUNNEL"}
"""Messages of the autopilot with measurements."""


OBSERVATION: Final = 0xAFC1
ALARM_PARAMETERS: Final = 0xAFC2
MAX_TEXT_CHARACTERS: Final = 100


class TunnelObservation(NamedTuple):
    """One observation, named by its source."""

    resource_id: str
    observed_property: str
    value: float
    unit: str


def tunnel_observation(message: Message) -> TunnelObservation | None:
    """Decode an observation; None for other messages and for invalid values."""
    match _fields(message, OBSERVATION):
        case [str(resource_id), str(observed_property), int() | float() as value, str(unit)]:
            return _checked(resource_id, observed_property, value, unit)
    return None


def alarm_parameters(message: Message) -> tuple[float, float] | None:
    """Decode the parameters of an alarm; None for other messages and for invalid values."""
    match _fields(message, ALARM_PARAMETERS):
        case [int() | float() as first, int() | float() as second]:
            one, two = _number(first), _number(second)
            return None if one is None or two is None else (one, two)
    return None


def _fields(message: Message, kind: int) -> Any:
    if message.get_type() != "TUNNEL" or message.payload_type != kind:
        return None
    try:
        return json.loads(bytes(message.payload[: message.payload_length]))
    except (ValueError, RecursionError):
        return None


def _checked(
    resource_id: str, observed_property: str, value: float, unit: str
) -> TunnelObservation | None:
    texts = resource_id, observed_property, unit
    number = _number(value)
    if number is None or not all(
        w.isprintable() and 1 <= len(w) <= MAX_TEXT_CHARACTERS for w in texts
    ):
        return None
    return TunnelObservation(resource_id, observed_property, number, unit)


def _number(value: float) -> float | None:
    """A finite number; None for others and for a bool."""
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


class ResourceKey(NamedTuple):
    """What stays the same about a measurement: component, sensor and property."""

    component: int
    sensor: str
    observed_property: str
    own_name: str = ""  # Where it has sent its own resource id


class _Measured(NamedTuple):
    value: float
    quantity: Quantity
    place: Position
    vehicle_s: float | None  # By the autopilot's clock, since it was switched on
    received_at: float  # By the broker's


def resource_id(vehicle_id: int, key: ResourceKey) -> str:
    """Name a sensor as AFarCloud does: a URN of five parts, unless it has a name of its own."""
    if key.own_name:
        return key.own_name
    return f"urn:afc:uav:{vehicle_id}:{key.component}:{key.sensor}:{key.observed_property}"


@dataclass(slots=True)
class Observations:
    """What one vehicle has measured lately."""

    _newest: dict[ResourceKey, _Measured] = field(default_factory=dict)

    def take(self, message: Message, snapshot: Snapshot, now: float) -> None:
        """Keep the measurements of a message, with the vehicle's present position."""
        for reading, own_name in _readings_with_names(message):
            observed_property = reading.quantity.observed_property
            component = source_of(message).component
            key = ResourceKey(component, reading.sensor, observed_property, own_name)
            if reading.value is None or snapshot.position is None:
                self._newest.pop(key, None)
            elif key in self._newest or len(self._newest) < SOURCES_KEPT:
                self._newest[key] = _Measured(
                    reading.value, reading.quantity, snapshot.position, snapshot.time_s, now
                )

    def forget(self) -> None:
        """Drop everything: the vehicle was restarted."""
        self._newest.clear()

    def lists(
        self, snapshot: Snapshot, now: float, *, vehicle_id: int, sequence_number: int
    ) -> Iterator[ObservationList]:
        """Give what is fresh, ten to a list, each list at the place of its newest measurement.

        A `result_time` of 0 stands for a vehicle that has sent no time of day.
        """
        fresh = sorted(
            (key, measured)
            for key, measured in self._newest.items()
            if _is_fresh(measured, snapshot, now)
        )
        for number, first in enumerate(range(0, len(fresh), LIST_LENGTH)):
            batch = fresh[first : first + LIST_LENGTH]
            place = max(batch, key=lambda pair: pair[1].received_at)[1].place
            yield ObservationList(
                sequence_number=sequence_number + number,
                vehicle_id=vehicle_id,
                latitude=place.latitude_deg,
                longitude=place.longitude_deg,
                altitude=place.altitude_m,
                observation_array=tuple(
                    _observation(vehicle_id, key, measured, snapshot) for key, measured in batch
                ),
            )


def _readings_with_names(message: Message) -> Iterator[tuple[Reading, str]]:
    """Give the readings of a message, each with the resource id that came with it, if any."""
    for reading in readings(message):
        yield reading, ""
    own = tunnel_observation(message)
    if own is not None:
        yield Reading("", Quantity(own.observed_property, own.unit), own.value), own.resource_id


def _is_fresh(measured: _Measured, snapshot: Snapshot, now: float) -> bool:
    if now - measured.received_at > RECEIVED_WITHIN_S:
        return False
    if snapshot.time_s is None or measured.vehicle_s is None:
        return now - measured.received_at <= FRESH_S
    return snapshot.time_s - measured.vehicle_s <= FRESH_S


def _observation(
    vehicle_id: int, key: ResourceKey, measured: _Measured, snapshot: Snapshot
) -> Observation:
    return Observation(
        resource_id=resource_id(vehicle_id, key),
        observed_property=measured.quantity.observed_property,
        result_time=_time_of_day_s(measured, snapshot),
        result_value=measured.value,
        result_uom=measured.quantity.unit,
    )


def _time_of_day_s(measured: _Measured, snapshot: Snapshot) -> int:
    if snapshot.booted_at_utc_s is None or measured.vehicle_s is None:
        return 0
    return round(snapshot.booted_at_utc_s + measured.vehicle_s)
