"""Failures of a vehicle: reported once, and the end of the mission in flight."""

import dataclasses
from pathlib import Path

import pytest

from afarcloud.enumerations import AlarmCode, AlarmType, Status
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mission.states import State
from mavlink_broker.vehicle.alarms import AlarmMonitor
from tests.support.autopilot_families import SLOW_PX4
from tests.support.broker_world import (
    World,
    first_flight,
    flying_world,
    go_home,
    land,
    mission,
    takeoff,
)
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_RETURN,
    PX4,
    PX4_LAND,
    PX4_POSITION,
    PX4_RETURN,
    Script,
)

GPS = mavlink.MAV_SYS_STATUS_SENSOR_GPS
SLOW_COPTER = dataclasses.replace(ARDUPILOT, item_time_s=10.0)


def alarms(world: World) -> list[tuple[int, int]]:
    bodies = world.edge.bodies("/alarm/")
    return [(body["alarm_type_id"], body["alarm_code_id"]) for body in bodies]


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("bit", "code"),
    [
        (mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION, AlarmCode.EQUIPMENT_SONAR),
        (mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS, AlarmCode.EQUIPMENT_PROPELLERS),
        (mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO, AlarmCode.EQUIPMENT_IMU),
        (mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL, AlarmCode.EQUIPMENT_IMU),
        (GPS, AlarmCode.EQUIPMENT_GPS),
        (mavlink.MAV_SYS_STATUS_AHRS, AlarmCode.FUNCTION_LOCALISATION),
        (mavlink.MAV_SYS_STATUS_SENSOR_PROPULSION, AlarmCode.FUNCTION_PROPULSION),
        (mavlink.MAV_SYS_STATUS_GEOFENCE, AlarmCode.FUNCTION_NAVIGATION),
    ],
)
def test_a_failure_in_flight_is_reported_and_ends_the_mission(bit: int, code: AlarmCode) -> None:
    world = flying_world(SLOW_PX4)
    vehicle = world.only_vehicle
    world.run_until(lambda: world.edge.statuses(1201)[0] == Status.FINISHED)
    vehicle.ill = bit
    world.run(4.0)
    kind = AlarmType.EQUIPMENT_FAILURE if code < 50 else AlarmType.FUNCTION_UNAVAILABLE
    assert alarms(world) == [(kind, code)]
    assert world.edge.bodies("/alarm/")[0]["mission_id"] == 1201
    assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]
    assert world.edge.status(1201) == Status.FAILED
    assert vehicle.custom_mode == (PX4_LAND if bit == GPS else PX4_RETURN)
    world.run_until(lambda: not vehicle.armed)
    world.run(3.0)
    assert world.app.sessions[1].state is State.IDLE


def test_a_moment_is_no_failure() -> None:
    world = flying_world(SLOW_PX4)
    world.only_vehicle.ill = GPS
    world.run(1.0)
    world.only_vehicle.ill = 0
    world.run(10.0)
    assert alarms(world) == []
    assert world.edge.status(1201) == Status.RUNNING


def test_a_failure_is_reported_once_and_again_after_it_was_over() -> None:
    world = World()
    vehicle = world.add_vehicle()
    world.run(3.0)
    for _ in range(2):
        vehicle.ill = GPS
        world.run(20.0)
        vehicle.ill = 0
        world.run(3.0)
    assert alarms(world) == [(1, 5), (1, 5)]


def test_what_was_never_well_has_not_failed() -> None:
    world = World()
    world.add_vehicle().ill = GPS
    world.run(30.0)
    assert alarms(world) == []


def test_a_failure_on_the_ground_ends_no_mission() -> None:
    world = World()
    vehicle = world.add_vehicle(script=dataclasses.replace(PX4, ready_to_arm_after_s=20.0))
    world.run(3.0)
    world.edge.plan(first_flight())
    vehicle.ill = GPS
    world.run(6.0)
    vehicle.ill = 0
    assert alarms(world) == [(1, 5)]
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED


