"""What breaks in flight, and how the flight ends; the simulator breaks it and its truth judges."""

import errno
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from sim.fault_schedule import ALL_INSTANCES, Fault, Kind
from tests.support.autopilot_tester import AutopilotTester
from tests.support.toy_vehicle import item
from uav_firmware.cal.log_store import LogFile
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.modules.navigator.geofence.geofence import Polygon
from uav_firmware.msg.geofence import Fence
from uav_firmware.msg.status import Command, NavigationState

pytestmark = pytest.mark.scenario

LEGS = ((60.0, 0.0, 10.0), (60.0, 60.0, 10.0), (0.0, 60.0, 10.0))


def vehicle(
    folder: Path, settings: dict[str, float] | None = None, **config: Any
) -> AutopilotTester:
    tester = AutopilotTester(SimulationConfig(gps="rtk", **config), folder)
    for name, value in (settings or {}).items():
        tester.autopilot.registry.set(name, value)
    tester.wait_until_ready()
    return tester


def on_mission(
    folder: Path,
    legs: Sequence[tuple[float, float, float]] = LEGS,
    settings: dict[str, float] | None = None,
    **config: Any,
) -> AutopilotTester:
    """A vehicle 20 m out on its first leg, at the height of it."""
    tester = vehicle(folder, settings, **config)
    station = tester.ground_station
    items = [
        station.mission_item(
            0, common.MAV_CMD_NAV_TAKEOFF, tester.place(0.0, 0.0, legs[0][2]), 0.0
        ),
        *(
            station.mission_item(
                seq, common.MAV_CMD_NAV_WAYPOINT, tester.place(*leg), 0.0, 2.0, 0.0
            )
            for seq, leg in enumerate(legs, start=1)
        ),
        station.return_item(len(legs) + 1),
    ]
    tester.upload(items)
    tester.start_mission()
    tester.wait_until(lambda: tester.true_position()[0] > 20.0, 60.0, "20 m out")
    return tester


def strike(
    tester: AutopilotTester, kind: Kind, seconds: float | None = None, **values: float
) -> None:
    """Let something break now, for a while or for good."""
    now_us = tester.simulation.time_us
    end = {} if seconds is None else {"end_us": now_us + round(seconds * 1e6)}
    tester.simulation.add_fault(Fault(kind=kind, start_us=now_us, values=values, **end))


def estimate_error(tester: AutopilotTester) -> float:
    """Horizontal distance [m] between where the vehicle is and where it believes to be."""
    north, east, _ = tester.true_position()
    believed = tester.estimate.position_ned
    return math.hypot(north - believed[0], east - believed[1])


def test_gps_lost_for_four_seconds_does_not_end_the_mission(tmp_path: Path) -> None:
    tester = on_mission(tmp_path)
    errors: list[float] = []
    tester.watch(lambda: errors.append(estimate_error(tester)))
    strike(tester, Kind.GPS_LOSS, 4.0)
    tester.run_for(3.5)
    assert math.hypot(*tester.truth.velocity_ned[:2]) < 0.5
    tester.run_for(4.0)
    assert tester.has_status_text("GPS lost")
    assert tester.has_status_text("dead reckoning: over")
    assert tester.mode is NavigationState.AUTO_MISSION
    assert max(errors) < 1.0
    tester.wait_until_landed(200.0)
    assert list(dict.fromkeys(tester.ground_station.items_reached)) == [0, 1, 2, 3, 4]


class Loss(NamedTuple):
    """A loss of GPS for good: at which speed, in which wind, and how it may end."""

    speed_m_s: float
    wind_m_s: float
    away_m: float
    touch_down_m_s: float


