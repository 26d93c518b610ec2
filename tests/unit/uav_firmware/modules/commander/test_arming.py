"""Arming: the table, the checks with their sentences, and disarming by itself."""

from collections.abc import Callable
from itertools import product

import pytest

from tests.support.toy_vehicle import NAN, ToyVehicle, at, item, takeoff, waypoint
from tests.unit.uav_firmware.modules.navigator.test_modes import airborne
from uav_firmware.modules.commander.arm_state_machine import (
    TRANSITIONS,
    Arming,
    ArmingEvent,
    IllegalArmingError,
    after,
)
from uav_firmware.modules.commander.health_report import SensorBit
from uav_firmware.msg.estimate import WindEstimate
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.geofence import Fence
from uav_firmware.msg.status import (
    Command,
    CommandResult,
    NavigationState,
    StorageStatus,
    VehicleStatus,
)

ACCEPTED = CommandResult.ACCEPTED
NOT_NOW = CommandResult.TEMPORARILY_REJECTED


@pytest.mark.parametrize(("state", "event"), list(product(Arming, ArmingEvent)))
def test_only_the_pairs_of_the_table_change_anything(state: Arming, event: ArmingEvent) -> None:
    if (state, event) in TRANSITIONS:
        assert after(state, event) is not state
    else:
        with pytest.raises(IllegalArmingError, match=event.name):
            after(state, event)


def status_of(vehicle: ToyVehicle) -> VehicleStatus:
    assert vehicle.status.value is not None
    return vehicle.status.value


def lose_alignment(vehicle: ToyVehicle) -> None:
    vehicle.aligned = False


def lose_position(vehicle: ToyVehicle) -> None:
    vehicle.position_valid = False


def lose_fix(vehicle: ToyVehicle) -> None:
    vehicle.fix_type = 1


def drain_battery(vehicle: ToyVehicle) -> None:
    vehicle.battery = 0.1


def fall_over(vehicle: ToyVehicle) -> None:
    vehicle.roll = 1.2


def silence(name: str) -> Callable[[ToyVehicle], None]:
    def silent(vehicle: ToyVehicle) -> None:
        vehicle.silent.add(name)

    return silent


def bias_gyroscope(vehicle: ToyVehicle) -> None:
    vehicle.gyro_broken = True


def disagree(vehicle: ToyVehicle) -> None:
    vehicle.innovation = 1.5


def move_on(vehicle: ToyVehicle) -> None:
    vehicle.drift = (2.0, 0.0, 0.0)


def lose_satellites(vehicle: ToyVehicle) -> None:
    vehicle.satellites = 4


def lose_accuracy(vehicle: ToyVehicle) -> None:
    vehicle.accuracy = 9.0


def break_motor(vehicle: ToyVehicle) -> None:
    vehicle.failure.publish(
        FailureDetectorStatus(0, roll_exceeded=False, pitch_exceeded=False, failed_motors=2)
    )


def storm(vehicle: ToyVehicle) -> None:
    vehicle.wind_estimate.publish(WindEstimate(vehicle.now_us, 0.0, -20.0))


def fill_storage(vehicle: ToyVehicle) -> None:
    vehicle.registry.set("COM_ARM_SDCARD", 2)
    vehicle.storage.publish(StorageStatus(vehicle.now_us, 3_000_000, refused=False))


def stand_outside(vehicle: ToyVehicle) -> None:
    forbidden = item(0, 5004, param1=5.0, frame=0, **at(0.0, 0.0))
    vehicle.fence.publish(Fence(vehicle.now_us, 1, (forbidden,)))


