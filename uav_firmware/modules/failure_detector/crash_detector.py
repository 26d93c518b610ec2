"""Detects that an armed vehicle lies on the ground or tumbles while its motors run: pure.

    signs of a vehicle at rest       why no multicopter in flight shows them
    off_axis    specific force       in flight it points along the rotors' axis, whatever the tilt
    crippled    two motors failed    it cannot hover on two of four
    blind       gyroscope silent     it cannot hover without body rates

At rest means that the body rates are near zero and that the specific force is steady and as large
as gravity, of the two whatever is still measured; it has to hold for REST_TIME_S. These signs
read the inertial sensor alone, since the estimate of a vehicle that has just hit the ground is
wrong for a while. Three more hold without rest:

    adrift      the thrust axis is ERROR_MAX beside its setpoint, and the vehicle does not
                accelerate, for ADRIFT_TIME_S: ArduCopter's crash check
    silent      neither gyroscope nor accelerometer delivers a number, for SILENT_TIME_S
    stands      the thrust is far below what has carried the vehicle, and the pressure shows that it
                does not fall, for STANDS_TIME_S: something else carries it. Asks neither inertial
                sensor nor estimate, of which one may be the reason why it was not seen to land

A vehicle whose motors are stopped in the air falls: `FallDetector`, while it is disarmed.

A detected crash stays detected until `reset`. An impact (`ImpactDetector`) is no crash by itself,
but with two stopped rotors it is.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.msg.vectors import Vector3

REST_TIME_S: Final = 0.8
ADRIFT_TIME_S: Final = 2.0
SILENT_TIME_S: Final = 2.0
STANDS_TIME_S: Final = 3.0
ERROR_MAX: Final = math.radians(30.0)
_OFF_AXIS_COSINE: Final = math.cos(math.radians(45.0))
_STILL_RATE: Final = 0.35  # [rad/s] Each axis
_STEADY: Final = 1.5  # [m/s^2] Off the average
_WEIGHT_MARGIN: Final = 2.0  # [m/s^2] Off gravity
_NOT_ACCELERATING: Final = 3.0  # [m/s^2] ArduCopter's CRASH_CHECK_ACCEL_MAX
_AVERAGE_TIME_S: Final = 0.2
_LOW_THRUST: Final = 0.6  # [-] Of what carries: it would have fallen by 17 m
_STAYS_M: Final = 2.0  # Pressure of gusts included
_BLOW_M_S2: Final = 15.0  # Between two looks; rotors take six times as long for it
_BLOW_RAD_S: Final = 2.0
_STRUCK_S: Final = 1.0
FALL_TIME_S: Final = 0.3  # Rotors that run down included, a fall of 0.5 to 1 m
FALLS_WITHIN_S: Final = 5.0  # Later it is carried, not flown
_FALLING: Final = 3.0  # [m/s^2] A body in free fall feels its drag alone


class Moment(NamedTuple):
    """Inputs of the detector; NaN where a sensor delivers none."""

    rate_frd: Vector3  # [rad/s] Of the gyroscope
    specific_force_frd: Vector3  # [m/s^2] Of the accelerometer
    thrust_axis_error: float  # [rad] Between thrust axis and setpoint; NaN where there is none
    failed_motors: int  # [-] How many
    thrust_share: float = math.nan  # [-] Commanded, of what carries; NaN on the ground, or unknown
    height_m: float = math.nan  # By pressure, above anything


class CrashDetector:
    """How long each sign has held."""

    __slots__ = ("_adrift_s", "_average", "_height_m", "_rest_s", "_silent_s", "_stands_s", "cause")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget what was found and what was averaged."""
        self.cause = ""
        self._average: Vector3 | None = None
        self._rest_s = self._adrift_s = self._silent_s = self._stands_s = 0.0
        self._height_m = math.nan  # Since when the thrust is low

    def update(self, seen: Moment, dt: float) -> str:
        """Text for the operator once the vehicle has crashed, empty before."""
        turning = _size(seen.rate_frd)
        force = _size(seen.specific_force_frd)
        blind, unweighed = math.isnan(turning), math.isnan(force)
        steady = unweighed or self._is_steady(seen.specific_force_frd, dt)
        weight = unweighed or abs(force - STANDARD_GRAVITY_M_S2) < _WEIGHT_MARGIN
        still = blind or turning < _STILL_RATE
        at_rest = still and steady and weight and not (blind and unweighed)
        reason = self._impossible_in_flight(seen, blind=blind) if at_rest else ""
        self._rest_s = self._rest_s + dt if reason else 0.0
        adrift = seen.thrust_axis_error > ERROR_MAX and (
            unweighed or abs(force - STANDARD_GRAVITY_M_S2) < _NOT_ACCELERATING
        )
        self._adrift_s = self._adrift_s + dt if adrift else 0.0
        self._silent_s = self._silent_s + dt if blind and unweighed else 0.0
        self._stands_s = self._stands_s + dt if self._stays_without_thrust(seen) else 0.0
        if self.cause:
            return self.cause
        if self._rest_s >= REST_TIME_S:
            self.cause = reason
        elif self._adrift_s >= ADRIFT_TIME_S:
            self.cause = f"attitude off by {math.degrees(seen.thrust_axis_error):.0f} degrees"
        elif self._silent_s >= SILENT_TIME_S:
            self.cause = "no inertial sensor"
        elif self._stands_s >= STANDS_TIME_S:
            self.cause = "stands, and was not seen to land"
        return self.cause

    def _stays_without_thrust(self, seen: Moment) -> bool:
        """Whether the thrust is too low to fly, and the height is still what it was then."""
        if not seen.thrust_share < _LOW_THRUST:  # NaN compares false
            self._height_m = math.nan
            return False
        if abs(seen.height_m - self._height_m) < _STAYS_M:
            return True
        self._height_m = seen.height_m
        return False

    def _is_steady(self, force: Vector3, dt: float) -> bool:
        """Whether the specific force is that of the last tenths of a second."""
        former = force if self._average is None else self._average
        share = dt / (dt + _AVERAGE_TIME_S)
        beside = (force[0] - former[0], force[1] - former[1], force[2] - former[2])
        self._average = (
            former[0] + share * beside[0],
            former[1] + share * beside[1],
            former[2] + share * beside[2],
        )
        return math.hypot(*beside) < _STEADY

    def _impossible_in_flight(self, seen: Moment, *, blind: bool) -> str:
        """Why a vehicle at rest cannot be hovering; empty when it may."""
        average = self._average
        if average is not None and -average[2] < _OFF_AXIS_COSINE * math.hypot(*average):
            return "lies on its side or back"
        if seen.failed_motors > 1:
            return "at rest with motors failed"
        return "at rest without gyroscope" if blind else ""