@pytest.mark.parametrize(
    "loss",
    [
        Loss(0.0, 0.0, 30.0, 1.5),
        Loss(4.0, 0.0, 30.0, 1.5),
        Loss(8.0, 0.0, 30.0, 1.5),
        Loss(0.0, 3.0, 30.0, 2.0),
        Loss(6.0, 6.0, 40.0, 3.0),  # The wind of the loss is held, less towards the ground
        Loss(0.0, 10.0, 15.0, 2.0),  # At 12 m above ground 11 m/s and gusts of 2 m/s
    ],
)
def test_gps_lost_for_good_brakes_and_lands_near_the_place(tmp_path: Path, loss: Loss) -> None:
    settings = {"MPC_XY_CRUISE": max(loss.speed_m_s, 1.0)}
    legs = ((400.0, 0.0, 10.0),)
    if loss.speed_m_s:
        tester = on_mission(tmp_path, legs, settings, wind_speed_m_s=loss.wind_m_s)
        tester.wait_until(lambda: tester.true_position()[0] > 60.0, 60.0, "at speed")
    else:
        tester = vehicle(tmp_path, wind_speed_m_s=loss.wind_m_s)
        tester.take_off(10.0)
        tester.run_for(20.0)
    place = tester.true_position()[:2]
    strike(tester, Kind.GPS_LOSS)
    tester.run_for(2.0)
    station = tester.ground_station
    station.command(common.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    tester.run_for(0.2)
    assert station.acks[-1][1] == common.MAV_RESULT_TEMPORARILY_REJECTED
    tester.wait_until(lambda: tester.true_position()[2] < 0.1, 60.0, "touching")
    assert math.hypot(*tester.truth.velocity_ned[:2]) < loss.touch_down_m_s
    tester.wait_until(lambda: not tester.status.armed, 20.0, "disarmed")
    assert math.dist(tester.true_position()[:2], place) < loss.away_m
    assert not tester.simulation.wrecked


@pytest.mark.parametrize("seed", [11, 13, 17])
def test_gps_lost_high_up_in_a_strong_wind_is_no_flight_with_the_wind(
    tmp_path: Path, seed: int
) -> None:
    """A velocity that is doubtful by a share of the wind is still better than none."""
    tester = vehicle(tmp_path, wind_speed_m_s=10.0, seed=seed)
    tester.take_off(40.0)
    tester.run_for(20.0)
    strike(tester, Kind.GPS_LOSS)
    speeds: list[float] = []
    held: list[bool] = []
    tester.watch(lambda: speeds.append(math.hypot(*tester.truth.velocity_ned[:2])))
    tester.watch(lambda: held.append(tester.estimate.velocity_valid))
    tester.wait_until(lambda: tester.true_position()[2] < 2.0, 60.0, "just above the ground")
    assert all(held)
    tester.wait_until(lambda: tester.true_position()[2] < 0.1, 10.0, "touching")
    assert max(speeds) < 5.0
    assert speeds[-1] < 3.0
    tester.wait_until(lambda: not tester.status.armed, 20.0, "disarmed")


@pytest.mark.parametrize("climb", [False, True])
def test_without_any_height_it_comes_down_slowly_and_ends_disarmed(
    tmp_path: Path, *, climb: bool
) -> None:
    """No GPS, every barometer frozen: the accelerometer is left, also when it was climbing."""
    tester = vehicle(tmp_path, wind_speed_m_s=3.0)
    tester.take_off(40.0 if climb else 10.0)
    if climb:
        tester.wait_until(lambda: tester.true_position()[2] > 10.0, 20.0, "climbing")
    else:
        tester.run_for(15.0)
    strike(tester, Kind.GPS_LOSS)
    strike(tester, Kind.BARO_FROZEN, instance=ALL_INSTANCES)
    sinks: list[float] = []
    tester.watch(lambda: sinks.append(tester.truth.velocity_ned[2]))
    tester.wait_until(lambda: tester.true_position()[2] < 0.1, 60.0, "touching")
    assert sinks[-1] < 1.0
    assert max(sinks) < 2.0
    tester.wait_until(lambda: not tester.status.armed, 8.0, "disarmed")
    assert not tester.simulation.wrecked


def test_a_landing_at_a_place_lands_here_when_gps_is_lost_on_the_way(tmp_path: Path) -> None:
    tester = vehicle(tmp_path)
    tester.take_off(10.0)
    tester.wait_until(lambda: tester.true_position()[2] > 9.5, 60.0, "at 10 m")
    latitude, longitude, _ = tester.place(100.0, 0.0, 0.0)
    tester.ground_station.command(
        Command.NAV_LAND, 0.0, 0.0, 0.0, math.nan, latitude, longitude, math.nan
    )
    tester.wait_until(lambda: tester.true_position()[0] > 20.0, 60.0, "on the way")
    place = tester.true_position()[:2]
    strike(tester, Kind.GPS_LOSS)
    tester.wait_until(lambda: tester.true_position()[2] < 0.1, 60.0, "touching")
    assert math.hypot(*tester.truth.velocity_ned[:2]) < 1.5
    tester.wait_until(lambda: not tester.status.armed, 20.0, "disarmed")
    assert math.dist(tester.true_position()[:2], place) < 30.0
    assert not tester.simulation.wrecked


def test_a_gyroscope_bias_that_jumps_does_not_carry_the_vehicle_away(tmp_path: Path) -> None:
    tester = on_mission(tmp_path, wind_speed_m_s=5.0, imus=1)
    beside: list[float] = []
    tester.watch(lambda: beside.append(abs(tester.true_position()[1])))
    strike(tester, Kind.GYRO_BIAS, x_deg_s=3.0, y_deg_s=3.0)
    tester.run_for(4.0)
    assert tester.has_status_text("Gyroscope bias has jumped")
    assert tester.mode is NavigationState.AUTO_MISSION
    strike(tester, Kind.GYRO_BIAS, x_deg_s=10.0, y_deg_s=10.0, z_deg_s=-10.0)
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_LAND, 15.0, "landing")
    assert tester.has_status_text("Gyroscope bias beyond its limit: LAND")
    assert not tester.has_status_text("Wind too strong")
    assert max(beside) < 1.5
    tester.wait_until(lambda: not tester.status.armed, 40.0, "disarmed")
    assert not tester.simulation.wrecked


