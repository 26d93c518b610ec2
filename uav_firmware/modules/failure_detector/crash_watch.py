"""Detects that an armed vehicle lies on the ground or tumbles while its motors run: pure.

    signs of a vehicle at rest       why no multicopter in flight shows them
    off_axis    specific force       in flight it points along the rotors' axis, whatever the tilt
    crippled    two motors failed    it cannot hover on two of four
    blind       gyroscope silent     it cannot hover without body rates

At rest means that the body rates are near zero and that the specific force is steady and as large
as gravity, of the two whatever is still measured; it has to hold for REST_TIME_S. These signs
read the inertial sensor alone, since the estimate of a vehicle that has just hit the ground is
wrong for a while. Three more hold without rest:

    adrift      the thrust axis is ERROR_MAX beside its set-point, and the vehicle does not
                accelerate, for ADRIFT_TIME_S: ArduCopter's crash check
    silent      neither gyroscope nor accelerometer delivers a number, for SILENT_TIME_S

What was found stays found until `reset`.
"""

import math
from typing import Final, NamedTuple

from uav_firmware.msg.vectors import Vector3

REST_TIME_S: Final = 0.8
ADRIFT_TIME_S: Final = 2.0
SILENT_TIME_S: Final = 2.0
ERROR_MAX: Final = math.radians(30.0)
_OFF_AXIS_COSINE: Final = math.cos(math.radians(45.0))
_STILL_RATE: Final = 0.35  # [rad/s] Each axis
_STEADY: Final = 1.5  # [m/s^2] Off the average
_WEIGHT_MARGIN: Final = 2.0  # [m/s^2] Off gravity
_NOT_ACCELERATING: Final = 3.0  # [m/s^2] ArduCopter's CRASH_CHECK_ACCEL_MAX
_AVERAGE_TIME_S: Final = 0.2
_GRAVITY: Final = 9.80665  # [m/s^2]


class Moment(NamedTuple):
    """What the watch looks at; NaN where a sensor delivers none."""

    rate_frd: Vector3  # [rad/s] Of the gyroscope
    specific_force_frd: Vector3  # [m/s^2] Of the accelerometer
    thrust_axis_error: float  # [rad] Between thrust axis and set-point; NaN where there is none
    failed_motors: int  # [-] How many


class CrashWatch:
    """How long each sign has held."""

    __slots__ = ("_adrift_s", "_average", "_rest_s", "_silent_s", "cause")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget what was found and what was averaged."""
        self.cause = ""
        self._average: Vector3 | None = None
        self._rest_s = self._adrift_s = self._silent_s = 0.0

    def update(self, seen: Moment, dt: float) -> str:
        """Words for the operator once the vehicle has crashed, empty before."""
        turning = _size(seen.rate_frd)
        force = _size(seen.specific_force_frd)
        blind, unweighed = math.isnan(turning), math.isnan(force)
        steady = unweighed or self._is_steady(seen.specific_force_frd, dt)
        weight = unweighed or abs(force - _GRAVITY) < _WEIGHT_MARGIN
        still = blind or turning < _STILL_RATE
        at_rest = still and steady and weight and not (blind and unweighed)
        reason = self._impossible_in_flight(seen, blind=blind) if at_rest else ""
        self._rest_s = self._rest_s + dt if reason else 0.0
        adrift = seen.thrust_axis_error > ERROR_MAX and (
            unweighed or abs(force - _GRAVITY) < _NOT_ACCELERATING
        )
        self._adrift_s = self._adrift_s + dt if adrift else 0.0
        self._silent_s = self._silent_s + dt if blind and unweighed else 0.0
        if self.cause:
            return self.cause
        if self._rest_s >= REST_TIME_S:
            self.cause = reason
        elif self._adrift_s >= ADRIFT_TIME_S:
            self.cause = f"attitude off by {math.degrees(seen.thrust_axis_error):.0f} degrees"
        elif self._silent_s >= SILENT_TIME_S:
            self.cause = "no inertial sensor"
        return self.cause

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


def _size(vector: Vector3) -> float:
    return math.hypot(vector[0], vector[1], vector[2])
