"""Failures of a vehicle: told once, and the end of the mission that flies."""

import dataclasses

import pytest

from afarcloud.enumerations import AlarmCode, AlarmType, Status
from mavlink_broker.dialect import mavlink
from mavlink_broker.session_states import State
from tests.support.broker_world import World, first_flight, flying_world
from tests.support.scripted_vehicle import PX4, PX4_LAND, PX4_RETURN

GPS = mavlink.MAV_SYS_STATUS_SENSOR_GPS
SLOW = dataclasses.replace(PX4, item_time_s=10.0)


def alarms(world: World) -> list[tuple[int, int]]:
    bodies = world.edge.bodies("/alarm/")
    return [(body["alarm_type_id"], body["alarm_code_id"]) for body in bodies]


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
def test_a_failure_in_flight_is_told_and_ends_the_mission(bit: int, code: AlarmCode) -> None:
    world = flying_world(SLOW)
    vehicle = world.only_vehicle
    world.run_until(lambda: world.edge.statuses(1201)[0] == Status.FINISHED)
    vehicle.ill = bit
    world.run(4.0)
    kind = AlarmType.EQUIPMENT_FAILURE if code < 50 else AlarmType.FUNCTION_UNAVAILABLE
    assert alarms(world) == [(kind, code)]
    assert world.edge.bodies("/alarm/")[0]["mission_id"] == 1201
    assert world.edge.statuses(1201) == [Status.FINISHED, Status.FAILED, Status.ABORTED]
    assert world.edge.status(1201) == Status.FAILED
    assert vehicle.custom_mode == PX4_RETURN
    world.run_until(lambda: not vehicle.armed)
    world.run(3.0)
    assert world.app.sessions[1].state is State.IDLE


def test_a_moment_is_no_failure() -> None:
    world = flying_world(SLOW)
    world.only_vehicle.ill = GPS
    world.run(1.0)
    world.only_vehicle.ill = 0
    world.run(10.0)
    assert alarms(world) == []
    assert world.edge.status(1201) == Status.RUNNING


def test_a_failure_is_told_once_and_again_after_it_was_over() -> None:
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
    world = flying_world(SLOW)
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
        world.hear_camera(vehicle)
        world.run(1.0)
    assert alarms(world) == []
    world.run(6.0)
    assert alarms(world) == [(1, 4)]


def test_a_lost_link_is_no_failure_of_a_camera() -> None:
    world = World()
    vehicle = world.add_vehicle()
    world.run(3.0)
    world.hear_camera(vehicle)
    world.run(0.5)
    vehicle.silent = True
    world.run(30.0)
    assert alarms(world) == []
