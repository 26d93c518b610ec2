"""A companion streams setpoints; the simulator's truth judges."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.support.autopilot_tester import SYSTEM_ID, AutopilotTester
from tests.support.stick_pilot import change_mode
from uav_firmware.lib.rotation import from_euler, to_euler
from uav_firmware.msg.status import NavigationState

pytestmark = pytest.mark.scenario

OFFBOARD = 6
POSITION_ONLY, VELOCITY_ONLY, ACCELERATION_ONLY = 0x0DF8, 0x0DC7, 0x0C3F
POSITION_AND_YAW = 0x09F8
RATES_IGNORED, ATTITUDE_IGNORED = 7, 128
PERIOD_STEPS = 12  # about 20 Hz
HOVER = 0.225


class Companion:
    """Streams one message about 20 times a second of vehicle time."""

    def __init__(self, tester: AutopilotTester, message: Any) -> None:
        self.message: Any = message
        self.sending = True
        self._tester = tester
        self._steps = 0
        tester.watch(self._say)

    def _say(self) -> None:
        self._steps += 1
        if self.sending and self._steps % PERIOD_STEPS == 0:
            self._tester.ground_station.send(self.message)


def local(mask: int, **fields: float) -> Any:
    names = ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate")
    numbers = [fields.get(name, 0.0) for name in names]
    return common.MAVLink_set_position_target_local_ned_message(
        0, SYSTEM_ID, 1, int(fields.get("frame", 1)), mask, *numbers
    )


def attitude(roll_deg: float, pitch_deg: float, thrust: float) -> Any:
    q = from_euler(math.radians(roll_deg), math.radians(pitch_deg), 0.0)
    return common.MAVLink_set_attitude_target_message(
        0, SYSTEM_ID, 1, RATES_IGNORED, list(q), 0.0, 0.0, 0.0, thrust
    )


def rates(roll: float, pitch: float, yaw: float, thrust: float) -> Any:
    return common.MAVLink_set_attitude_target_message(
        0, SYSTEM_ID, 1, ATTITUDE_IGNORED, [1.0, 0.0, 0.0, 0.0], roll, pitch, yaw, thrust
    )


def airborne(folder: Path, height: float = 5.0, **config: Any) -> AutopilotTester:
    tester = AutopilotTester(SimulationConfig(gps="rtk", **config), folder)
    tester.wait_until_ready()
    tester.take_off(height)
    tester.run_for(height * 0.5 + 6.0)
    return tester


def lead(tester: AutopilotTester, message: Any) -> Companion:
    """Begin a stream and change to offboard."""
    companion = Companion(tester, message)
    tester.run_for(0.3)
    change_mode(tester, OFFBOARD)
    return companion


def error_to(tester: AutopilotTester, place: tuple[float, float, float]) -> float:
    return math.dist(tester.true_position(), place)


@pytest.mark.parametrize("noise", [0.05, 1.0])
def test_a_take_off_and_five_points_from_the_ground(tmp_path: Path, noise: float) -> None:
    tester = AutopilotTester(SimulationConfig(gps="rtk", sensor_noise_factor=noise), tmp_path)
    tester.wait_until_ready()
    companion = lead(tester, local(POSITION_ONLY, z=-2.0))
    tester.arm()
    tolerance = 0.3 if noise < 1.0 else 1.0  # the estimate's own error is several decimetres
    tester.run_for(10.0)
    assert error_to(tester, (0.0, 0.0, 2.0)) < tolerance
    for north, east, up in ((5, 0, 2), (5, 5, 4), (0, 5, 4), (0, 0, 3), (-5, -5, 2)):
        companion.message = local(POSITION_ONLY, x=north, y=east, z=-up)
        tester.run_for(10.0)
        assert error_to(tester, (north, east, up)) < tolerance


def test_a_far_point_is_flown_to_without_overshoot(tmp_path: Path) -> None:
    tester = airborne(tmp_path, sensor_noise_factor=0.05)
    lead(tester, local(POSITION_AND_YAW, x=30.0, z=-5.0, yaw=0.0))
    norths: list[float] = []
    tester.watch(lambda: norths.append(tester.true_position()[0]))
    tester.run_for(20.0)
    assert max(norths) < 30.5
    assert error_to(tester, (30.0, 0.0, 5.0)) < 0.3


def test_a_velocity_is_flown_and_zero_holds_the_place(tmp_path: Path) -> None:
    tester = airborne(tmp_path, sensor_noise_factor=0.05, wind_speed_m_s=4.0)
    companion = lead(tester, local(VELOCITY_ONLY, vx=2.0, vy=-1.0))
    tester.run_for(6.0)
    assert tester.truth.velocity_ned[:2] == pytest.approx((2.0, -1.0), abs=0.4)
    companion.message = local(VELOCITY_ONLY)
    tester.run_for(5.0)
    place = tester.true_position()
    tester.run_for(8.0)
    assert error_to(tester, place) < 0.4


def test_an_acceleration_speeds_up_in_its_direction(tmp_path: Path) -> None:
    tester = airborne(tmp_path)
    lead(tester, local(ACCELERATION_ONLY, afx=1.0))
    before = tester.truth.velocity_ned
    tester.run_for(2.0)
    gained = [new - old for new, old in zip(tester.truth.velocity_ned, before, strict=True)]
    assert gained[0] == pytest.approx(2.0, abs=0.7)
    assert abs(gained[1]) < 0.4
    assert abs(gained[2]) < 0.4


def test_a_place_on_the_earth(tmp_path: Path) -> None:
    tester = airborne(tmp_path, sensor_noise_factor=0.05)
    latitude, longitude, height = tester.place(8.0, -6.0, 7.0)
    lead(
        tester,
        common.MAVLink_set_position_target_global_int_message(
            0, SYSTEM_ID, 1, 6, POSITION_ONLY,
            round(latitude * 1e7), round(longitude * 1e7), height, *[0.0] * 8,
        ),
    )  # fmt: skip
    tester.run_for(12.0)
    assert error_to(tester, (8.0, -6.0, 7.0)) < 0.4


def test_a_pitch_of_minus_twenty_degrees_is_held(tmp_path: Path) -> None:
    tester = airborne(tmp_path, height=15.0)
    lead(tester, attitude(0.0, -20.0, HOVER / math.cos(math.radians(20.0))))
    tester.run_for(1.0)
    pitches: list[float] = []
    tester.watch(lambda: pitches.append(math.degrees(to_euler(tester.truth.q_ned_frd)[1])))
    tester.run_for(2.0)
    assert min(pitches) > -25.0
    assert max(pitches) < -15.0
    assert tester.truth.velocity_ned[0] > 3.0


def test_body_rates_are_flown(tmp_path: Path) -> None:
    tester = airborne(tmp_path, height=15.0)
    lead(tester, rates(0.0, 0.0, 0.6, HOVER))
    tester.run_for(1.5)
    assert tester.truth.rate_frd[2] == pytest.approx(0.6, abs=0.1)
    assert abs(tester.truth.rate_frd[0]) < 0.1


@pytest.mark.promise
def test_a_lost_stream_ends_in_hold_within_its_time(tmp_path: Path) -> None:
    tester = airborne(tmp_path)
    companion = lead(tester, local(VELOCITY_ONLY, vx=2.0))
    tester.run_for(4.0)
    companion.sending = False
    tester.run_for(0.8)
    assert tester.is_in(NavigationState.OFFBOARD)
    tester.run_for(0.4)
    assert tester.is_in(NavigationState.AUTO_LOITER)
    tester.run_for(8.0)
    assert math.hypot(*tester.truth.velocity_ned) < 0.3


def test_offboard_needs_a_stream(tmp_path: Path) -> None:
    tester = airborne(tmp_path)
    with pytest.raises(AssertionError, match="stream"):
        change_mode(tester, OFFBOARD)
    assert tester.mode is NavigationState.AUTO_LOITER


MAKERS: list[Callable[[], Any]] = [
    lambda: local(POSITION_ONLY, x=math.nan),
    lambda: attitude(0.0, 0.0, math.nan),
    lambda: local(VELOCITY_ONLY, vx=math.inf),
]


@pytest.mark.parametrize("make", MAKERS)
def test_nonsense_in_a_stream_moves_nothing(tmp_path: Path, make: Callable[[], Any]) -> None:
    tester = airborne(tmp_path)
    place = tester.true_position()
    companion = lead(tester, local(VELOCITY_ONLY))
    companion.message = make()
    tester.run_for(5.0)
    assert tester.mode is NavigationState.AUTO_LOITER
    assert error_to(tester, place) < 1.0
