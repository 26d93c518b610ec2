"""SET_POSITION_TARGET_* and SET_ATTITUDE_TARGET to offboard setpoints.

A setpoint that cannot be flown exactly is refused as a whole, because flying a part of it leads
to a position that the sender has not commanded.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple, TypeAlias

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.rotation import normalise, rotate_by_yaw, wrap_pi
from uav_firmware.modules.mavlink.wire.addressing import (
    Outgoing,
    Sender,
    StreamSender,
    is_for_us,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.control_mode import OffboardSetpoint
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)
from uav_firmware.msg.status import HomePosition
from uav_firmware.msg.vectors import Vector3
from uav_firmware.topics import Topics

REACH_MAX_M: Final = 10_000.0
SPEED_MAX_M_S: Final = 100.0
ACCELERATION_MAX_M_S2: Final = 50.0
YAW_MAX_RAD: Final = 10_000.0  # Turns upon turns: no sender that counts them is refused
YAW_RATE_MAX_RAD_S: Final = 10.0
BODY_RATE_MAX_RAD_S: Final = 40.0

_FORCE: Final[int] = mavlink.POSITION_TARGET_TYPEMASK_FORCE_SET
_YAW_IGNORED: Final[int] = mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
_YAW_RATE_IGNORED: Final[int] = mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
_RATE_BITS: Final[tuple[int, int, int]] = (
    mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE,
    mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE,
    mavlink.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE,
)
_THRUST_BODY: Final = 32  # ATTITUDE_TARGET_TYPEMASK_THRUST_BODY_SET, which the dialect lacks
_THRUST_IGNORED: Final[int] = mavlink.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE
_ATTITUDE_IGNORED: Final[int] = mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
_NAN: Final = math.nan

_BODY_FRAMES: Final = frozenset({mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_FRD})
_AMSL_FRAMES: Final = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})
_HOME_FRAMES: Final = frozenset(
    {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
)
_MAX_REPORTED: Final = 16
"""Largest number of different refusals that are reported."""


class SetpointError(Exception):
    """A setpoint cannot be flown; the text says why."""


class Reference(NamedTuple):
    """Reference for frames: the estimate and home."""

    estimate: VehicleLocalPosition
    home: HomePosition | None


Reader: TypeAlias = Callable[[Message, Reference, int], OffboardSetpoint]
"""Converts a message to a setpoint stamped with the time of arrival [us]."""


def from_local(message: Message, reference: Reference, now_us: int) -> OffboardSetpoint:
    """SET_POSITION_TARGET_LOCAL_NED, in NED, or (velocity, acceleration) in a body frame.

    Raises:
        SetpointError: if it cannot be flown.
    """
    position, velocity, acceleration = _vectors(message, (message.x, message.y, message.z))
    if message.coordinate_frame in _BODY_FRAMES:
        if not all(map(math.isnan, position)):
            raise SetpointError("a position in a body frame is not supported")
        heading = reference.estimate.heading
        velocity, acceleration = (
            _rotate_by_heading(velocity, heading),
            _rotate_by_heading(acceleration, heading),
        )
    elif message.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
        raise SetpointError(f"frame {message.coordinate_frame} is not supported")
    return _motion(message, position, velocity, acceleration, now_us)


def from_global(message: Message, reference: Reference, now_us: int) -> OffboardSetpoint:
    """SET_POSITION_TARGET_GLOBAL_INT, above mean sea level or above home.

    Raises:
        SetpointError: if it cannot be flown.
    """
    numbers = (message.lat_int * 1e-7, message.lon_int * 1e-7, message.alt)
    point, velocity, acceleration = _vectors(message, numbers)
    position = _local(point, message.coordinate_frame, reference)
    return _motion(message, position, velocity, acceleration, now_us)


def from_attitude(message: Message, _reference: Reference, now_us: int) -> OffboardSetpoint:
    """SET_ATTITUDE_TARGET: attitude and thrust, or body rates and thrust.

    Raises:
        SetpointError: if it cannot be flown.
    """
    mask, thrust = message.type_mask, message.thrust
    if mask & (_THRUST_IGNORED | _THRUST_BODY):
        raise SetpointError(f"mask {mask} has no collective thrust")
    if not 0.0 <= thrust <= 1.0:
        raise SetpointError(f"thrust is {thrust:g}")
    wire = (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate)
    roll, pitch, yaw = (
        _NAN if mask & bit else rate for rate, bit in zip(wire, _RATE_BITS, strict=True)
    )
    rates = (roll, pitch, yaw)
    _check_limit(rates, BODY_RATE_MAX_RAD_S, "body rate")
    if mask & _ATTITUDE_IGNORED:
        if any(map(math.isnan, rates)):
            raise SetpointError(f"mask {mask} has neither attitude nor all body rates")
        return VehicleRatesSetpoint(now_us, rates, thrust)
    if not (roll == 0.0 or math.isnan(roll)) or not (pitch == 0.0 or math.isnan(pitch)):
        raise SetpointError("roll or pitch rate beside an attitude is not supported")
    return VehicleAttitudeSetpoint(
        now_us, _unit(message.q), 0.0 if math.isnan(yaw) else yaw, thrust
    )


READERS: Final[Mapping[str, Reader]] = {
    "SET_POSITION_TARGET_LOCAL_NED": from_local,
    "SET_POSITION_TARGET_GLOBAL_INT": from_global,
    "SET_ATTITUDE_TARGET": from_attitude,
}


def _unit(q: list[float]) -> tuple[float, float, float, float]:
    w, x, y, z = q
    if not 0.9 < math.sqrt(w * w + x * x + y * y + z * z) < 1.1:
        raise SetpointError("the quaternion is not of unit length")
    return normalise((w, x, y, z))


def _vectors(message: Message, position: Vector3) -> tuple[Vector3, Vector3, Vector3]:
    """Position, velocity and acceleration; NaN where unset."""
    mask = message.type_mask
    if mask & _FORCE:
        raise SetpointError("a force is not supported")
    velocity = _masked((message.vx, message.vy, message.vz), mask >> 3)
    acceleration = _masked((message.afx, message.afy, message.afz), mask >> 6)
    _check_limit(velocity, SPEED_MAX_M_S, "velocity")
    _check_limit(acceleration, ACCELERATION_MAX_M_S2, "acceleration")
    return _masked(position, mask), velocity, acceleration


def _masked(vector: Vector3, mask: int) -> Vector3:
    x, y, z = (_NAN if mask >> axis & 1 else vector[axis] for axis in range(3))
    return (x, y, z)


def _check_limit(vector: Vector3, limit: float, name: str) -> None:
    """Refuse values beyond a limit; NaN is unset."""
    for value in vector:
        if abs(value) > limit:
            raise SetpointError(f"{name} {value:g} is beyond {limit:g}")


def _motion(
    message: Message, position: Vector3, velocity: Vector3, acceleration: Vector3, now_us: int
) -> TrajectorySetpoint:
    _check_limit(position, REACH_MAX_M, "position")
    for name, vector in (
        ("position", position),
        ("velocity", velocity),
        ("acceleration", acceleration),
    ):
        if math.isnan(vector[0]) is not math.isnan(vector[1]):
            raise SetpointError(f"mask {message.type_mask} sets half of a horizontal {name}")
    for axis, name in ((0, "horizontal"), (2, "vertical")):
        if all(math.isnan(vector[axis]) for vector in (position, velocity, acceleration)):
            raise SetpointError(f"mask {message.type_mask} sets nothing {name}")
    yaw = _NAN if message.type_mask & _YAW_IGNORED else message.yaw
    yaw_rate = _NAN if message.type_mask & _YAW_RATE_IGNORED else message.yaw_rate
    _check_limit((yaw, 0.0, 0.0), YAW_MAX_RAD, "yaw")
    _check_limit((yaw_rate, 0.0, 0.0), YAW_RATE_MAX_RAD_S, "yaw rate")
    heading = yaw if math.isnan(yaw) else wrap_pi(yaw)
    return TrajectorySetpoint(now_us, position, velocity, acceleration, heading, yaw_rate)


def _rotate_by_heading(vector: Vector3, heading: float) -> Vector3:
    """Rotate a forward, right, down vector to NED."""
    forward, right, down = vector
    return (*rotate_by_yaw(forward, right, heading), down)


def _local(point: Vector3, frame: int, reference: Reference) -> Vector3:
    """Local position [m, NED] of latitude, longitude [deg] and altitude [m]; NaN stays NaN."""
    if frame not in _AMSL_FRAMES | _HOME_FRAMES:
        raise SetpointError(f"frame {frame} is not supported")
    latitude, longitude, altitude = point
    if frame in _HOME_FRAMES:
        if reference.home is None:
            raise SetpointError("altitude above home, but home is not set")
        altitude += reference.home.altitude_amsl_m
    origin = reference.estimate.origin
    if not all(map(math.isfinite, origin)):
        raise SetpointError("the vehicle's position is unknown")
    down = origin[2] - altitude
    if math.isnan(latitude) or math.isnan(longitude):
        return (_NAN, _NAN, down)
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise SetpointError("latitude or longitude is out of range")
    north, east, _ = LocalFrame(*origin).to_ned(latitude, longitude, origin[2])
    return (north, east, down)


class SetpointInput:
    """Serves SET_POSITION_TARGET_LOCAL_NED, SET_POSITION_TARGET_GLOBAL_INT, SET_ATTITUDE_TARGET.

    Each different refusal is reported once until a setpoint is accepted.
    """

    @property
    def message_types(self) -> tuple[str, ...]:
        """The messages that it handles."""
        return tuple(READERS)

    def __init__(self, system_id: int, topics: Topics, texts: StatusTexts) -> None:
        self._system_id = system_id
        self._topics = topics
        self._texts = texts
        self._reported: set[str] = set()
        self._stream = StreamSender()

    def handle(self, message: Message, sender: Sender, now_us: int) -> list[Outgoing]:
        """Publish the setpoint, or report why it cannot be flown."""
        if not (is_for_us(message, self._system_id) and self._stream.admits(sender, now_us)):
            return []
        estimate = self._topics.vehicle_local_position.value
        if estimate is None:
            return []
        try:
            reference = Reference(estimate, self._topics.home_position.value)
            setpoint = READERS[message.get_type()](message, reference, now_us)
        except SetpointError as error:
            return self._refuse(f"{message.get_type()} ignored: {error}")
        self._reported.clear()
        self._stream.accept(sender, now_us)
        self._topics.offboard_setpoint.publish(setpoint)
        return []

    def _refuse(self, text: str) -> list[Outgoing]:
        if text in self._reported or len(self._reported) >= _MAX_REPORTED:
            return []
        self._reported.add(text)
        return self._texts.encode(mavlink.MAV_SEVERITY_WARNING, text)
