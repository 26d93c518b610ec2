"""GPS at work: it gives the origin, then position and velocity, and has the last word."""

import math
from typing import Final

from uav_firmware.modules.estimator.accel_watch import VerticalWatch
from uav_firmware.modules.estimator.alignment import OriginAverage
from uav_firmware.modules.estimator.bias_watch import VelocityWatch
from uav_firmware.modules.estimator.core import RESET_AFTER_S, Core
from uav_firmware.modules.estimator.delay import Past
from uav_firmware.modules.estimator.ekf import Measurement
from uav_firmware.modules.estimator.fuse_gps import (
    GpsRequirements,
    is_good,
    position_measurements,
    velocity_measurements,
)
from uav_firmware.modules.estimator.gate import Aid
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.modules.estimator.state import BARO_BIAS, DOWN, GPS_HEIGHT_BIAS, VELOCITY
from uav_firmware.msg.sensors import SensorGps
from uav_firmware.msg.vectors import Vector3

_HORIZONTAL: Final = slice(0, 2)
_SQRT_2: Final = math.sqrt(2.0)  # Two errors of height, now and at the origin, are apart by this
_WHITE_SHARE: Final = 0.4  # Of the error of height: what changes from fix to fix


class GpsAiding:
    """Three aids in one receiver, gated apart: a bad altitude does not cost the rest."""

    def __init__(self, params: EstimatorParams) -> None:
        self.horizontal = Aid(params.gps_position_gate)
        self.vertical = Aid(params.gps_position_gate)
        self.velocity = Aid(params.gps_velocity_gate)
        self._origin = OriginAverage(params.origin_time)
        self._watch = VelocityWatch()
        self._vertical_watch = VerticalWatch()
        self._last_us = -1
        self._last: tuple[float, float, float, Vector3] | None = None
        self.accuracy_m = (math.nan, math.nan)  # Horizontal, vertical of the last fix used
        self.configure(params)

    def configure(self, params: EstimatorParams) -> None:
        """Work with changed parameters from now on."""
        self._params = params
        self.horizontal.gate = self.vertical.gate = params.gps_position_gate
        self.velocity.gate = params.gps_velocity_gate
        self._required = GpsRequirements(
            satellites=params.required_satellites,
            horizontal_accuracy_m=params.required_horizontal_accuracy,
            vertical_accuracy_m=params.required_vertical_accuracy,
            speed_accuracy_m_s=params.required_speed_accuracy,
        )

    def take(self, core: Core, gps: SensorGps) -> None:
        """Use a fix, if it is good, new and of a time that is remembered."""
        if not is_good(gps, self._required):
            self._origin.restart()
            return
        if gps.time_us <= self._last_us or core.recall(gps.time_us) is None:
            return
        self._last_us = gps.time_us
        if self._repeats(gps) and not core.standing:
            return
        self.accuracy_m = (gps.horizontal_accuracy_m, gps.vertical_accuracy_m)
        if core.origin is None:
            self._find_origin(core, gps)
        else:
            self._fuse_velocity(core, gps)
            fix = core.origin.to_ned(gps.latitude_deg, gps.longitude_deg, gps.altitude_amsl_m)
            self._fuse_position(core, gps, fix)
            self._fuse_height(core, gps, fix)

    def _repeats(self, gps: SensorGps) -> bool:
        """Whether a fix says in every digit what the one before said.

        Noise forbids that: the receiver is stuck, and what it repeats is no measurement of a
        vehicle that moves.
        """
        former = self._last
        self._last = (gps.latitude_deg, gps.longitude_deg, gps.altitude_amsl_m, gps.velocity_ned)
        return self._last == former

    def _find_origin(self, core: Core, gps: SensorGps) -> None:
        """Average fixes while the vehicle stands still; then the estimate begins."""
        if not core.rest.at_rest:
            self._origin.restart()
            return
        place = self._origin.add(gps)
        if place is None:
            return
        core.set_origin(*place)
        shrink = self._origin.count**-0.5
        core.ekf.forget(_HORIZONTAL, shrink * self._horizontal_sigma(gps))
        core.ekf.forget(DOWN, shrink * self._vertical_sigma(gps))
        core.state.gps_height_bias_m = 0.0
        core.ekf.forget(GPS_HEIGHT_BIAS, shrink * self._vertical_sigma(gps))
        for aid in (self.horizontal, self.vertical, self.velocity):
            aid.accept(core.time_us)

    def _fuse_velocity(self, core: Core, gps: SensorGps) -> None:
        past = _recalled(core, gps)
        sigma = max(gps.speed_accuracy_m_s, self._params.gps_velocity_noise)
        group = velocity_measurements(past, gps.velocity_ned, sigma)
        self._watch.look(core, group)
        self._vertical_watch.look(core, group)
        if self._is_stale(core) or (
            not self.velocity.fuse(core.ekf, group, core.time_us)
            and self.velocity.rejected_s(core.time_us) > RESET_AFTER_S
        ):
            state = core.state
            shift = [m.innovation for m in group]
            state.velocity_ned = _shifted(state.velocity_ned, shift)
            core.ekf.forget(VELOCITY, sigma)
            self.velocity.accept(core.time_us)

    def _fuse_position(self, core: Core, gps: SensorGps, fix_ned: Vector3) -> None:
        sigma, now_us = self._horizontal_sigma(gps), core.time_us
        north, east, _ = group = self._position_group(core, gps, fix_ned)
        if self._is_stale(core) or (
            not self.horizontal.fuse(core.ekf, group[:2], now_us)
            and self.horizontal.rejected_s(now_us) > RESET_AFTER_S
        ):
            shift = [north.innovation, east.innovation, 0.0]
            core.state.position_ned = _shifted(core.state.position_ned, shift)
            core.ekf.forget(_HORIZONTAL, sigma)
            self.horizontal.accept(now_us)

    def _fuse_height(self, core: Core, gps: SensorGps, fix_ned: Vector3) -> None:
        sigma, now_us = self._vertical_sigma(gps), core.time_us
        core.expect_gps_height_error(_SQRT_2 * sigma)
        group = self._position_group(core, gps, fix_ned)[2:]
        if (
            not self.vertical.fuse(core.ekf, group, now_us)
            and self.vertical.rejected_s(now_us) > RESET_AFTER_S
        ):
            _reset_height(core, group[0].innovation, sigma)
            self.vertical.accept(now_us)

    def _position_group(
        self, core: Core, gps: SensorGps, fix_ned: Vector3
    ) -> tuple[Measurement, Measurement, Measurement]:
        return position_measurements(
            _recalled(core, gps),
            fix_ned,
            core.state.gps_height_bias_m,
            self._horizontal_sigma(gps),
            max(_WHITE_SHARE * gps.vertical_accuracy_m, self._params.gps_position_noise),
        )

    def _is_stale(self, core: Core) -> bool:
        """Whether the dead reckoning has gone on for too long to argue with a good fix."""
        return self.horizontal.age_s(core.time_us) * 1e6 > self._params.no_aid_timeout_us

    def _horizontal_sigma(self, gps: SensorGps) -> float:
        return max(gps.horizontal_accuracy_m, self._params.gps_position_noise)

    def _vertical_sigma(self, gps: SensorGps) -> float:
        return max(gps.vertical_accuracy_m, self._params.gps_position_noise)


def _recalled(core: Core, gps: SensorGps) -> Past:
    """The present belief about the time of a fix whose time is known to be kept."""
    past = core.recall(gps.time_us)
    if past is None:
        raise ValueError(f"time_us: {gps.time_us} is not in the history")
    return past


def _shifted(vector: Vector3, shift: list[float]) -> Vector3:
    return (vector[0] + shift[0], vector[1] + shift[1], vector[2] + shift[2])


def _reset_height(core: Core, shift_down: float, sigma: float) -> None:
    """Move the height to that of GPS, free of bias, and let the barometer's bias go along."""
    state = core.state
    shift_down -= state.gps_height_bias_m
    state.gps_height_bias_m = 0.0
    core.ekf.forget(GPS_HEIGHT_BIAS, sigma)
    state.position_ned = _shifted(state.position_ned, [0.0, 0.0, shift_down])
    state.baro_bias_m += shift_down
    core.ekf.forget(DOWN, sigma)
    core.ekf.forget(BARO_BIAS, sigma)
