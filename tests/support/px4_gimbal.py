"""The gimbal manager of PX4: who points its gimbal, and where it looks.

`gimbal/input_mavlink.cpp` and `gimbal.cpp`: at first nobody is in control. The commands of a
mission come from the vehicle itself, which has to be in control too. -2 in
DO_GIMBAL_MANAGER_CONFIGURE means the vehicle, whoever has sent it. A mission that ends, or is left,
gives up control (`mission_base.cpp`).
"""

from typing import Final, NamedTuple

from tests.support.vehicle_wire import mavlink

_CONFIGURE: Final = 1001
_POINT: Final = 1000
_LOCKED: Final = 12
"""GIMBAL_MANAGER_FLAGS of roll and pitch that count from the horizon."""


class Sender(NamedTuple):
    """System and component."""

    system: int
    component: int


class Px4Gimbal:
    """One gimbal, and who is in control of it."""

    def __init__(self, vehicle: int) -> None:
        self._vehicle = Sender(vehicle, 1)
        self._holder = Sender(0, 0)
        self.looks: list[tuple[float, float]] = []
        """Pitch from the horizon and yaw, of every direction that it was given."""

    def order(
        self, command: int, parameters: tuple[float, ...], sender: Sender | None = None
    ) -> int:
        """Obey a command, by default one of the mission, and answer with its MAV_RESULT."""
        who = sender or self._vehicle
        if command == _CONFIGURE:
            self._holder = Sender(
                self._chosen(parameters[0], self._vehicle.system, self._holder.system),
                self._chosen(parameters[1], self._vehicle.component, self._holder.component),
            )
        elif command == _POINT:
            if who != self._holder:
                return int(mavlink.MAV_RESULT_DENIED)
            if int(parameters[4]) & _LOCKED == _LOCKED:
                self.looks.append((parameters[0], parameters[1]))
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def leave_mission(self) -> None:
        """Give up the mission's control."""
        if self._holder == self._vehicle:
            self._holder = Sender(0, 0)

    @staticmethod
    def _chosen(value: float, own: int, before: int) -> int:
        if value == -1.0:
            return before
        return own if value == -2.0 else int(value)
