"""Proves, by the form of the drift, that gyroscopes which agree have all jumped alike.

Gyroscopes that agree are believed against a receiver or a compass (`gyro_bias_jump`), until the
velocities of the last four seconds leave no other cause. A jump w of the rate about the roll or
pitch axis at t0 tilts the estimate by w (t - t0). Under thrust of about 1 g the horizontal velocity
by GPS is then that by the inertial sensors alone, and in a fixed direction

    g w (t - t0)^2 / 2    from t0 on                                          (1)

t0 is searched, w follows by least squares. The measurements that the filter has fused meanwhile
have turned the attitude by small angles c (`ErrorStateEkf.turned_ned`); their effect, the integral
of g (-c_east, c_north), is taken out before. Every other cause is fitted as well:

    a constant tilt or accelerometer bias    a difference that grows linearly
    an accelerometer bias that jumps         the same from some time on
    a heading that is wrong, by any angle    the inertial velocity, turned
    a receiver that is late                  the inertial velocity of earlier

The second only where the lateral force has stepped (`lateral_force`): it resembles (1) at first.
The jump is proved when what (1) leaves is no more than noise, and what each of the others leaves is
several times that, for some fixes on end; a test of likelihood ratios (A. S. Willsky and H. L.
Jones, IEEE Trans. Automatic Control 21, 1976). A velocity of the receiver that drifts by itself is
contradicted by its position. A receiver whose velocity and position drift in agreement and in the
form of (1) is not distinguished.
"""

import math
from collections import deque
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.modules.estimator.fault_detection.heading_by_course import Pair
from uav_firmware.modules.estimator.kalman_filter.gate import RECEIVER_GAP_US
from uav_firmware.msg.vectors import Vector3

_WINDOW_S: Final = 4.0
_LATEST_S: Final = 2.5  # By which a receiver is thought to be late at most
_LATER_BY_S: Final = 0.1
_ONSETS_S: Final = np.arange(-8.0, -0.9, 0.25)  # Of the jump, before the last fix
_LEAST_M_S: Final = 1.0  # Of the difference: less harms nothing
_NOISE_M_S: Final = 0.05  # What is left by (1) counts as that at least
_LARGEST_REST_M_S: Final = 0.25  # That (1) may leave, root mean square
_TIMES: Final = 2.5  # [-] What the others leave, over what (1) leaves
_CONTRADICTION: Final = 0.2  # [-] Of the difference; one that the velocity feigns has a third
_ON_END: Final = 3  # [fixes]

_Floats = NDArray[np.float64]
_Velocities = NDArray[np.complex128]  # [m/s] North as the real part, east as the imaginary one


class CommonJump(NamedTuple):
    """A jump that several gyroscopes show alike."""

    rate: float  # [rad/s]
    since_s: float


class _Fix(NamedTuple):
    """A fix, in the order of the equations."""

    time_us: int
    inertial: complex  # [m/s]
    gps: complex  # [m/s]
    turned: complex  # [rad] About north and east, by what the filter has fused


class CommonJumpProof:
    """Compares both velocities of the last seconds."""

    def __init__(self) -> None:
        self._fixes: deque[_Fix] = deque()
        self._on_end = 0

    def restart(self) -> None:
        """Forget: the attitude has been changed, or the vehicle has been struck."""
        self._fixes.clear()
        self._on_end = 0

    def update(
        self,
        pair: Pair,
        turned_ned: Vector3,
        contradiction_m_s: float,
        doubt_m_s: float,
        *,
        force_stepped: bool,
    ) -> CommonJump | None:
        """Add a fix; the jump, once it is proved.

        Args:
            pair: both velocities.
            turned_ned: Angles [rad] by which the filter has turned the attitude, since any time.
            contradiction_m_s: by which the position of the receiver runs away from its velocity.
            doubt_m_s: difference that the scale errors of the gyroscopes may explain.
            force_stepped: The bias of the accelerometers may have jumped.
        """
        fixes = self._fixes
        if fixes and not 0 < pair.time_us - fixes[-1].time_us <= RECEIVER_GAP_US:
            self.restart()
        fixes.append(
            _Fix(
                pair.time_us,
                complex(pair.inertial_north, pair.inertial_east),
                complex(pair.gps_north, pair.gps_east),
                complex(turned_ned[0], turned_ned[1]),
            )
        )
        while pair.time_us - fixes[0].time_us > (_WINDOW_S + _LATEST_S) * 1e6:
            fixes.popleft()
        least_m_s = max(_LEAST_M_S + doubt_m_s, contradiction_m_s / _CONTRADICTION)
        jump = _jump_of(list(fixes), least_m_s, force_stepped=force_stepped)
        self._on_end = 0 if jump is None else self._on_end + 1
        if self._on_end < _ON_END:
            return None
        self.restart()
        return jump


