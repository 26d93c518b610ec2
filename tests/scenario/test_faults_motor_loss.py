"""One motor stops in the air: alarm, spinning flight at the place, controlled landing."""

import math
from pathlib import Path

import pytest

from sim.config import SimulationConfig
from sim.fault_schedule import Fault, Kind
from tests.support.autopilot_tester import AutopilotTester

pytestmark = pytest.mark.scenario

HEIGHT_M = 10.0


def hovering(folder: Path, **config: float) -> AutopilotTester:
    seed, height_m = int(config.pop("seed")), config.pop("height_m", HEIGHT_M)
    tester = AutopilotTester(SimulationConfig(gps="rtk", seed=seed, **config), folder)  # type: ignore[arg-type]
    tester.wait_until_ready()
    tester.take_off(height_m)
    tester.run_for(12.0)
    return tester


def lose(tester: AutopilotTester, motor: int, efficiency: float = 0.0) -> None:
    tester.simulation.add_fault(
        Fault(
            kind=Kind.MOTOR_LOSS,
            start_us=tester.truth.time_us,
            values={"motor": motor, "efficiency": efficiency},
        )
    )


def failed_motors(tester: AutopilotTester) -> int:
    status = tester.autopilot.topics.failure_detector_status.value
    return 0 if status is None else status.failed_motors


def heading_error_deg(tester: AutopilotTester) -> float:
    error = math.degrees(tester.estimate.heading) - tester.truth.yaw_deg
    return abs((error + 180.0) % 360.0 - 180.0)


class Watch:
    """Farthest from where it began, hardest sink near the ground, numbers that are none."""

    def __init__(self, tester: AutopilotTester) -> None:
        self.origin = tester.true_position()
        self.farthest_m = 0.0
        self.touch_down_m_s: float | None = None
        self.all_finite = True
        self._tester = tester
        tester.watch(self._note)

    def off_m(self) -> float:
        north, east, _ = self._tester.true_position()
        return math.hypot(north - self.origin[0], east - self.origin[1])

    def _note(self) -> None:
        tester = self._tester
        self.farthest_m = max(self.farthest_m, self.off_m())
        if self.touch_down_m_s is None and tester.truth.height_above_home_m < 0.25:
            self.touch_down_m_s = tester.truth.velocity_ned[2]
        topics = tester.autopilot.topics
        motors, estimate = topics.actuator_motors.value, topics.vehicle_local_position.value
        attitude = topics.vehicle_attitude.value
        assert motors is not None
        assert estimate is not None
        assert attitude is not None
        numbers = (*motors.control, *estimate.position_ned, *estimate.velocity_ned)
        self.all_finite &= math.isfinite(sum(numbers) + sum(attitude.q_ned_frd))


@pytest.mark.parametrize(("seed", "motor"), [(1, 1), (2, 2), (3, 3), (4, 4)])
def test_with_a_motor_lost_it_comes_down_softly_at_its_place(
    tmp_path: Path, seed: int, motor: int
) -> None:
    tester = hovering(tmp_path, seed=seed)
    watch = Watch(tester)
    lose(tester, motor)
    tester.run_for(0.1)
    assert failed_motors(tester) == 1 << (motor - 1)
    tester.run_for(0.4)
    tester.land()
    tester.wait_until_landed(60.0)
    assert any(f"Motor {motor} failed" in line for line in tester.lines)
    assert watch.all_finite
    assert watch.farthest_m < 4.0
    assert watch.off_m() < 1.0
    assert watch.touch_down_m_s is not None
    assert watch.touch_down_m_s < 1.0


@pytest.mark.parametrize(
    ("seed", "wind_m_s"),
    [(2, 3.0), (15, 3.0), (3, 8.0), (4, 8.0)],  # One in four trips at 8 m/s, one in twenty at 3
)
def test_the_feet_of_a_spinning_vehicle_do_not_trip_it(
    tmp_path: Path, seed: int, wind_m_s: float
) -> None:
    tester = hovering(tmp_path, seed=seed, wind_speed_m_s=wind_m_s)
    lose(tester, 1 + seed % 4)
    watch = Watch(tester)
    tester.wait_until_landed(60.0)
    assert not tester.simulation.wrecked
    assert watch.touch_down_m_s is not None
    assert watch.touch_down_m_s < 0.35


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("seed", "height_m", "wind_m_s"),
    [(1, 2.0, 0.0), (2, 2.0, 0.0), (5, 3.0, 4.0), (4, 4.0, 4.0)],
)
def test_a_motor_lost_near_the_ground_tips_no_vehicle_over(
    tmp_path: Path, seed: int, height_m: float, wind_m_s: float
) -> None:
    tester = hovering(tmp_path, seed=seed, height_m=height_m, wind_speed_m_s=wind_m_s)
    lose(tester, 1 + seed % 4)
    tester.wait_until_landed(60.0)
    assert not tester.simulation.wrecked


