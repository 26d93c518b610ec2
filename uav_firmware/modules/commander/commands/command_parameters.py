"""Checks and conversions of command parameters that several commands share.

A place is within the limits of missions (`uav_firmware/lib/mission_rules.py`).
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.geo import distance_and_bearing
from uav_firmware.lib.mission_rules import DEEPEST_M, FARTHEST_M, HIGHEST_M
from uav_firmware.lib.payload_rules import unset
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.status import Command, HomePosition, VehicleCommand

_FRAME_AMSL: Final = 0
_FRAME_RELATIVE: Final = 3
_FRAME_RELATIVE_INT: Final = 6
_AMBIGUOUS: Final = frozenset({Command.DO_ORBIT, Command.DO_SET_HOME})
"""MAVSDK sends their altitude above mean sea level and leaves frame 3 in place, since PX4 does not
use it. As a height above home it would make the vehicle climb by the altitude of the site.
"""
NAN: Final = math.nan


class BadParameterError(Exception):
    """A parameter is wrong; the text names it. Becomes DENIED."""


class Place(NamedTuple):
    """A place given by parameters 5 to 7; NaN where unset."""

    latitude_deg: float  # [deg]
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]


def parameters(command: VehicleCommand) -> tuple[float, ...]:
    """Parameters 1 to 7."""
    return command[2:9]


def refuse_infinite(command: VehicleCommand) -> None:
    """No parameter of any command may be infinite."""
    for number, value in enumerate(parameters(command), start=1):
        if math.isinf(value):
            raise BadParameterError(f"parameter {number} is infinite")


def refuse_set(command: VehicleCommand, *numbers: int) -> None:
    """Refuse parameters that have no effect here but are set."""
    values = parameters(command)
    for number in numbers:
        if not unset(values[number - 1]):
            raise BadParameterError(f"parameter {number} is set but has no effect")


def refuse_negative(command: VehicleCommand, number: int) -> None:
    """Refuse a parameter below 0; unset is allowed."""
    if parameters(command)[number - 1] < 0.0:
        raise BadParameterError(f"parameter {number} is negative")


def choice(command: VehicleCommand, number: int, *allowed: float) -> float:
    """Value of a parameter that must be one of a few."""
    value = parameters(command)[number - 1]
    if value not in allowed:
        raise BadParameterError(f"parameter {number} is {value:g}")
    return value


def place(command: VehicleCommand, view: VehicleView, *, zero_is_unset: bool) -> Place:
    """Parameters 5 to 7 as a place; raises BadParameterError when it is too far away."""
    latitude, longitude = command.param5, command.param6
    altitude = _altitude(command, view)
    if math.isnan(latitude) and math.isnan(longitude):
        return Place(NAN, NAN, altitude)
    if zero_is_unset and unset(latitude) and unset(longitude):
        return Place(NAN, NAN, altitude)
    if not abs(latitude) <= 90.0:
        raise BadParameterError(f"parameter 5: latitude is {latitude:g}")
    if not abs(longitude) <= 180.0:
        raise BadParameterError(f"parameter 6: longitude is {longitude:g}")
    if view.home is not None:
        home = view.home
        away, _ = distance_and_bearing(home.latitude_deg, home.longitude_deg, latitude, longitude)
        if not away <= FARTHEST_M:
            raise BadParameterError(f"parameters 5 and 6: {away / 1000.0:.0f} km from home")
    return Place(latitude, longitude, altitude)


def _altitude(command: VehicleCommand, view: VehicleView) -> float:
    if command.frame not in {_FRAME_AMSL, _FRAME_RELATIVE, _FRAME_RELATIVE_INT}:
        raise BadParameterError(f"frame {command.frame} is not supported")
    altitude, home = command.param7, view.home
    if math.isnan(altitude):
        return altitude
    if _is_relative(command, home):
        if home is None:
            raise BadParameterError("parameter 7 is relative to home, which is not set")
        altitude += home.altitude_amsl_m
    if home is not None and altitude > home.altitude_amsl_m + HIGHEST_M:
        raise BadParameterError(f"parameter 7: more than {HIGHEST_M:.0f} m above home")
    return altitude


def _is_relative(command: VehicleCommand, home: HomePosition | None) -> bool:
    """Whether an altitude is above home; if ambiguous, when it is nearer to 0 than to home."""
    if command.frame == _FRAME_RELATIVE and command.command in _AMBIGUOUS:
        return home is not None and abs(command.param7) < abs(command.param7 - home.altitude_amsl_m)
    return command.frame != _FRAME_AMSL


def refuse_too_low(altitude_amsl_m: float, view: VehicleView) -> None:
    """A target in the air may lie below home, on a hillside, but no lower than hills go."""
    home = view.home
    if home is not None and altitude_amsl_m < home.altitude_amsl_m - DEEPEST_M:
        raise BadParameterError(f"parameter 7: more than {DEEPEST_M:.0f} m below home")
