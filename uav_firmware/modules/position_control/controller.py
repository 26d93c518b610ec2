"""The position law: P on position, PID on velocity, thrust vector.

    velocity wanted = feed-forward + P (position wanted - position)            limited
    acceleration    = feed-forward + P (velocity wanted - velocity) + integral
                      + D (acceleration feed-forward - acceleration)
    thrust          = see control_math.thrust_vector                           limited

NaN means unset, axis by axis: without a position the velocity alone is controlled, without a
velocity too only the acceleration. That is then the feed-forward alone, as in PX4's
PositionControl: no integral of a former leg is added. Where the estimate has been lost instead
(`Motion.holds`), integral and D stay. The integrator is slowed by what the limits took away
from the acceleration (back-calculation; L. Rundqwist, "Anti-reset windup for PID controllers",
IFAC 1990), so a setpoint that cannot be reached does not charge it.
"""

import math
from typing import NamedTuple

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.modules.position_control.control_math import (
    ThrustLimits,
    acceleration_of,
    shorten_horizontal,
    thrust_vector,
)
from uav_firmware.msg.vectors import Vector3

_INTEGRAL_LIMIT_XY = 6.0  # [m/s^2] A tilt of 31 deg against steady wind
_INTEGRAL_LIMIT_Z = 7.0  # [m/s^2] A hover thrust 70 % too small, or 40 % too large


class PositionGains(NamedTuple):
    """Gains of the position and velocity loops; first horizontal, then vertical."""

    position_p: tuple[float, float]  # [1/s]
    velocity_p: tuple[float, float]  # [1/s]
    velocity_i: tuple[float, float]  # [1/s^2]
    velocity_d: tuple[float, float]  # [-]


class PositionLimits(NamedTuple):
    """Limits that no setpoint overrides."""

    speed_horizontal: float  # [m/s]
    speed_up: float  # [m/s]
    speed_down: float  # [m/s]


class Motion(NamedTuple):
    """Position, velocity and acceleration at one instant, measured or wanted."""

    position_ned: Vector3  # [m]
    velocity_ned: Vector3  # [m/s]
    acceleration_ned: Vector3  # [m/s^2]
    speed_max: float = math.inf  # [m/s] Of a velocity that is wanted, whatever its direction
    holds: bool = False  # What held against wind and weight goes on where no velocity is wanted


