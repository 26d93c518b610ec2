"""Satellite receiver: a solution at 10 Hz, handed over 120 ms after its time of validity.

Position error = two correlated errors + white noise, north, east and down apart; velocity error is
white. How large they are depends on the receiver (`sim/gnss_receivers.py`).

The latency is what PX4 assumes of a serial receiver (EKF2_GPS_DELAY, 110 ms) and a little.
After power-up the receiver searches for three seconds and says so with fix type 1.
"""

import math
from collections import deque
from typing import Final

import numpy as np

from sim.gnss_receivers import GnssReceiver, PerAxis
from sim.physics.earth import degrees_per_metre, wrapped_longitude_deg
from sim.physics.noise import GaussMarkov, standard_normals
from sim.physics.truth import Truth
from sim.sensors.geoid import geoid_height_m
from sim.sensors.readings import GpsReading

RATE_HZ: Final = 10
DELAY_US: Final = 120_000
FIRST_FIX_US: Final = 3_000_000

_SMALLEST_ACCURACY: Final = 0.01  # [m, m/s] A receiver never claims to be perfect

_NO_DELIVERY_US: Final = 1 << 62  # [us] Later than any flight
_FIX_NONE: Final = 1
_SATELLITES: Final = 18
_HDOP: Final = 0.7
_VDOP: Final = 1.1
_DOP_UNKNOWN: Final = 99.99


def radial(*sigmas: float) -> float:
    """Standard deviation of the length of a vector with independent components."""
    return math.sqrt(sum((sigma * sigma for sigma in sigmas), 0.0))


class Gps:
    """`factor` scales every error of the receiver and the accuracies that are reported with it."""

    def __init__(
        self,
        generator: np.random.Generator,
        receiver: GnssReceiver,
        *,
        factor: float,
        start_time_utc_us: int,
    ) -> None:
        self._normals = standard_normals(generator)
        self._start_time_utc_us = start_time_utc_us
        self._slow = self._processes(receiver.slow_sigma_ned_m, receiver.slow_time_s, factor)
        self._multipath = self._processes(
            receiver.multipath_sigma_ned_m, receiver.multipath_time_s, factor
        )
        self._white = tuple(sigma * factor for sigma in receiver.white_sigma_ned_m)
        self._velocity = tuple(sigma * factor for sigma in receiver.velocity_sigma_ned_m_s)
        self._accuracies = _reported_accuracies(receiver, factor)
        self._fix_type = receiver.fix_type
        self._pending: deque[GpsReading] = deque()

    def _processes(
        self, sigmas_m: PerAxis, correlation_time_s: float, factor: float
    ) -> tuple[GaussMarkov, ...]:
        return tuple(
            GaussMarkov(
                self._normals,
                sigma=sigma * factor,
                correlation_time_s=correlation_time_s,
                step_s=1.0 / RATE_HZ,
            )
            for sigma in sigmas_m
        )

    def measure(self, truth: Truth) -> None:
        """Compute a solution for this instant; `deliver` returns it later."""
        if truth.time_us < FIRST_FIX_US:
            self._pending.append(without_fix(truth.time_us))
        else:
            self._pending.append(self._solution(truth))

    @property
    def delivery_us(self) -> int:
        """Time at which the next delayed solution is due [us]; far in the future if none is."""
        pending = self._pending
        return pending[0].time_us + DELAY_US if pending else _NO_DELIVERY_US

    def deliver(self, time_us: int) -> GpsReading | None:
        """The solution whose latency has passed at `time_us`, if there is one."""
        if self._pending and self._pending[0].time_us + DELAY_US <= time_us:
            return self._pending.popleft()
        return None

    def _solution(self, truth: Truth) -> GpsReading:
        north, east, down = (
            slow.step() + multipath.step() + sigma * next(self._normals)
            for slow, multipath, sigma in zip(self._slow, self._multipath, self._white, strict=True)
        )
        velocity_north, velocity_east, velocity_down = (
            component + sigma * next(self._normals)
            for component, sigma in zip(truth.velocity_ned, self._velocity, strict=True)
        )
        metre = degrees_per_metre(truth.latitude_deg, truth.altitude_amsl_m)
        horizontal_m, vertical_m, speed_m_s = self._accuracies
        return GpsReading(
            time_us=truth.time_us,
            time_utc_us=self._start_time_utc_us + truth.time_us,
            latitude_deg=truth.latitude_deg + north * metre.north,
            longitude_deg=wrapped_longitude_deg(truth.longitude_deg + east * metre.east),
            altitude_amsl_m=truth.altitude_amsl_m - down,
            velocity_ned=(velocity_north, velocity_east, velocity_down),
            horizontal_accuracy_m=horizontal_m,
            vertical_accuracy_m=vertical_m,
            speed_accuracy_m_s=speed_m_s,
            fix_type=self._fix_type,
            satellites_used=_SATELLITES,
            hdop=_HDOP,
            vdop=_VDOP,
            geoid_height_m=geoid_height_m(truth.latitude_deg, truth.longitude_deg),
        )


def without_fix(time_us: int) -> GpsReading:
    """What a receiver says that sees no satellites."""
    return GpsReading(
        time_us=time_us,
        time_utc_us=0,
        latitude_deg=0.0,
        longitude_deg=0.0,
        altitude_amsl_m=0.0,
        velocity_ned=(0.0, 0.0, 0.0),
        horizontal_accuracy_m=_DOP_UNKNOWN,
        vertical_accuracy_m=_DOP_UNKNOWN,
        speed_accuracy_m_s=_DOP_UNKNOWN,
        fix_type=_FIX_NONE,
        satellites_used=0,
        hdop=_DOP_UNKNOWN,
        vdop=_DOP_UNKNOWN,
    )


def _reported_accuracies(receiver: GnssReceiver, factor: float) -> tuple[float, float, float]:
    """Horizontal [m], vertical [m] and speed [m/s] accuracy: the true sigmas, no better."""
    north, east, down = receiver.position_sigma_ned_m
    return (
        max(_SMALLEST_ACCURACY, factor * radial(north, east)),
        max(_SMALLEST_ACCURACY, factor * down),
        max(_SMALLEST_ACCURACY, factor * radial(*receiver.velocity_sigma_ned_m_s)),
    )