FAULTS = [
    (bias_gyroscope, "Gyroscope bias", SensorBit.GYRO_3D),
    (disagree, "Estimate and GPS velocity disagree", SensorBit.PREARM_CHECK),
    (move_on, "Vehicle moves at 2.0 m/s", SensorBit.PREARM_CHECK),
    (lose_satellites, "GPS uses only 4 satellites", SensorBit.PREARM_CHECK),
    (lose_accuracy, "Position accurate to 9 m only", SensorBit.PREARM_CHECK),
    (break_motor, "Motor 2 failed", SensorBit.PREARM_CHECK),
    (storm, "Wind 20 m/s, above 14", SensorBit.PREARM_CHECK),
    (fill_storage, "Storage full: 3 MB left", SensorBit.PREARM_CHECK),
    (stand_outside, "Outside the geofence", SensorBit.PREARM_CHECK),
    (lose_alignment, "Attitude and heading", SensorBit.AHRS),
    (lose_position, "Position", SensorBit.XY_POSITION_CONTROL),
    (lose_fix, "no 3D fix", SensorBit.GPS),
    (drain_battery, "Battery at 10%", SensorBit.PREARM_CHECK),
    (fall_over, "Tilted by 69 degrees", SensorBit.PREARM_CHECK),
    (silence("imu"), "Inertial sensor", SensorBit.GYRO_3D),
    (silence("baro"), "Barometer", SensorBit.ABSOLUTE_PRESSURE),
    (silence("mag"), "Magnetometer", SensorBit.MAG_3D),
    (silence("gps"), "GPS", SensorBit.GPS),
    (silence("battery"), "Battery monitor", SensorBit.BATTERY),
]


@pytest.mark.parametrize(("fault", "sentence", "bit"), FAULTS)
def test_a_fault_keeps_the_vehicle_disarmed_and_is_reported(
    fault: Callable[[ToyVehicle], None], sentence: str, bit: SensorBit
) -> None:
    vehicle = ToyVehicle()
    vehicle.run(1.0)
    before = status_of(vehicle)
    fault(vehicle)
    vehicle.run(3.0)
    assert vehicle.arm() is NOT_NOW
    after_fault = status_of(vehicle)
    assert not after_fault.armed
    assert any(sentence in text for text in vehicle.texts)
    assert (before.preflight_checks_pass, after_fault.preflight_checks_pass) == (True, False)
    assert before.sensors_health & bit
    assert not after_fault.sensors_health & bit
    assert not after_fault.sensors_health & SensorBit.PREARM_CHECK


def test_a_healthy_vehicle_is_reported_healthy_in_flight_and_landing() -> None:
    vehicle = airborne()
    place = at(40.0, 0.0)
    values = (-1.0, 1.0, 0.0, NAN, place["x"], place["y"], NAN)
    assert vehicle.send(Command.DO_REPOSITION, *values) is ACCEPTED
    for command in (None, Command.NAV_RETURN_TO_LAUNCH, Command.NAV_LAND):
        if command is not None:
            assert vehicle.send(command) is ACCEPTED
        vehicle.run(2.0)
        assert status_of(vehicle).sensors_health & SensorBit.PREARM_CHECK
    silence("mag")(vehicle)
    vehicle.run(3.0)
    assert status_of(vehicle).armed
    assert not status_of(vehicle).sensors_health & SensorBit.PREARM_CHECK


@pytest.mark.parametrize("setting", [0, 1])
def test_a_full_storage_alone_does_not_prevent_arming(setting: int) -> None:
    vehicle = ToyVehicle()
    vehicle.run(1.0)
    vehicle.registry.set("COM_ARM_SDCARD", setting)
    vehicle.storage.publish(StorageStatus(vehicle.now_us, 0, refused=True))
    vehicle.run(1.0)
    assert vehicle.arm() is ACCEPTED


def test_before_anything_is_known_the_vehicle_does_not_arm() -> None:
    vehicle = ToyVehicle(position_valid=False, aligned=False)
    assert vehicle.arm() is NOT_NOW
    assert vehicle.home.value is None


@pytest.mark.parametrize("force", [21196.0, 2989.0])
def test_force_arms_in_spite_of_a_fault(force: float) -> None:
    """MAVLink's number, and the one of QGroundControl's and Mission Planner's "force arm"."""
    vehicle = ToyVehicle(battery=0.1)
    vehicle.run(0.5)
    assert vehicle.arm() is NOT_NOW
    assert vehicle.send(Command.COMPONENT_ARM_DISARM, 1.0, force) is ACCEPTED
    assert vehicle.armed


def test_an_infeasible_mission_is_neither_started_nor_armed_for() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    vehicle.upload(takeoff(), item(1, 84))
    vehicle.run(0.1)
    assert vehicle.send(Command.MISSION_START) is NOT_NOW
    assert vehicle.mode is NavigationState.AUTO_LOITER
    assert vehicle.set_mode(4) is ACCEPTED
    assert vehicle.arm() is NOT_NOW
    assert any("item 1" in text for text in vehicle.texts)


