"""What the navigator reads of others: the controller's limits and the estimator's origin."""

import math
from typing import Final

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

_CEILING_PARAMETERS: Final = ("MPC_XY_VEL_MAX", "MPC_Z_VEL_MAX_UP", "MPC_Z_VEL_MAX_DN")
_TILT_PARAMETER: Final = "MPC_TILTMAX_AIR"
_STICKS_STALE_US: Final = 500_000  # [us] Silent for longer, nobody turns the nose
_DEAD_ZONE: Final = 0.1  # [-] A hand that rests on the stick turns nothing


def tilt_max(registry: Registry) -> float:
    """Largest tilt [rad] that the position controller allows."""
    if _TILT_PARAMETER not in registry.names():
        return 0.5 * math.pi
    return math.radians(float(registry.get(_TILT_PARAMETER)))


def ceiling(registry: Registry) -> Vector3:
    """Speeds that the position controller allows: horizontal, up, down [m/s]."""
    declared = set(registry.names())
    horizontal, up, down = (
        float(registry.get(name)) if name in declared else math.inf for name in _CEILING_PARAMETERS
    )
    return (horizontal, up, down)


def frame_of(estimate: VehicleLocalPosition, frame: LocalFrame | None) -> LocalFrame | None:
    """Local frame of the estimate's origin; a new one only when the origin has moved."""
    origin = (
        estimate.origin_latitude_deg,
        estimate.origin_longitude_deg,
        estimate.origin_altitude_amsl_m,
    )
    if frame is not None and origin == (
        frame.latitude_deg,
        frame.longitude_deg,
        frame.altitude_amsl_m,
    ):
        return frame
    return LocalFrame(*origin) if all(map(math.isfinite, origin)) else None


def yaw_of(sticks: ManualControlSetpoint | None, now_us: int) -> float:
    """Yaw stick [-1 to 1] beyond its dead zone; centred when the sticks are silent or not there."""
    if sticks is None or now_us - sticks.time_us > _STICKS_STALE_US:
        return 0.0
    beyond = max(abs(sticks.yaw) - _DEAD_ZONE, 0.0) / (1.0 - _DEAD_ZONE)
    return math.copysign(min(beyond, 1.0), sticks.yaw)