def test_a_vehicle_that_cannot_come_home_lands() -> None:
    world = flying_world(SLOW_PX4)
    vehicle = world.only_vehicle
    returns = {
        mavlink.MAV_CMD_DO_SET_MODE: mavlink.MAV_RESULT_DENIED,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: mavlink.MAV_RESULT_DENIED,
    }
    vehicle.script = dataclasses.replace(vehicle.script, results=returns)
    vehicle.ill = GPS
    world.run(8.0)
    assert vehicle.custom_mode == PX4_LAND


def test_a_camera_that_falls_silent_is_an_alarm() -> None:
    world = World()
    vehicle = world.add_vehicle()
    world.run(3.0)
    for _ in range(5):
        world.send_camera_heartbeat(vehicle)
        world.run(1.0)
    assert alarms(world) == []
    world.run(6.0)
    assert alarms(world) == [(1, 4)]


def test_a_lost_link_is_no_failure_of_a_camera() -> None:
    world = World()
    vehicle = world.add_vehicle()
    world.run(3.0)
    world.send_camera_heartbeat(vehicle)
    world.run(0.5)
    vehicle.silent = True
    world.run(30.0)
    assert alarms(world) == []


def flying_with_a_camera(journal: Path) -> World:
    """A vehicle in flight, of whose camera three heartbeats were received."""
    world = World(journal=journal)
    vehicle = world.add_vehicle(script=SLOW_PX4)
    world.edge.plan(first_flight())
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    for _ in range(3):
        world.send_camera_heartbeat(vehicle)
        world.run(1.0)
    return world


@pytest.mark.parametrize("away_s", [0.5, 4.0, 12.0])
def test_a_camera_that_fails_while_the_broker_is_away_is_one_alarm(
    away_s: float, tmp_path: Path
) -> None:
    world = flying_with_a_camera(tmp_path)
    world.kill_broker()
    world.run(away_s)
    world.restart_broker()
    world.run(8.0)
    assert alarms(world) == [(1, 4)]
    assert world.edge.status(1201) == Status.FAILED
    world.restart_broker()
    world.run(8.0)
    assert alarms(world) == [(1, 4)]


@pytest.mark.parametrize("heartbeats", [1, 2])
def test_a_camera_that_is_received_behind_a_restart_and_falls_silent_is_an_alarm(
    heartbeats: int, tmp_path: Path
) -> None:
    world = flying_with_a_camera(tmp_path)
    world.restart_broker()
    for _ in range(heartbeats):
        world.send_camera_heartbeat(world.only_vehicle)
        world.run(1.0)
    world.run(8.0)
    assert alarms(world) == [(1, 4)]


def test_a_camera_that_was_hardly_received_is_not_expected_behind_a_restart(
    tmp_path: Path,
) -> None:
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=SLOW_PX4)
    world.edge.plan(first_flight())
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.send_camera_heartbeat(vehicle)
    world.run(1.0)
    world.restart_broker()
    world.run(8.0)
    assert alarms(world) == []


def test_a_camera_that_is_received_behind_a_restart_is_no_alarm(tmp_path: Path) -> None:
    world = flying_with_a_camera(tmp_path)
    world.restart_broker()
    for _ in range(8):
        world.run(1.0)
        world.send_camera_heartbeat(world.only_vehicle)
    assert alarms(world) == []


def test_a_camera_that_was_taken_off_after_the_flight_is_not_expected(tmp_path: Path) -> None:
    world = flying_with_a_camera(tmp_path)
    while world.edge.status(1201) == Status.RUNNING:
        world.send_camera_heartbeat(world.only_vehicle)
        world.run(1.0)
    assert world.edge.status(1201) == Status.FINISHED
    world.run_until(lambda: not world.only_vehicle.armed)
    world.run(0.5)
    world.restart_broker()
    world.run(8.0)
    assert alarms(world) == []