@pytest.mark.parametrize("kind", [Kind.BARO_LOSS, Kind.MAG_LOSS])
def test_a_lost_barometer_or_compass_does_not_end_the_mission(tmp_path: Path, kind: Kind) -> None:
    tester = on_mission(tmp_path)
    strike(tester, kind)
    tester.wait_until_landed(200.0)
    assert 4 in tester.ground_station.items_reached
    assert not tester.simulation.wrecked


def test_a_low_battery_warns_a_critical_one_returns_an_empty_one_lands(tmp_path: Path) -> None:
    tester = on_mission(tmp_path, settings={"BAT_CRIT_THR": 0.10})
    # True charges; the vehicle estimates 0.12, 0.08 and 0 from voltage, some seconds later
    strike(tester, Kind.BATTERY_LOW, charge=0.175)
    tester.wait_until(lambda: tester.has_status_text("Battery low"), 15.0, "warned")
    assert tester.mode is NavigationState.AUTO_MISSION
    strike(tester, Kind.BATTERY_LOW, charge=0.147)
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_RTL, 25.0, "returning")
    strike(tester, Kind.BATTERY_LOW, charge=0.08)
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_LAND, 15.0, "landing")
    tester.wait_until(lambda: not tester.status.armed, 60.0, "disarmed")
    assert tester.simulation.battery_charge > 0.0
    assert not tester.simulation.wrecked


def test_a_vehicle_that_no_longer_measures_its_battery_returns(tmp_path: Path) -> None:
    tester = on_mission(tmp_path)
    strike(tester, Kind.BATTERY_MONITOR_LOSS)  # Known after 4 s, acted on after COM_FAIL_ACT_T
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_RTL, 10.0, "returning")
    assert tester.has_status_text("Battery monitor lost")
    tester.wait_until_landed(200.0)
    assert not tester.simulation.wrecked


@pytest.mark.parametrize("motor", [1, 3])
def test_a_lost_motor_raises_the_alarm_and_lands(tmp_path: Path, motor: int) -> None:
    tester = on_mission(tmp_path)
    heights: list[float] = []
    tester.watch(lambda: heights.append(tester.true_position()[2]))
    strike(tester, Kind.MOTOR_LOSS, motor=motor)
    tester.wait_until(lambda: tester.has_status_text("Motor failed: LAND"), 5.0, "an alarm")
    assert tester.mode is NavigationState.AUTO_LAND
    tester.wait_until(lambda: not tester.status.armed, 60.0, "disarmed")
    assert all(map(math.isfinite, heights))


