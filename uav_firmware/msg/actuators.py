"""Motor commands. Written by control_allocator, carried out by the driver."""

from typing import Final

from farm_flight_bridge.native import mypyc_attr
from uav_firmware.msg.vectors import Motors


@mypyc_attr(acyclic=True, free_list_len=1)
class ActuatorMotors:
    """Normalised motor commands; all zero when disarmed."""

    __slots__ = ("control", "time_us")

    def __init__(
        self,
        time_us: int,  # [us]
        control: Motors,  # [-] 0 stopped to 1 full
    ) -> None:
        self.time_us: Final = time_us
        self.control: Final = control