@pytest.mark.parametrize(("lifting", "within_s"), [(False, 10.0), (True, 40.0)])
def test_armed_and_without_a_take_off_it_disarms(*, lifting: bool, within_s: float) -> None:
    """One that is tied down with its throttle up has the time of a slow take-off besides."""
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    assert vehicle.arm() is ACCEPTED
    vehicle.lifting = lifting
    armed = []
    for seconds in (within_s - 1.0, 1.5):
        vehicle.run(seconds)
        armed.append(vehicle.armed)
    assert armed == [True, False]
    assert "Disarmed: no take-off" in vehicle.texts


def test_one_that_takes_off_slowly_is_not_disarmed_in_its_first_centimetres() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    assert vehicle.arm() is ACCEPTED
    vehicle.lifting = True
    vehicle.run(15.0)
    assert vehicle.armed
    vehicle.lifting = False
    vehicle.run(10.5)
    assert not vehicle.armed


def test_two_seconds_after_landing_it_disarms_and_goes_to_hold() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    vehicle.upload(takeoff(), waypoint(1, 5, 0), item(2, 21, param4=0.0))
    vehicle.run(0.1)
    vehicle.set_mode(4)
    vehicle.arm()
    vehicle.run_until(lambda v: not v.landed)
    vehicle.run_until(lambda v: v.landed)
    landed_us = vehicle.now_us
    vehicle.run_until(lambda v: not v.armed, 5.0)
    assert 1.9 < (vehicle.now_us - landed_us) * 1e-6 < 2.2
    assert vehicle.mode is NavigationState.AUTO_LOITER


def test_a_landing_can_be_chosen_between_the_touchdown_and_the_disarming() -> None:
    vehicle = airborne()
    vehicle.send(Command.NAV_LAND)
    vehicle.run_until(lambda v: v.landed)
    vehicle.run(1.0)
    assert vehicle.armed
    for command in (Command.NAV_LAND, Command.NAV_RETURN_TO_LAUNCH):
        result = vehicle.send(command)
        assert result == (ACCEPTED if command is Command.NAV_LAND else NOT_NOW)
    vehicle.run_until(lambda v: not v.armed, 2.0)


def test_a_landing_ends_a_mission_that_waits_before_its_take_off() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    vehicle.upload(item(0, 93, param1=20.0), takeoff(1), waypoint(2, 50, 0))
    vehicle.run(0.1)
    vehicle.set_mode(4)
    vehicle.arm()
    vehicle.run(2.0)
    assert vehicle.send(Command.NAV_LAND) == ACCEPTED
    assert vehicle.mode is NavigationState.AUTO_LAND
    vehicle.run_until(lambda v: not v.armed, 15.0)
    assert vehicle.landed


def test_disarming_by_itself_can_be_switched_off() -> None:
    vehicle = ToyVehicle()
    vehicle.registry.set("COM_DISARM_PRFLT", -1.0)
    vehicle.run(0.5)
    vehicle.arm()
    vehicle.run(15.0)
    assert vehicle.armed


def test_state_is_published_on_change_and_twice_a_second() -> None:
    vehicle = ToyVehicle()
    vehicle.run(1.0)
    before = vehicle.status.count
    vehicle.run(2.0)
    assert vehicle.status.count - before in {4, 5}
    vehicle.arm()
    assert vehicle.armed


def test_a_mission_that_never_lifts_is_given_up_with_a_sentence() -> None:
    vehicle = ToyVehicle()
    vehicle.registry.set("COM_DISARM_MIS", 20.0)
    vehicle.run(0.5)
    vehicle.upload(item(0, 93, param1=300.0), takeoff(1))
    vehicle.run(0.1)
    assert vehicle.set_mode(4) == 0
    assert vehicle.arm() == 0
    vehicle.run(18.0)
    armed_before = vehicle.armed
    vehicle.run(3.0)
    assert (armed_before, vehicle.armed) == (True, False)
    assert "Disarmed: no take-off" in vehicle.texts