@pytest.mark.promise
def test_a_lost_link_returns_and_lands_at_home(tmp_path: Path) -> None:
    tester = on_mission(tmp_path, settings={"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 5.0})
    tester.heartbeats = False
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_LOITER, 7.0, "holding")
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_RTL, 6.0, "returning")
    tester.wait_until_landed(200.0)
    north, east, _ = tester.true_position()
    assert math.hypot(north, east) < 1.0


def test_a_link_that_comes_back_lets_the_mission_go_on(tmp_path: Path) -> None:
    tester = on_mission(tmp_path, settings={"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 5.0})
    tester.heartbeats = False
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_LOITER, 7.0, "holding")
    tester.heartbeats = True
    tester.run_for(1.5)
    assert tester.mode is NavigationState.AUTO_MISSION


@pytest.mark.parametrize(
    ("action", "mode"),
    [
        (2, NavigationState.AUTO_LOITER),
        (3, NavigationState.AUTO_RTL),
        (5, NavigationState.AUTO_LAND),
    ],
)
def test_a_breach_of_the_fence_is_answered_before_it_is_far(
    tmp_path: Path, action: int, mode: NavigationState
) -> None:
    tester = vehicle(tmp_path, {"GF_ACTION": action, "GF_MAX_HOR_DIST": 40.0})
    tester.take_off(10.0)
    tester.run_for(12.0)
    tester.autopilot.registry.set("GF_MAX_HOR_DIST", 0.0)
    latitude, longitude, _ = tester.place(80.0, 0.0, 10.0)
    altitude = tester.start.altitude_amsl_m + 10.0
    tester.send_command(
        common.MAV_CMD_DO_REPOSITION,
        -1.0,
        1.0,
        0.0,
        math.nan,
        latitude,
        longitude,
        altitude,
    )
    tester.autopilot.registry.set("GF_MAX_HOR_DIST", 40.0)
    furthest: list[float] = []
    tester.watch(lambda: furthest.append(tester.true_position()[0]))
    tester.wait_until(lambda: tester.has_status_text("Geofence breached"), 30.0, "a breach")
    tester.run_for(0.2)
    assert tester.mode is mode
    tester.run_for(8.0)
    assert max(furthest) < 43.0


def test_a_flight_that_lasts_too_long_returns(tmp_path: Path) -> None:
    tester = on_mission(tmp_path, settings={"COM_FLT_TIME_MAX": 20})
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_RTL, 30.0, "returning")
    tester.wait_until_landed(200.0)


def test_a_strong_wind_is_measured_and_sends_the_vehicle_home(tmp_path: Path) -> None:
    tester = vehicle(tmp_path, {"COM_WIND_WARN": 6.0, "COM_WIND_MAX": 8.0}, wind_speed_m_s=3.0)
    tester.take_off(10.0)
    tester.run_for(25.0)
    assert not tester.has_status_text("Strong wind")
    strike(tester, Kind.WIND_GUST, speed_m_s=8.0)
    tester.wait_until(lambda: tester.has_status_text("Strong wind: WARN"), 30.0, "a warning")
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_RTL, 30.0, "returning")
    wind = tester.autopilot.topics.wind.value
    assert wind is not None
    assert wind.velocity_east_m_s == pytest.approx(11.0, abs=4.0)
    assert abs(wind.velocity_north_m_s) < 3.0


def test_the_emergency_stop_stops_the_motors_in_the_air(tmp_path: Path) -> None:
    tester = vehicle(tmp_path)
    tester.take_off(3.0)
    tester.run_for(8.0)
    tester.send_command(common.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, 21196.0)
    assert not tester.status.armed
    tester.run_for(0.5)
    assert tester.truth.velocity_ned[2] > 3.0


def test_a_vehicle_breaks_by_command_only_where_that_is_allowed(tmp_path: Path) -> None:
    tester = vehicle(tmp_path)
    tester.take_off(10.0)
    tester.run_for(10.0)
    gps, off, denied = 4.0, 1.0, common.MAV_RESULT_DENIED
    station = tester.ground_station
    station.command(common.MAV_CMD_INJECT_FAILURE, gps, off, 0.0)
    tester.run_for(0.2)
    assert station.acks[-1] == (common.MAV_CMD_INJECT_FAILURE, denied)
    tester.autopilot.registry.set("SYS_FAILURE_EN", 1)
    tester.send_command(common.MAV_CMD_INJECT_FAILURE, gps, off, 0.0)
    tester.run_for(4.0)
    assert tester.has_status_text("GPS lost")


