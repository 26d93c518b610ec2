"""Facts about the vehicle that ground stations look up as parameters; nobody can set them.

QGroundControl's setup pages read the airframe, the calibrated sensors and the kind of radio,
and show a vehicle without them as not set up.
"""

from dataclasses import dataclass
from typing import Final

from uav_firmware.parameters import param

_DJI_F450: Final = 4011
"""PX4's number of the airframe."""
_SIMULATED_IMU: Final = 1310988
_SIMULATED_MAG: Final = 197388
"""PX4's ids of sensors on its simulated bus, which need no calibration."""
_STICKS_BY_MAVLINK: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleFacts:
    """What the vehicle is."""

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


FACTS: Final = frozenset(
    {"SYS_AUTOSTART", "CAL_GYRO0_ID", "CAL_ACC0_ID", "CAL_MAG0_ID", "COM_RC_IN_MODE"}
)
"""Names of the parameters that are read only."""