def _jump_of(fixes: list[_Fix], least_m_s: float, *, force_stepped: bool) -> CommonJump | None:
    """The jump that alone explains a difference of `least_m_s`; None where something else may."""
    last_us = fixes[-1].time_us
    begin = next(i for i, fix in enumerate(fixes) if last_us - fix.time_us <= _WINDOW_S * 1e6)
    first, last = fixes[begin], fixes[-1]
    if (last_us - first.time_us) * 1e-6 < _WINDOW_S - RECEIVER_GAP_US * 1e-6:
        return None
    difference_m_s = abs((last.gps - last.inertial) - (first.gps - first.inertial))
    if difference_m_s < least_m_s:
        return None  # The usual case
    all_times: _Floats = np.array([(fix.time_us - last_us) * 1e-6 for fix in fixes])
    all_inertial: _Velocities = np.array([fix.inertial for fix in fixes])
    gps: _Velocities = np.array([fix.gps for fix in fixes[begin:]])
    turned: _Velocities = np.array([fix.turned - first.turned for fix in fixes[begin:]])
    times, inertial = all_times[begin:], all_inertial[begin:]
    apart = gps - inertial + _effect_of(turned, times)
    rest, slope, onset_s = min(
        (*_fit(apart, np.maximum(times - onset_s, 0.0) ** 2), float(onset_s))
        for onset_s in _ONSETS_S
    )
    others = [
        _fit(apart, times)[0],
        _rest_of_turn(inertial, gps),
        _rest_of_delay(all_inertial, gps, all_times, times),
    ]
    if force_stepped:
        steps_s = _ONSETS_S[times[0] < _ONSETS_S]
        others += [_fit(apart, np.maximum(times - step_s, 0.0))[0] for step_s in steps_s]
    if rest > _LARGEST_REST_M_S or min(others) < _TIMES * max(rest, _NOISE_M_S):
        return None
    return CommonJump(2.0 * slope / STANDARD_GRAVITY_M_S2, -onset_s)


def _effect_of(turned: _Velocities, times: _Floats) -> _Velocities:
    """Velocity [m/s] that the turns by the filter have added to the inertial one."""
    force = 1j * STANDARD_GRAVITY_M_S2 * turned
    steps = 0.5 * (force[1:] + force[:-1]) * np.diff(times)
    effect: _Velocities = np.concatenate([[0.0], np.cumsum(steps)])
    return effect


def _fit(values: _Velocities, course: _Floats) -> tuple[float, float]:
    """What a multiple of a course and a constant leave [m/s, RMS], and the size of the multiple."""
    values, course = values - values.mean(), course - course.mean()
    multiple = (values * course).sum() / (course * course).sum()
    return _rms(values - multiple * course), float(abs(multiple))


def _rest_of_turn(inertial: _Velocities, gps: _Velocities) -> float:
    """What the inertial velocity leaves, turned by the best angle [m/s, RMS]."""
    inertial, gps = inertial - inertial.mean(), gps - gps.mean()
    along = (inertial.conj() * gps).sum()
    turn = along / max(abs(along), 1e-9)
    return _rms(gps - turn * inertial)


def _rest_of_delay(
    all_inertial: _Velocities, gps: _Velocities, all_times: _Floats, times: _Floats
) -> float:
    """What the inertial velocity leaves, of the best time before [m/s, RMS]."""
    longest_s = times[0] - all_times[0]
    rests = []
    for late_s in np.arange(_LATER_BY_S, longest_s + 1e-6, _LATER_BY_S):
        rest = gps - np.interp(times - late_s, all_times, all_inertial)
        rests.append(_rms(rest - rest.mean()))
    return min(rests, default=math.inf)


def _rms(values: _Velocities) -> float:
    return math.sqrt(float(np.mean(np.abs(values) ** 2)))
