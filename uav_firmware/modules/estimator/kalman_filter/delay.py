"""Measurements that arrive late, taken back to the time when they were valid.

The state at an earlier time t follows from the present one by undoing the inertial increments
in between: with W the running sum of velocity changes and S the integral of W,

    v(t) = v - (W - W(t))
    p(t) = p - tau v(t) - [(S - S(t)) - tau W(t)],        tau the delay.

Only W and S are kept, never past states: a correction applied meanwhile is thereby in the
earlier state as well, at no cost, exactly as if it had been carried back. The error of the
earlier state follows from the present error by the inverse transition, which the measurement's
Jacobian holds (see `gnss_fusion`). What is left out is the noise of the inertial sensors during
the delay, for 0.2 s a few millimetres per second. Against a filter that runs delayed and a
predictor in front of it (PX4's EKF2), this needs one integration instead of two and no tuning.
"""

from bisect import bisect_left
from collections import deque
from operator import attrgetter
from typing import Final, NamedTuple

from farm_flight_bridge.native import mypyc_attr
from uav_firmware.lib.rotation import rotate_by_yaw
from uav_firmware.modules.estimator.kalman_filter.state import NominalState
from uav_firmware.msg.vectors import Quaternion, Vector3


@mypyc_attr(acyclic=True, free_list_len=1)
class _Entry:
    """The sums at the time of a sample."""

    __slots__ = ("s", "time_us", "w")

    def __init__(self, time_us: int, w: Vector3, s: Vector3) -> None:
        self.time_us: Final = time_us
        self.w: Final = w  # [m/s]
        self.s: Final = s  # [m]


_time_of: Final = attrgetter("time_us")


class Past(NamedTuple):
    """The state as it was `delay_s` ago, by present knowledge."""

    delay_s: float  # [s]
    position_ned: Vector3  # [m]
    velocity_ned: Vector3  # [m/s]
    impulse_ned: Vector3  # [m/s] Integral of the specific force since then
    q_ned_frd: Quaternion  # [-] Present attitude, which stands for that of the interval


class InertialHistory:
    """The increments of the last second or so."""

    def __init__(self, start_us: int, length: int) -> None:
        self._entries: deque[_Entry] = deque(maxlen=length)
        self._entries.append(_Entry(start_us, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))

    def push(self, time_us: int, change_ned: Vector3, dt: float) -> None:
        """Add the change of velocity [m/s] over the dt [s] that ended at `time_us`."""
        last = self._entries[-1]
        wx, wy, wz = last.w
        sx, sy, sz = last.s
        cx, cy, cz = change_ned
        self._entries.append(
            _Entry(
                time_us,
                (wx + cx, wy + cy, wz + cz),
                (
                    sx + dt * (wx + 0.5 * cx),
                    sy + dt * (wy + 0.5 * cy),
                    sz + dt * (wz + 0.5 * cz),
                ),
            )
        )

    def turn(self, angle: float) -> None:
        """Turn what is kept by an angle [rad] about the vertical, as the estimate was."""
        turned = [
            _Entry(entry.time_us, _turned(entry.w, angle), _turned(entry.s, angle))
            for entry in self._entries
        ]
        self._entries.clear()
        self._entries.extend(turned)

    def recall(self, state: NominalState, time_us: int, gravity: float) -> Past | None:
        """The state at `time_us`; None if that is in the future or longer ago than is kept."""
        last = self._entries[-1]
        now_us, now_w, now_s = last.time_us, last.w, last.s
        if not self._entries[0].time_us <= time_us <= now_us:
            return None
        w, s = self._at(time_us)
        wx, wy, wz = w
        sx, sy, sz = s
        tau = (now_us - time_us) * 1e-6
        cx, cy, cz = now_w[0] - wx, now_w[1] - wy, now_w[2] - wz
        vx, vy, vz = state.velocity_ned
        vx, vy, vz = vx - cx, vy - cy, vz - cz
        px, py, pz = state.position_ned
        return Past(
            tau,
            (
                px - tau * vx - (now_s[0] - sx - tau * wx),
                py - tau * vy - (now_s[1] - sy - tau * wy),
                pz - tau * vz - (now_s[2] - sz - tau * wz),
            ),
            (vx, vy, vz),
            (cx, cy, cz - gravity * tau),
            state.q_ned_frd,
        )

    def _at(self, time_us: int) -> tuple[Vector3, Vector3]:
        """Both sums at a time, linear between two samples."""
        entries = self._entries
        index = bisect_left(entries, time_us, key=_time_of)
        after = entries[index]
        if after.time_us == time_us:
            return after.w, after.s
        before = entries[index - 1]
        share = (time_us - before.time_us) / (after.time_us - before.time_us)
        return _between(before.w, after.w, share), _between(before.s, after.s, share)


def _turned(vector: Vector3, angle: float) -> Vector3:
    north, east, down = vector
    return (*rotate_by_yaw(north, east, angle), down)


def _between(first: Vector3, second: Vector3, share: float) -> Vector3:
    return (
        first[0] + share * (second[0] - first[0]),
        first[1] + share * (second[1] - first[1]),
        first[2] + share * (second[2] - first[2]),
    )