class ImpactDetector:
    """Detects a blow by the inertial sensor: a change that neither rotors nor air can make."""

    __slots__ = ("_force", "_left_s", "_rate")

    def __init__(self) -> None:
        self._rate = self._force = (math.nan, math.nan, math.nan)
        self._left_s = 0.0

    def update(self, rate_frd: Vector3, force_frd: Vector3, dt: float) -> bool:
        """Look some hundred times a second; whether the last blow was within a second."""
        turn, push = math.dist(rate_frd, self._rate), math.dist(force_frd, self._force)
        self._rate, self._force = rate_frd, force_frd
        if turn > _BLOW_RAD_S or push > _BLOW_M_S2:  # NaN compares false
            self._left_s = _STRUCK_S
        else:
            self._left_s = max(0.0, self._left_s - dt)
        return self._left_s > 0.0


class FallDetector:
    """Detects, by the accelerometer, that a vehicle falls after it was disarmed in the air.

    Who disarms a vehicle in the moment in which it touches down has not dropped it.
    """

    __slots__ = ("_falling_s", "_since_s", "_was_flying")

    def __init__(self) -> None:
        self._was_flying = False
        self._falling_s = self._since_s = 0.0

    def note_armed(self, *, in_air: bool) -> None:
        """Note where an armed vehicle is."""
        self._was_flying = in_air
        self._falling_s = self._since_s = 0.0

    def update(self, force_frd: Vector3, dt: float) -> bool:
        """Look at a disarmed vehicle; whether it has fallen."""
        if not self._was_flying:
            return False
        self._since_s += dt
        self._falling_s = self._falling_s + dt if _size(force_frd) < _FALLING else 0.0
        has_fallen = self._falling_s >= FALL_TIME_S
        if has_fallen or self._since_s > FALLS_WITHIN_S:
            self._was_flying = False
        return has_fallen


def _size(vector: Vector3) -> float:
    return math.hypot(vector[0], vector[1], vector[2])