@pytest.mark.thorough
@pytest.mark.parametrize("height_m", [0.1, 0.5, 1.0])
def test_a_motor_lost_in_a_touchdown_tips_no_vehicle_over(tmp_path: Path, height_m: float) -> None:
    tester = hovering(tmp_path, seed=2)
    tester.land()
    tester.wait_until(lambda: tester.true_position()[2] < height_m, 30.0, "low")
    lose(tester, 3)
    tester.wait_until_landed(60.0)
    assert not tester.simulation.wrecked


@pytest.mark.thorough
@pytest.mark.parametrize(("seed", "height_m", "distance_m"), [(2, 3.0, 6.0), (5, 0.5, 15.0)])
def test_a_motor_and_the_range_finder_lost_in_a_landing_tip_no_vehicle_over(
    tmp_path: Path, seed: int, height_m: float, distance_m: float
) -> None:
    tester = hovering(tmp_path, seed=seed)
    tester.land()
    tester.wait_until(lambda: tester.true_position()[2] < height_m, 30.0, "low")
    blocked = Fault(
        kind=Kind.RANGEFINDER_BLOCKED,
        start_us=tester.truth.time_us,
        values={"distance_m": distance_m},
    )
    tester.simulation.add_fault(blocked)
    lose(tester, 1 + seed % 4)
    tester.wait_until_landed(60.0)
    assert not tester.simulation.wrecked


@pytest.mark.promise
def test_it_holds_place_and_height_spinning_the_way_that_the_two_rotors_push(
    tmp_path: Path,
) -> None:
    tester = hovering(tmp_path, seed=5)
    tester.autopilot.registry.set("COM_ACT_FAIL_ACT", 0)  # A warning only
    lose(tester, 1)
    tester.run_for(10.0)
    watch = Watch(tester)
    tester.run_for(10.0)
    # Rotors 3 and 4 turn clockwise, their reaction turns the nose to the left
    assert -25.0 < tester.truth.rate_frd[2] < -10.0
    assert watch.farthest_m < 1.0
    assert tester.truth.height_above_home_m == pytest.approx(HEIGHT_M, abs=1.0)
    assert heading_error_deg(tester) < 3.0


@pytest.mark.first_case
@pytest.mark.parametrize("seed", [2, 3])
def test_the_scale_error_of_the_gyroscope_does_not_turn_the_heading(
    tmp_path: Path, seed: int
) -> None:
    """Of 0.2 %: 2 degrees a second, and by a heading that is wrong so is the reckoned velocity."""
    tester = hovering(tmp_path, seed=seed, wind_speed_m_s=4.0)
    lose(tester, 1 + seed % 4)
    tester.simulation.add_fault(Fault(kind=Kind.GPS_LOSS, start_us=tester.truth.time_us))
    tester.run_for(14.0)
    assert heading_error_deg(tester) < 4.0
    north, east, _ = tester.truth.velocity_ned
    believed_north, believed_east, _ = tester.estimate.velocity_ned
    assert math.hypot(believed_north - north, believed_east - east) < 0.7


def test_a_motor_that_gives_less_is_borne_without_spinning(tmp_path: Path) -> None:
    tester = hovering(tmp_path, seed=6)
    watch = Watch(tester)
    lose(tester, 3, efficiency=0.7)
    tester.run_for(8.0)
    assert failed_motors(tester) == 0
    assert abs(tester.truth.rate_frd[2]) < 0.3
    assert watch.farthest_m < 1.5
    assert tester.truth.height_above_home_m == pytest.approx(HEIGHT_M, abs=0.7)


@pytest.mark.parametrize("seed", range(1, 11))
def test_no_alarm_in_wind_and_abrupt_flight(tmp_path: Path, seed: int) -> None:
    tester = AutopilotTester(SimulationConfig(gps="rtk", seed=seed, wind_speed_m_s=9.0), tmp_path)
    for name in ("MPC_ACC_HOR", "MPC_ACC_UP_MAX", "MPC_ACC_DOWN_MAX"):
        tester.autopilot.registry.set(name, 8.0)
    tester.autopilot.registry.set("MPC_JERK_AUTO", 60.0)
    tester.autopilot.registry.set("MPC_XY_CRUISE", 12.0)
    tester.wait_until_ready()
    alarms = 0

    def note() -> None:
        nonlocal alarms
        alarms += failed_motors(tester) != 0

    tester.watch(note)
    station = tester.ground_station
    corners = ((40.0, 0.0, 15.0), (40.0, 40.0, 5.0), (0.0, 40.0, 15.0))
    items = [station.mission_item(0, 22, tester.place(0.0, 0.0, 5.0), 0.0)]
    items += [
        station.mission_item(seq, 16, tester.place(*corner), 0.0, 2.0, 0.0)
        for seq, corner in enumerate(corners, start=1)
    ]
    items.append(station.return_item(len(items)))
    tester.upload(items)
    tester.start_mission()
    tester.wait_until_landed(180.0)
    assert alarms == 0
