"""Facts about the vehicle that ground stations look up as parameters; nobody can set them.

QGroundControl's setup pages read the airframe, the calibrated sensors and the kind of radio,
and show a vehicle without them as not set up. The broker reads the size of the battery.
"""

from dataclasses import dataclass
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.msg.sensors import SensorBattery
from uav_firmware.parameters import Registry, param

_BATTERY_SIZE: Final = "BAT1_CAPACITY"
_DJI_F450: Final = 4011
"""PX4's number of the airframe."""
_SIMULATED_IMU: Final = 1310988
_SIMULATED_MAG: Final = 197388
"""PX4's ids of sensors on its simulated bus, which need no calibration."""
_STICKS_BY_MAVLINK: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleFacts:
    """What the vehicle is; the battery tells its size once it is heard."""

    airframe: int = param(
        "SYS_AUTOSTART", _DJI_F450, unit="1", minimum=_DJI_F450, maximum=_DJI_F450,
        short="Airframe, as PX4 numbers it; cannot be set",
    )  # fmt: skip
    gyro_id: int = param(
        "CAL_GYRO0_ID", _SIMULATED_IMU, unit="1", minimum=_SIMULATED_IMU, maximum=_SIMULATED_IMU,
        short="Gyroscope that is calibrated; cannot be set",
    )  # fmt: skip
    accelerometer_id: int = param(
        "CAL_ACC0_ID", _SIMULATED_IMU, unit="1", minimum=_SIMULATED_IMU, maximum=_SIMULATED_IMU,
        short="Accelerometer that is calibrated; cannot be set",
    )  # fmt: skip
    magnetometer_id: int = param(
        "CAL_MAG0_ID", _SIMULATED_MAG, unit="1", minimum=_SIMULATED_MAG, maximum=_SIMULATED_MAG,
        short="Magnetometer that is calibrated; cannot be set",
    )  # fmt: skip
    sticks: int = param(
        "COM_RC_IN_MODE", _STICKS_BY_MAVLINK, unit="1",
        minimum=_STICKS_BY_MAVLINK, maximum=_STICKS_BY_MAVLINK,
        short="Where sticks come from: 1 MANUAL_CONTROL alone; cannot be set",
    )  # fmt: skip
    battery_size_mah: float = param(
        _BATTERY_SIZE, -1.0, unit="mAh", minimum=-1.0, maximum=1e6,
        short="Charge of the full battery as its monitor tells it, -1 unknown; cannot be set",
    )  # fmt: skip


FACTS: Final = frozenset(
    {"SYS_AUTOSTART", "CAL_GYRO0_ID", "CAL_ACC0_ID", "CAL_MAG0_ID", "COM_RC_IN_MODE", _BATTERY_SIZE}
)
"""Names of the parameters that are read only."""


def note_battery_size(registry: Registry, battery: Topic[SensorBattery]) -> None:
    """Tell the size of the battery that is there, where it has changed."""
    value = battery.value
    if value is None or _BATTERY_SIZE not in registry.names():
        return
    size_mah = round(value.capacity_ah * 1e3)
    if registry.get(_BATTERY_SIZE) != size_mah:
        registry.set(_BATTERY_SIZE, size_mah)