class FullCard:
    """A medium for flight logs that has no room for one."""

    def free_bytes(self) -> int:
        return 0

    def create(self, time_utc_us: int) -> LogFile:
        raise OSError(errno.ENOSPC, "No space left on device", f"{time_utc_us}.ulg")


def test_a_full_disk_is_reported_and_neither_prevents_nor_ends_a_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_storage: FileStorage, _name: str, _contents: bytes) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(FileStorage, "save", refuse)
    tester = AutopilotTester(SimulationConfig(gps="rtk", seed=1), tmp_path, log_store=FullCard())
    tester.wait_until_ready()
    tester.take_off(5.0)
    tester.autopilot.registry.set("MPC_XY_CRUISE", 4.0)  # A change that cannot be kept
    tester.run_for(12.0)
    assert tester.has_status_text("Flight log stopped: No space left")
    assert tester.has_status_text("Parameters not saved: No space left")
    assert tester.has_status_text("Storage full")
    tester.return_home()
    tester.wait_until_landed()
    assert not tester.simulation.wrecked


def test_a_vehicle_tilted_beyond_its_limits_reports_it(tmp_path: Path) -> None:
    """Hard on its side: reported, while the controllers right it."""
    tester = vehicle(tmp_path)
    tester.autopilot.registry.set("FD_FAIL_R", 30.0)
    tester.autopilot.registry.set("FD_FAIL_P", 30.0)
    tester.autopilot.registry.set("MPC_XY_CRUISE", 10.0)
    tester.autopilot.registry.set("MPC_ACC_HOR", 8.0)
    tester.autopilot.registry.set("MPC_TILTMAX_AIR", 50.0)
    tester.wait_until_ready()
    tester.take_off(10.0)
    tester.run_for(8.0)
    assert not tester.has_status_text("Attitude beyond limits")
    latitude, longitude, _ = tester.place(60.0, 0.0, 0.0)
    tester.ground_station.command(
        Command.DO_REPOSITION, -1.0, 1.0, 0.0, math.nan, latitude, longitude, math.nan
    )
    tester.run_for(6.0)
    assert tester.has_status_text("Attitude beyond limits")
    assert tester.mode is NavigationState.AUTO_LOITER


@pytest.mark.parametrize("seed", [1, 2])
def test_a_return_beside_a_fence_goes_round_it_and_lands_at_home(tmp_path: Path, seed: int) -> None:
    """An exclusion between the vehicle and home, in a breeze: not touched, and home in 100 s."""
    tester = vehicle(tmp_path, seed=seed, wind_speed_m_s=5.0)
    tester.take_off(10.0)
    tester.run_for(10.0)
    latitude, longitude, _ = tester.place(80.0, 0.0, 0.0)
    tester.ground_station.command(
        Command.DO_REPOSITION, -1.0, 1.0, 0.0, math.nan, latitude, longitude, math.nan
    )
    tester.wait_until(lambda: tester.true_position()[0] > 78.0, 60.0, "80 m out")
    wall = ((30.0, -40.0), (30.0, 15.0), (50.0, 15.0), (50.0, -40.0))
    corners = [tester.place(*corner, 0.0) for corner in wall]
    tester.autopilot.topics.fence.publish(
        Fence(
            tester.truth.time_us,
            1,
            tuple(
                item(seq, 5002, frame=3, param1=4.0, x=place[0], y=place[1])
                for seq, place in enumerate(corners)
            ),
        )
    )
    forbidden = Polygon(False, wall)
    inside: list[bool] = []
    tester.watch(lambda: inside.append(forbidden.contains(tester.true_position()[:2])))
    tester.run_for(1.0)
    tester.return_home()
    tester.wait_until(lambda: not tester.status.armed, 100.0, "landed at home")
    assert not any(inside)
    assert math.hypot(*tester.true_position()[:2]) < 1.0