@pytest.mark.first_case
@pytest.mark.parametrize("bit", [GPS, mavlink.MAV_SYS_STATUS_GEOFENCE])
@pytest.mark.parametrize("script", [SLOW_PX4, SLOW_COPTER], ids=["px4", "ardupilot"])
@pytest.mark.parametrize("lead_s", [0.6, 1.6, -1.0])
def test_a_part_that_fails_near_a_restart_of_the_broker_is_one_alarm(
    bit: int, script: Script, lead_s: float, tmp_path: Path
) -> None:
    """It has failed before the broker is killed, by `lead_s`, or while it is away."""
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=script)
    world.edge.plan(first_flight())
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING and vehicle.airborne)
    world.run(4.0)
    if lead_s > 0.0:
        vehicle.ill = bit
        world.run(lead_s)
    world.kill_broker()
    world.run(1.0)
    vehicle.ill = bit
    world.restart_broker()
    world.run(8.0)
    assert len(alarms(world)) == 1
    assert world.edge.status(1201) == Status.FAILED
    world.restart_broker()
    world.run(8.0)
    assert len(alarms(world)) == 1


def test_a_part_that_fails_while_the_link_is_away_is_an_alarm() -> None:
    world = flying_world(SLOW_PX4)
    world.run(3.0)
    world.air.is_downlink_up = False
    world.run(8.0)
    world.only_vehicle.ill = GPS
    world.air.is_downlink_up = True
    world.run(8.0)
    assert alarms(world) == [(1, 5)]


def test_a_part_that_is_ill_since_the_vehicle_was_armed_is_none(tmp_path: Path) -> None:
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle(script=SLOW_PX4)
    vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION
    world.edge.plan(first_flight())
    world.run_until(lambda: vehicle.airborne)
    world.restart_broker()
    world.run(8.0)
    assert alarms(world) == []


def test_what_was_healthy_in_a_flight_is_not_expected_in_the_next(tmp_path: Path) -> None:
    world = World(journal=tmp_path)
    vehicle = world.add_vehicle()
    world.edge.plan(first_flight())
    world.run_until_over(1201)
    world.run_until(lambda: not vehicle.armed)
    world.run(2.0)
    world.kill_broker()
    vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION
    world.restart_broker()
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until_over(1202)
    assert alarms(world) == []
    assert world.edge.status(1202) == Status.FINISHED


def test_a_signal_that_was_healthy_is_noted_before_it_is_received_again() -> None:
    monitor = AlarmMonitor()
    monitor.expect_healthy(["SYS_STATUS: GPS lost"])
    assert monitor.healthy == ("SYS_STATUS: GPS lost",)


def test_a_part_that_fails_is_reported_and_not_what_fails_with_it() -> None:
    world = flying_world(SLOW_PX4)
    world.only_vehicle.ill = GPS | mavlink.MAV_SYS_STATUS_AHRS
    world.run(8.0)
    assert alarms(world) == [(1, 5)]


def test_what_fails_with_a_part_is_reported_when_it_outlasts_it() -> None:
    world = World()
    vehicle = world.add_vehicle()
    world.run(3.0)
    vehicle.ill = GPS | mavlink.MAV_SYS_STATUS_AHRS
    world.run(8.0)
    vehicle.ill = mavlink.MAV_SYS_STATUS_AHRS
    world.run(8.0)
    assert alarms(world) == [(1, 5), (2, 50)]


@pytest.mark.thorough
def test_a_px4_that_rests_on_the_ground_knows_where_it_is() -> None:
    """It sets ESTIMATOR_CONST_POS_MODE whenever it is at rest: 0x37F becomes 0x3FF."""
    world = World()
    vehicle = world.add_vehicle()

    def rest(flags: int, seconds: int) -> None:
        for _ in range(seconds):
            world.send_from(vehicle, mavlink.MAVLink_estimator_status_message(0, flags, *[0.0] * 8))
            world.run(1.0)

    world.edge.plan(mission(takeoff(1), land(2), takeoff(3), go_home(4)))
    world.run_until(lambda: vehicle.airborne)
    rest(0x37F, 3)
    world.run_until(lambda: not vehicle.airborne)
    rest(0x3FF, 6)
    world.run_until_over(1201)
    assert alarms(world) == []
    assert world.edge.statuses(1201) == [Status.FINISHED] * 4


