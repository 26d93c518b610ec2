"""Which of gyroscope, accelerometer and wind has drifted, found by force and attitude together."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.rotation import IDENTITY, from_euler, rotate
from uav_firmware.modules.estimator.ekf_core import EarlierEstimate, EkfCore
from uav_firmware.modules.estimator.fault_detection.accel_bias_drift import AccelDriftDetector
from uav_firmware.modules.estimator.kalman_filter.alignment import TiltAlignment
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.msg.vectors import Vector3

LOOK_US = 100_000
GRAVITY = 9.80665


class Hover:
    """A filter in hover, that is turned, and whose accelerometer reads, as a test sets it."""

    def __init__(self, yaw: float = 0.0) -> None:
        self.core = EkfCore(TiltAlignment(IDENTITY, (0.0, 0.0, 0.0), 1e-3), 0, EstimatorParams())
        self.core.lateral.set_drag(DragModel(87.0, 87.0, 0.29))
        self.core.state.q_ned_frd = from_euler(0.0, 0.0, yaw)
        self.watch = AccelDriftDetector()
        self.elapsed_s = 0.0

    def drift(
        self,
        seconds: float,
        *,
        force: tuple[float, float] = (0.0, 0.0),
        turned_frd: Vector3 = (0.0, 0.0, 0.0),
        rate: float = 0.05,
    ) -> EarlierEstimate | None:
        """Let force [m/s^2 per s] and corrections of the attitude [rad/s] grow; what is found."""
        core = self.core
        for _ in range(round(seconds * 1e6 / LOOK_US)):
            for _ in range(25):
                self.elapsed_s += 0.004
                x, y = (pace * self.elapsed_s for pace in force)
                core.lateral.update((x, y, -GRAVITY), (0.0, 0.0, 0.0), core.state.q_ned_frd, 0.004)
                core.recent_rotation.update((rate, 0.0, 0.0), 0.004)
            core.time_us += LOOK_US
            step = rotate(core.state.q_ned_frd, turned_frd)
            x, y, z = core.ekf.turned_ned
            core.ekf.turned_ned = (x + 0.1 * step[0], y + 0.1 * step[1], z + 0.1 * step[2])
            found = self.watch.update(core)
            if found is not None:
                return found
        return None


def explained(force: tuple[float, float]) -> Vector3:
    """The turn by which a force along x and y looks like gravity's."""
    return (-force[1] / GRAVITY, force[0] / GRAVITY, 0.0)


@given(angle=st.floats(0.0, 6.3), pace=st.floats(0.04, 1.0), yaw=st.floats(-3.0, 3.0))
@settings(max_examples=20, deadline=None)
def test_force_and_attitude_that_drift_alike_are_the_accelerometer(
    angle: float, pace: float, yaw: float
) -> None:
    force = (pace * math.cos(angle), pace * math.sin(angle))
    hover = Hover(yaw)
    found = hover.drift(25.0, force=force, turned_frd=explained(force))
    assert found is not None
    assert hover.elapsed_s < 3.0 + 0.4 / pace
    by_force = explained((force[0] * hover.elapsed_s, force[1] * hover.elapsed_s))
    expected = rotate(hover.core.state.q_ned_frd, by_force)
    assert found.turned_ned == pytest.approx(expected, abs=0.3 * math.hypot(*by_force))


@pytest.mark.parametrize(
    ("force", "turned"),
    [
        ((0.0, 0.0), (0.0, 0.0, 0.0)),
        ((0.1, 0.0), (0.0, 0.0, 0.0)),  # The wind rises, and the gyroscope sees the vehicle lean
        ((0.0, 0.0), (0.01, 0.0, 0.0)),  # The gyroscope drifts
        ((0.1, 0.0), (-0.01, 0.0, 0.0)),  # Both, by chance
        ((0.1, 0.0), (0.0, -0.01, 0.0)),
        ((0.0, 0.0), (0.0, 0.0, 0.1)),  # A heading that is aligned anew
        ((0.005, 0.0), (0.0, 0.0005, 0.0)),  # Noise of a healthy vehicle
    ],
)
def test_anything_else_is_not(force: tuple[float, float], turned: Vector3) -> None:
    assert Hover().drift(60.0, force=force, turned_frd=turned) is None


def test_corrections_of_the_gyroscope_bias_count_by_what_they_turn() -> None:
    hover = Hover()
    assert hover.drift(5.0) is None
    hover.core.state.gyro_bias_frd = (0.01, 0.0, 0.0)  # Whose integral is -0.01 rad/s about x
    found = hover.drift(15.0, force=(0.0, 0.1))
    assert found is not None
    assert found.gyro_bias_frd == pytest.approx((0.0, 0.0, 0.0), abs=2e-3)


def test_what_a_manoeuvre_has_taught_is_unlearnt_without_an_alarm() -> None:
    """Its scale errors were learnt as gyroscope bias, and the wind may change meanwhile."""
    force = (0.04, 0.0)
    calm, wild = Hover(), Hover()
    for hover, rate in ((calm, 0.05), (wild, 0.6)):
        assert hover.drift(10.0, rate=rate) is None
        hover.elapsed_s = 0.0
    assert calm.drift(14.0, force=force, turned_frd=explained(force)) is not None
    assert wild.drift(14.0, force=force, turned_frd=explained(force)) is None


def test_nothing_slow_is_seen_while_the_vehicle_turns_fast() -> None:
    force = (0.1, 0.0)
    assert Hover().drift(30.0, force=force, turned_frd=explained(force), rate=3.0) is None
