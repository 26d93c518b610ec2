"""What counts as a measurement of the environment, as one table: message to values with units.

Units are UCUM. A reading without a value shows that its source sends but does not measure: NaN,
infinity, and what lies outside the sensor's possible range, where vehicles put "invalid".
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Final, NamedTuple

from mavlink_broker.mavlink.dialect import Message

CELSIUS, PERCENT, LUX, METRE_PER_SECOND = "Cel", "%", "lx", "m/s"
DEGREE, HECTOPASCAL, ONE = "deg", "hPa", "1"

HUMIDITY: Final = "relative_humidity"
STILL_AIR_M_S: Final = 0.1
"""Wind below it has no direction."""
_SIGNIFICANT: Final = 2.0
"""Wind below this multiple of its accuracy, where the vehicle sends one, is not reported."""
_NOT_IN_NAMES: Final = re.compile(r"[^A-Za-z0-9_.-]")


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
        speed_m_s = math.nan  # As good as none
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
"""Messages with measurements."""