ALL_KNOWN = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_POS_HORIZ_ABS | 0x26


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("well", "ill", "alarm"),
    [
        (
            mavlink.MAVLink_estimator_status_message(0, ALL_KNOWN, *[0.0] * 8),
            mavlink.MAVLink_estimator_status_message(0, ALL_KNOWN & ~16, *[0.0] * 8),
            (2, 50),
        ),
        (
            mavlink.MAVLink_ekf_status_report_message(ALL_KNOWN, *[0.0] * 6),
            mavlink.MAVLink_ekf_status_report_message(ALL_KNOWN & ~16 | 128, *[0.0] * 6),
            (2, 50),
        ),
        (
            mavlink.MAVLink_fence_status_message(0, 0, 0, 0, 0),
            mavlink.MAVLink_fence_status_message(1, 1, mavlink.FENCE_BREACH_MAXALT, 0, 0),
            (2, 52),
        ),
        (
            mavlink.MAVLink_battery_status_message(
                1, 1, 1, 32767, [12000] + [65535] * 9, 100, 0, -1, 30, 0, 2
            ),
            mavlink.MAVLink_battery_status_message(
                1, 1, 1, 32767, [9000] + [65535] * 9, 100, 0, -1, 1, 0, 4
            ),
            (2, 51),
        ),
    ],
    ids=["PX4's estimator", "ArduPilot's estimator", "fence", "battery"],
)
def test_each_autopilots_message_of_a_failure_raises_the_same_alarm(
    well: Message, ill: Message, alarm: tuple[int, int]
) -> None:
    world = flying_world(SLOW_PX4)
    for message in (well, ill):
        for _ in range(5):
            world.send_from(world.only_vehicle, message)
            world.run(1.0)
    assert alarms(world) == [alarm]
    assert world.edge.status(1201) == Status.FAILED


def test_a_low_battery_is_no_alarm() -> None:
    world = flying_world(SLOW_PX4)
    for charge_state in (1, 2, 3):
        for _ in range(5):
            battery = mavlink.MAVLink_battery_status_message(
                1, 1, 1, 32767, [11000] + [65535] * 9, 100, 0, -1, 15, 0, charge_state
            )
            world.send_from(world.only_vehicle, battery)
            world.run(0.5)
    assert alarms(world) == []


def send_charge_state(world: World, charge_state: int, seconds: float = 4.0) -> None:
    battery = mavlink.MAVLink_battery_status_message(
        1, 1, 1, 32767, [11000] + [65535] * 9, 100, 0, -1, 15, 0, charge_state
    )
    for _ in range(round(seconds)):
        world.send_from(world.only_vehicle, battery)
        world.run(1.0)


def test_an_empty_battery_that_recovers_for_moments_is_one_alarm_of_its_flight() -> None:
    world = flying_world(SLOW_PX4)
    vehicle = world.only_vehicle
    send_charge_state(world, 1)
    send_charge_state(world, mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY)
    assert len(alarms(world)) == 1
    vehicle.armed = vehicle.airborne = False
    for _ in range(3):
        send_charge_state(world, mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL)
        send_charge_state(world, mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY)
    assert len(alarms(world)) == 1
    send_charge_state(world, 1)
    vehicle.set_mode(PX4_POSITION)  # A pilot flies with another battery
    vehicle.armed = vehicle.airborne = True
    send_charge_state(world, 1)
    send_charge_state(world, mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY)
    assert len(alarms(world)) == 2


def test_propulsion_that_fails_behind_an_empty_battery_is_an_alarm_of_its_own() -> None:
    world = flying_world(SLOW_PX4)
    send_charge_state(world, 1)
    send_charge_state(world, mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY)
    send_charge_state(world, mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL)
    world.only_vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_PROPULSION
    world.run(4.0)
    failed = (AlarmType.FUNCTION_UNAVAILABLE, AlarmCode.FUNCTION_PROPULSION)
    assert alarms(world) == [failed, failed]


def hygrometer(humidity: int = 4800) -> Message:
    return mavlink.MAVLink_hygrometer_sensor_message(0, 2150, humidity)


def send_for(
    world: World, seconds: float, message: Message | None = None, share: float = 1.0
) -> None:
    """Let the humidity sensor send every second, except for lost frames."""
    for second in range(round(seconds)):
        if (second * 7) % 10 < share * 10:
            world.send_from(world.only_vehicle, message or hygrometer(), component=25)
        world.run(1.0)


