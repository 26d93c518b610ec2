"""Motor commands. Written by control_allocator, carried out by the driver."""

from typing import NamedTuple

from uav_firmware.msg.vectors import Motors


class ActuatorMotors(NamedTuple):
    """Normalised motor commands; all zero when disarmed."""

    time_us: int  # [us]
    control: Motors  # [-] 0 stopped to 1 full
