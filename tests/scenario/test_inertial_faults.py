"""Inertial sensors that fail in flight; the simulator breaks them and its truth judges."""

import math
from pathlib import Path

import pytest

from sim.config import SimulationConfig
from sim.fault_schedule import ALL_INSTANCES, Fault, Kind
from sim.faults.notation import read_order
from tests.support.autopilot_tester import AutopilotTester
from uav_firmware.msg.status import NavigationState

pytestmark = pytest.mark.scenario

HEIGHT_M = 10.0


class Hover:
    """A vehicle that hovers while something breaks, and how far it gets meanwhile."""

    def __init__(self, folder: Path, **config: float) -> None:
        self.tester = AutopilotTester(SimulationConfig(gps="rtk", **config), folder)  # type: ignore[arg-type]  # each a number of its own type
        self.tester.wait_until_ready()
        self.tester.take_off(HEIGHT_M)
        self.tester.run_for(22.0)
        self._start = self.tester.true_position()
        self.farthest_m = self.largest_height_error_m = self.largest_tilt_deg = 0.0
        self.tester.watch(self._note)

    def break_now(self, line: str) -> None:
        """Let something fail."""
        fault = read_order(line, self.tester.truth.time_us)
        assert isinstance(fault, Fault)
        self.tester.simulation.add_fault(fault)

    def drift(self, x_m_s2: float, y_m_s2: float, z_m_s2: float) -> None:
        """Let the bias of every accelerometer grow by so much each second, from now on."""
        tester, axes = self.tester, ("x_m_s2", "y_m_s2", "z_m_s2")
        start_us = due_us = tester.truth.time_us

        def grow() -> None:
            nonlocal due_us
            now_us = tester.truth.time_us
            if now_us < due_us:
                return
            due_us = now_us + 100_000
            grown_s = (now_us - start_us) * 1e-6
            paces = zip(axes, (x_m_s2, y_m_s2, z_m_s2), strict=True)
            values = {axis: pace * grown_s for axis, pace in paces}
            tester.simulation.clear_faults(Kind.ACCEL_BIAS)
            tester.simulation.add_fault(
                Fault(
                    kind=Kind.ACCEL_BIAS,
                    start_us=now_us,
                    values={**values, "instance": ALL_INSTANCES},
                )
            )

        tester.watch(grow)

    def _note(self) -> None:
        north, east, up = (
            now - start for now, start in zip(self.tester.true_position(), self._start, strict=True)
        )
        self.farthest_m = max(self.farthest_m, math.hypot(north, east))
        self.largest_height_error_m = max(self.largest_height_error_m, abs(up))
        _, x, y, _ = self.tester.truth.q_ned_frd
        tilt = math.degrees(math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y))))
        self.largest_tilt_deg = max(self.largest_tilt_deg, tilt)


@pytest.mark.parametrize(
    "line",
    [
        *(f"accel_bias z_m_s2={bias}" for bias in (-3, -2, -1, 1, 2, 3)),
        "accel_bias x_m_s2=2",
        "accel_bias x_m_s2=-1 y_m_s2=3",
    ],
)
def test_the_only_accelerometer_jumps_and_the_vehicle_lands_where_it_is(
    tmp_path: Path, line: str
) -> None:
    """One alarm, the accelerometer's; held within a metre, no harm, and not armed again."""
    hover = Hover(tmp_path, imus=1)
    tester = hover.tester
    hover.break_now(line)
    tester.run_for(3.0)  # Before the failsafe's landing
    assert hover.farthest_m < 1.0
    assert hover.largest_height_error_m < 0.6
    assert hover.largest_tilt_deg < 35.0
    assert hover.tester.has_status_text("Accelerometer bias beyond its limit: LAND")
    assert not hover.tester.has_status_text("Gyroscope")
    tester.wait_until_landed()
    assert not tester.simulation.wrecked
    assert hover.farthest_m < 1.5
    assert not hover.tester.has_status_text("Gyroscope")
    tester.run_for(5.0)
    assert not tester.status.preflight_checks_pass