@pytest.mark.thorough
def test_a_humidity_sensor_that_falls_silent_is_that_alarm() -> None:
    world = flying_world(SLOW_PX4)
    send_for(world, 6.0)
    assert alarms(world) == []
    world.run(3.5)
    assert alarms(world) == []
    world.run(1.0)
    assert alarms(world) == [(1, 6)]
    world.run(10.0)
    assert alarms(world) == [(1, 6)]


@pytest.mark.thorough
def test_a_humidity_sensor_that_measures_nothing_is_the_other_alarm() -> None:
    world = flying_world(SLOW_PX4)
    send_for(world, 4.0)
    send_for(world, 6.0, hygrometer(65_535))
    assert alarms(world) == [(2, 53)]
    assert world.edge.status(1201) == Status.FAILED


def test_a_named_humidity_is_watched_too() -> None:
    world = flying_world(SLOW_PX4)
    send_for(world, 4.0, mavlink.MAVLink_named_value_float_message(1, b"hum_air", 48.0))
    world.run(7.0)
    assert alarms(world) == [(1, 6)]


@pytest.mark.thorough
def test_a_vehicle_without_a_humidity_sensor_has_not_lost_it() -> None:
    world = flying_world(SLOW_PX4)
    send_for(world, 1.0)
    world.run(20.0)
    assert alarms(world) == []


def test_a_lost_link_is_no_failure_of_the_humidity_sensor() -> None:
    world = World()
    vehicle = world.add_vehicle()
    world.run(3.0)
    send_for(world, 4.0)
    vehicle.silent = True
    world.run(30.0)
    vehicle.silent = False
    send_for(world, 10.0)
    assert alarms(world) == []


@pytest.mark.thorough
def test_on_a_bad_link_silence_has_to_last_longer() -> None:
    world = World(loss=0.3, seed=4, tick_s=0.05)
    vehicle = world.add_vehicle()
    world.run(30.0)
    send_for(world, 8.0)
    world.run(6.0)
    assert alarms(world) == []
    world.run_until(lambda: alarms(world))
    world.run(60.0)
    assert alarms(world) == [(1, 6)]  # Once, however the link changes
    assert not vehicle.silent


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "mode"), [(SLOW_PX4, PX4_RETURN), (SLOW_COPTER, COPTER_RETURN), (SLOW_PX4, PX4_LAND)]
)
@pytest.mark.parametrize("text", ["Critical battery, returning", "GCS connection lost"])
def test_what_a_failsafe_does_is_no_alarm_by_itself(script: Script, mode: int, text: str) -> None:
    """A low battery or a lost link has no code in AFarCloud's table; the report has the reason."""
    world = flying_world(script)
    world.only_vehicle.send_status_text(text)
    world.only_vehicle.fail_safe(mode)
    world.run(9.0)
    assert alarms(world) == []
    assert world.edge.status(1201) == Status.FAILED
    message = world.edge.reports(1201)[-1]["message"]
    assert "its own failsafe flies it" in message
    assert text in message


@pytest.mark.first_case
@pytest.mark.parametrize("text", ["Wind too strong: RETURN", "Wind speed is above limit"])
def test_a_failsafe_for_too_much_wind_is_a_navigation_failure(text: str) -> None:
    world = flying_world(SLOW_PX4)
    world.only_vehicle.send_status_text(text)
    world.only_vehicle.fail_safe(PX4_RETURN)
    world.run(9.0)
    assert alarms(world) == [(2, 52)]
    assert world.edge.status(1201) == Status.FAILED


def test_a_vehicle_that_stops_its_mission_is_a_mission_error() -> None:
    world = flying_world(SLOW_PX4)
    world.only_vehicle.give_up()
    world.run(9.0)
    assert alarms(world) == [(2, 52)]
    (alarm,) = world.edge.bodies("/alarm/")
    assert alarm["mission_id"] == 1201
    assert "given up the mission" in alarm["message"]
    paths = [post.path for post in world.edge.posts]
    assert paths.index("/alarm/") < len(paths) - 1 - paths[::-1].index("/mission_report/")


def test_a_pilot_who_takes_over_is_no_failure() -> None:
    world = flying_world(SLOW_PX4)
    world.only_vehicle.set_mode(PX4_POSITION)
    world.run(8.0)
    assert world.edge.status(1201) == Status.FAILED
    assert alarms(world) == []
