"""Time left of the battery, and time of a return: pure.

Both are rough: the battery by the present current, the return straight home at the navigator's
speeds, plus a tenth for what is not counted.
"""

import math
from typing import NamedTuple

from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.parameters import Registry

_LEAST_CURRENT_A = 0.1  # Less is not the current of a flight
_FACTOR = 1.1  # RTL_TIME_FACTOR as PX4 sets it


class ReturnSpeeds(NamedTuple):
    """Speeds and heights of a return; the navigator's parameters."""

    cruise: float = 5.0  # [m/s] MPC_XY_CRUISE
    climb: float = 2.5  # [m/s] MPC_Z_V_AUTO_UP
    descent: float = 1.5  # [m/s] MPC_Z_V_AUTO_DN
    landing: float = 0.7  # [m/s] MPC_LAND_SPEED
    landing_height: float = 5.0  # [m] MPC_LAND_ALT2
    height: float = 20.0  # [m] RTL_RETURN_ALT
    close: float = 10.0  # [m] RTL_MIN_DIST


_NAMES = (
    "MPC_XY_CRUISE",
    "MPC_Z_V_AUTO_UP",
    "MPC_Z_V_AUTO_DN",
    "MPC_LAND_SPEED",
    "MPC_LAND_ALT2",
    "RTL_RETURN_ALT",
    "RTL_MIN_DIST",
)


def return_speeds(registry: Registry) -> ReturnSpeeds:
    """Speeds by the parameters; defaults where there is no navigator."""
    if not set(_NAMES) <= set(registry.names()):
        return ReturnSpeeds()
    return ReturnSpeeds(*(float(registry.get(name)) for name in _NAMES))


def battery_time_s(view: VehicleView) -> float:
    """Time until empty at the present current [s]; infinite when unknown."""
    battery = view.battery
    if battery is None or not battery.current_a > _LEAST_CURRENT_A:
        return math.inf
    return battery.remaining * battery.capacity_ah * 3600.0 / battery.current_a


def return_time_s(view: VehicleView, speeds: ReturnSpeeds) -> float:
    """Time of the return and the landing [s]; 0 when position or home is unknown."""
    if view.position is None or view.home is None or not view.position_valid:
        return 0.0
    north, east, down = view.position.position_ned
    home_north, home_east, home_down = view.home.position_ned
    distance = math.hypot(north - home_north, east - home_east)
    height = max(home_down - down, 0.0)
    top = height if distance < speeds.close else max(height, speeds.height)
    slow = min(top, speeds.landing_height)
    sinking = (top - slow) / speeds.descent + slow / speeds.landing
    return _FACTOR * ((top - height) / speeds.climb + distance / speeds.cruise + sinking)