@pytest.mark.parametrize(
    ("pace", "config"),
    [
        ((0.0, 0.1, 0.0), {"imus": 1}),
        ((-0.1, 0.0, 0.0), {"imus": 3}),  # All three of them alike, so that no vote sees it
        ((0.03, 0.0, 0.0), {"imus": 1}),
        ((0.0, 1.0, 0.0), {"imus": 1}),
        ((0.1, 0.0, 0.1), {"imus": 1}),
        ((0.0, 0.0, -0.5), {"imus": 1}),
        ((0.07, -0.07, 0.0), {"imus": 1, "wind_speed_m_s": 6.0}),
    ],
)
def test_an_accelerometer_that_drifts_is_given_up_and_the_vehicle_lands_where_it_is(
    tmp_path: Path, pace: tuple[float, float, float], config: dict[str, float]
) -> None:
    """Reported within 22 s, landed upright within a metre, disarmed, and not armed again."""
    hover = Hover(tmp_path, **config)
    tester = hover.tester
    hover.drift(*pace)
    tester.wait_until(
        lambda: tester.has_status_text("Accelerometer bias beyond its limit: LAND"),
        22.0,
        "reported",
    )
    tester.wait_until_landed()
    assert not tester.simulation.wrecked
    assert hover.farthest_m < 1.0
    assert hover.largest_tilt_deg < 25.0
    assert tester.true_position()[2] < 0.1
    tester.run_for(5.0)
    assert not tester.status.armed
    assert not tester.status.preflight_checks_pass


@pytest.mark.parametrize(
    "lines",
    [
        ("gyro_loss", "accel_bias x_m_s2=3 z_m_s2=-3", "mag_frozen", "baro_bias up_m=5"),
        ("gyro_frozen", "accel_loss", "mag_disturbance x_gauss=0.3 y_gauss=0.3", "baro_frozen"),
        ("gyro_bias x_deg_s=10 y_deg_s=-10 z_deg_s=10", "accel_frozen", "mag_loss", "baro_loss"),
    ],
)
def test_one_instance_of_each_sensor_may_fail_and_nothing_is_felt(
    tmp_path: Path, lines: tuple[str, ...]
) -> None:
    """Each is reported once, by its name; nothing is flown differently; it does not arm again."""
    hover = Hover(tmp_path)
    for line in lines:
        hover.break_now(line)
        hover.tester.run_for(4.0)
    failed = [text.split(" ", 1)[1] for text in hover.tester.lines if "failed" in text]
    names = ("Gyroscope", "Accelerometer", "Compass", "Barometer")
    assert len(failed) == len(names), failed
    for name, text in zip(names, failed, strict=True):
        assert text.startswith(f"{name} 1 failed"), failed
    assert hover.farthest_m < 0.5
    assert hover.largest_height_error_m < 0.5
    assert not hover.tester.has_status_text("Motor")
    assert not hover.tester.has_status_text("has jumped")
    assert not hover.tester.has_status_text("beyond its limit")
    assert hover.tester.mode is NavigationState.AUTO_LOITER
    assert not hover.tester.status.preflight_checks_pass


