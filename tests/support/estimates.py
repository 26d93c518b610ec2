"""Estimates for unit tests: valid and at rest unless a test sets other values."""

from typing import Any

from tests.support.messages import changed
from uav_firmware.msg.estimate import VehicleLocalPosition

_AT_REST = VehicleLocalPosition(
    time_us=1_000_000,
    position_ned=(0.0, 0.0, 0.0),
    velocity_ned=(0.0, 0.0, 0.0),
    acceleration_ned=(0.0, 0.0, 0.0),
    heading=0.0,
    origin_latitude_deg=40.0,
    origin_longitude_deg=-3.0,
    origin_altitude_amsl_m=650.0,
    horizontal_accuracy_m=0.5,
    vertical_accuracy_m=0.5,
    position_valid=True,
    altitude_valid=True,
    velocity_valid=True,
    heading_valid=True,
)


def local_position(**changes: Any) -> VehicleLocalPosition:
    """A local position with some fields changed."""
    return changed(_AT_REST, **changes)
