"""What the vehicle measures of air and soil, for farms.

MAVLink has a message for the hygrometer alone; the rest goes by name, as NAMED_VALUE_FLOAT.
"""

import math
from typing import Final

from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.conversion import (
    UINT16_MAX,
    boot_ms,
    int16,
    uint16,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink

FRESH_US: Final = 3_000_000
"""An instrument that has been silent for longer is not spoken for."""


def hygrometer_sensor(context: Context) -> Message | None:
    """HYGROMETER_SENSOR: hundredths of a degree and of a percent; UINT16_MAX is no humidity."""
    sample = context.topics.hygrometer.value
    if sample is None or context.now_us - sample.time_us > FRESH_US:
        return None
    humidity = sample.relative_humidity_percent
    return mavlink.MAVLink_hygrometer_sensor_message(
        id=0,
        temperature=int16(sample.air_temperature_c * 1e2),
        humidity=uint16(humidity * 1e2) if math.isfinite(humidity) else UINT16_MAX,
    )


def named_values(context: Context) -> tuple[Message, ...] | None:
    """NAMED_VALUE_FLOAT of soil and light; water in the soil in percent by volume."""
    sample = context.topics.ground_sample.value
    if sample is None or context.now_us - sample.time_us > FRESH_US:
        return None
    values = (
        ("soil_moist", sample.soil_moisture * 1e2),
        ("temp_soil", sample.soil_temperature_c),
        ("light", sample.illuminance_lx),
    )
    return tuple(
        mavlink.MAVLink_named_value_float_message(boot_ms(sample.time_us), name.encode(), value)
        for name, value in values
    )