@pytest.mark.parametrize("instance", [0, 1])
@pytest.mark.parametrize("line", ["gyro_loss", "accel_bias z_m_s2=3", "gyro_bias x_deg_s=4"])
def test_of_two_inertial_units_the_broken_one_is_found_and_given_up(
    tmp_path: Path, line: str, instance: int
) -> None:
    hover = Hover(tmp_path, imus=2)
    hover.break_now(f"{line} instance={instance}")
    hover.tester.run_for(8.0)
    name = "Gyroscope" if "gyro" in line else "Accelerometer"
    assert hover.tester.has_status_text(f"{name} {instance + 1} failed")
    assert not hover.tester.has_status_text(f"{name} {2 - instance} failed")
    assert hover.farthest_m < 1.0
    assert hover.largest_height_error_m < 0.6
    assert not hover.tester.has_status_text("LAND")
    assert not hover.tester.status.preflight_checks_pass


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("line", "config"),
    [
        ("gyro_bias instance=all x_deg_s=3", {"imus": 3}),
        ("gyro_bias instance=all x_deg_s=3", {"imus": 2}),
        ("gyro_bias instance=all y_deg_s=-10", {"imus": 3, "wind_speed_m_s": 5.0}),
        ("gyro_bias instance=all x_deg_s=2 y_deg_s=-3 z_deg_s=5", {"imus": 3, "seed": 2}),
    ],
)
def test_gyroscopes_that_jump_alike_are_followed_and_named(
    tmp_path: Path, line: str, config: dict[str, float]
) -> None:
    """No vote sees it; the GPS velocity proves it, and neither GPS nor accelerometer is blamed."""
    hover = Hover(tmp_path, **config)
    hover.break_now(line)
    hover.tester.run_for(15.0)
    assert hover.tester.has_status_text("Gyroscope bias has jumped, following it")
    for other in ("GPS velocity", "Accelerometer", "Compass"):
        assert not hover.tester.has_status_text(other)
    assert hover.farthest_m < 5.0
    if hover.tester.status.armed:
        hover.tester.land()
        hover.tester.wait_until_landed()
    assert not hover.tester.simulation.wrecked


@pytest.mark.parametrize(
    ("line", "wind_speed_m_s", "seed"), [("accel_loss", 5.0, 3), ("accel_frozen", 0.0, 1)]
)
def test_without_any_accelerometer_it_lands_by_the_thrust_that_is_commanded(
    tmp_path: Path, line: str, wind_speed_m_s: float, seed: int
) -> None:
    """Its vertical velocity is rough, and yet the landing is seen within seconds."""
    hover = Hover(tmp_path, imus=1, wind_speed_m_s=wind_speed_m_s, seed=seed)
    hover.break_now(line)
    tester = hover.tester
    tester.wait_until(lambda: tester.true_position()[2] < 0.1, 60.0, "touching")
    tester.wait_until(lambda: not tester.status.armed, 8.0, "disarmed")
    assert hover.tester.has_status_text("Accelerometer lost, flying without it: LAND")
    assert not hover.tester.simulation.wrecked
    assert hover.farthest_m < 2.0
    assert not hover.tester.has_status_text("Motor")


@pytest.mark.parametrize(("line", "imus"), [("gyro_loss", 1), ("gyro_frozen instance=all", 3)])
def test_without_any_gyroscope_the_flight_is_terminated_and_says_why(
    tmp_path: Path, line: str, imus: int
) -> None:
    """Nothing controls it any more: the motors stop at once, and nothing else is blamed."""
    hover = Hover(tmp_path, imus=imus)
    tester = hover.tester
    hover.break_now(line)
    tester.wait_until(lambda: not tester.status.armed, 0.5, "terminated")
    tester.run_for(5.0)
    assert hover.tester.has_status_text("Gyroscope lost, no attitude: TERMINATE")
    assert hover.tester.has_status_text("Flight terminated")
    for other in ("Motor", "Crash detected", "has jumped", "beyond its limit"):
        assert not hover.tester.has_status_text(other)
    assert not tester.status.preflight_checks_pass


@pytest.mark.parametrize("imus", [1, 3])
def test_a_gap_of_every_gyroscope_does_not_end_the_flight(tmp_path: Path, imus: int) -> None:
    """A bus that resets: three times 0.08 s without a body rate are felt by nobody."""
    hover = Hover(tmp_path, imus=imus)
    for _ in range(3):
        hover.break_now("gyro_loss instance=all duration_s=0.08")
        hover.tester.run_for(1.5)
    assert hover.tester.status.armed
    assert not hover.tester.has_status_text("Gyroscope")
    assert hover.farthest_m < 0.5
    assert hover.largest_height_error_m < 0.5