class PositionController:
    """The law with its one state, the integrator."""

    __slots__ = ("gains", "integral_ned", "limits")

    def __init__(self, gains: PositionGains, limits: PositionLimits) -> None:
        self.gains = gains
        self.limits = limits
        self.integral_ned: Vector3 = (0.0, 0.0, 0.0)  # [m/s^2]

    def reset(self) -> None:
        """Forget the integral: on the ground."""
        self.integral_ned = (0.0, 0.0, 0.0)

    def forget_horizontal(self) -> None:
        """Forget what held against the wind: the ground does from now on."""
        self.integral_ned = (0.0, 0.0, self.integral_ned[2])

    def follow_hover(self, former: float, present: float) -> None:
        """Set a new hover thrust without a jump of the thrust: the integral compensates."""
        north, east, down = self.integral_ned
        down = STANDARD_GRAVITY_M_S2 - (STANDARD_GRAVITY_M_S2 - down) * former / present
        self.integral_ned = (north, east, _limited(down))

    def update(
        self, wanted: Motion, measured: Motion, thrust_limits: ThrustLimits, hover: float, dt: float
    ) -> Vector3:
        """Thrust vector [-, NED] for a wanted and a measured motion after `dt` seconds."""
        velocity = velocity_setpoint(wanted, measured, self.gains, self.limits)
        error = (
            _difference(velocity[0], measured.velocity_ned[0]),
            _difference(velocity[1], measured.velocity_ned[1]),
            _difference(velocity[2], measured.velocity_ned[2]),
        )
        acceleration = self._acceleration(velocity, error, wanted, measured)
        thrust = thrust_vector(acceleration, hover, thrust_limits)
        north, east, down = self.integral_ned
        self._integrate(error, acceleration, acceleration_of(thrust, hover), dt)
        if not wanted.holds:  # A feed-forward that is cut says nothing about wind and weight
            self.integral_ned = (
                north if math.isnan(velocity[0]) else self.integral_ned[0],
                east if math.isnan(velocity[1]) else self.integral_ned[1],
                down if math.isnan(velocity[2]) else self.integral_ned[2],
            )
        return thrust

    def _acceleration(
        self, velocity: Vector3, error: Vector3, wanted: Motion, measured: Motion
    ) -> Vector3:
        p_xy, p_z = self.gains.velocity_p
        d_xy, d_z = self.gains.velocity_d
        integral = self.integral_ned
        forward = (
            _zero_if_unset(wanted.acceleration_ned[0]),
            _zero_if_unset(wanted.acceleration_ned[1]),
            _zero_if_unset(wanted.acceleration_ned[2]),
        )
        present = measured.acceleration_ned
        north = forward[0] + p_xy * error[0] + integral[0] + d_xy * (forward[0] - present[0])
        east = forward[1] + p_xy * error[1] + integral[1] + d_xy * (forward[1] - present[1])
        down = forward[2] + p_z * error[2] + integral[2] + d_z * (forward[2] - present[2])
        if wanted.holds:
            return (north, east, down)
        return (
            forward[0] if math.isnan(velocity[0]) else north,
            forward[1] if math.isnan(velocity[1]) else east,
            forward[2] if math.isnan(velocity[2]) else down,
        )

    def _integrate(self, error: Vector3, asked: Vector3, given: Vector3, dt: float) -> None:
        """Charge the integral by the error less what the limits have cut."""
        p_xy, p_z = self.gains.velocity_p
        i_xy, i_z = self.gains.velocity_i
        back_xy, back_z = 2.0 / p_xy, 2.0 / p_z
        north, east, down = self.integral_ned
        north += i_xy * (error[0] - back_xy * (asked[0] - given[0])) * dt
        east += i_xy * (error[1] - back_xy * (asked[1] - given[1])) * dt
        down += i_z * (error[2] - back_z * (asked[2] - given[2])) * dt
        north, east = shorten_horizontal(north, east, _INTEGRAL_LIMIT_XY)
        self.integral_ned = (north, east, _limited(down))


def velocity_setpoint(
    wanted: Motion, measured: Motion, gains: PositionGains, limits: PositionLimits
) -> Vector3:
    """Velocity [m/s, NED] that removes the position error and follows the feed-forward.

    The horizontal part keeps its direction and is shortened to its limit, and so is the whole
    vector to the limit that comes with what is wanted. An axis that has neither position nor
    velocity stays NaN.
    """
    p_xy, p_z = gains.position_p
    north = _velocity_axis(wanted, measured, 0, p_xy)
    east = _velocity_axis(wanted, measured, 1, p_xy)
    down = _velocity_axis(wanted, measured, 2, p_z)
    if not (math.isnan(north) or math.isnan(east)):
        north, east = shorten_horizontal(north, east, limits.speed_horizontal)
    if down < -limits.speed_up or down > limits.speed_down:  # false for NaN
        down = min(max(down, -limits.speed_up), limits.speed_down)
    speed = math.sqrt(north * north + east * east + down * down)
    if speed > wanted.speed_max:  # false for NaN
        share = wanted.speed_max / speed
        return (share * north, share * east, share * down)
    return (north, east, down)


def _velocity_axis(wanted: Motion, measured: Motion, axis: int, gain: float) -> float:
    error = wanted.position_ned[axis] - measured.position_ned[axis]
    forward = wanted.velocity_ned[axis]
    if math.isnan(error):
        return forward
    return gain * error + _zero_if_unset(forward)


def _limited(integral_down: float) -> float:
    """A vertical integral within its limit; where nothing is clipped, min and max only cost."""
    if -_INTEGRAL_LIMIT_Z <= integral_down <= _INTEGRAL_LIMIT_Z:
        return integral_down
    return min(max(integral_down, -_INTEGRAL_LIMIT_Z), _INTEGRAL_LIMIT_Z)


def _zero_if_unset(value: float) -> float:
    return 0.0 if math.isnan(value) else value


def _difference(wanted: float, measured: float) -> float:
    """Error of a controlled axis; an axis without setpoint has none."""
    return 0.0 if math.isnan(wanted) else wanted - measured
