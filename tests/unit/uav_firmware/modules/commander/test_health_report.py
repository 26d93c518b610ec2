"""The SYS_STATUS bits that ground stations receive."""

import math

import pytest

from tests.support.toy_vehicle import ToyVehicle, takeoff, waypoint
from uav_firmware.modules.commander.health_report import SensorBit
from uav_firmware.msg.estimate import TerrainEstimate
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.sensors import SensorRange


def fence_kept(vehicle: ToyVehicle) -> bool:
    """Whether ground stations receive that no boundary is crossed."""
    vehicle.run(0.5)
    status = vehicle.status.value
    assert status is not None
    assert status.sensors_present & SensorBit.GEOFENCE
    return bool(status.sensors_health & SensorBit.GEOFENCE)


def test_without_a_geofence_no_breach_is_reported() -> None:
    assert fence_kept(ToyVehicle())


def test_a_vehicle_that_stands_outside_its_fence_shows_it_until_the_fence_has_grown() -> None:
    vehicle = ToyVehicle()
    vehicle.run(0.5)
    vehicle.position = (50.0, 0.0, 0.0)
    vehicle.registry.set("GF_MAX_HOR_DIST", 60.0)
    assert fence_kept(vehicle)
    vehicle.registry.set("GF_MAX_HOR_DIST", 20.0)
    assert not fence_kept(vehicle)
    vehicle.registry.set("GF_MAX_HOR_DIST", 100.0)
    assert fence_kept(vehicle)


def test_a_breach_in_flight_shows_and_goes_away() -> None:
    vehicle = ToyVehicle()
    vehicle.registry.set("GF_ACTION", 1.0)
    vehicle.run(0.5)
    vehicle.upload(takeoff(), waypoint(1, 200, 0))
    vehicle.run(0.1)
    vehicle.set_mode(4)
    vehicle.arm()
    vehicle.run_until(lambda v: v.position[0] > 20.0)
    vehicle.registry.set("GF_MAX_HOR_DIST", 10.0)
    assert not fence_kept(vehicle)
    vehicle.registry.set("GF_MAX_HOR_DIST", 0.0)
    assert fence_kept(vehicle)


def ill(vehicle: ToyVehicle) -> int:
    """What is present, in use and not healthy."""
    vehicle.run(0.5)
    status = vehicle.status.value
    assert status is not None
    return status.sensors_present & status.sensors_enabled & ~status.sensors_health


@pytest.mark.parametrize(
    ("failed_motors", "weak", "bit"),
    [
        (0, False, 0),
        (0b0010, False, SensorBit.MOTOR_OUTPUTS),
        (0b0110, False, SensorBit.PROPULSION),
        (0, True, SensorBit.PROPULSION),
    ],
)
def test_a_failed_motor_is_a_part_and_more_of_them_are_the_propulsion(
    failed_motors: int, weak: bool, bit: int
) -> None:
    vehicle = ToyVehicle()
    vehicle.run(1.0)
    vehicle.failure.publish(
        FailureDetectorStatus(vehicle.now_us, False, False, failed_motors, weak)
    )
    both = SensorBit.MOTOR_OUTPUTS | SensorBit.PROPULSION
    assert ill(vehicle) & both == bit


def test_a_range_finder_is_present_once_received_and_unhealthy_when_lost() -> None:
    vehicle = ToyVehicle()
    vehicle.run(1.0)
    assert vehicle.status.value is not None
    assert not vehicle.status.value.sensors_present & SensorBit.LASER_POSITION
    vehicle.range_finder.publish(SensorRange(vehicle.now_us, 1.0, 0.1, 40.0))
    assert not ill(vehicle) & SensorBit.LASER_POSITION
    vehicle.run(5.0)
    assert ill(vehicle) & SensorBit.LASER_POSITION


def test_a_stuck_range_finder_is_unhealthy_until_it_follows_again() -> None:
    vehicle = ToyVehicle()
    vehicle.run(1.0)
    for has_failed in (False, True, False):
        vehicle.range_finder.publish(SensorRange(vehicle.now_us, 1.0, 0.1, 40.0))
        ground = TerrainEstimate(vehicle.now_us, math.nan if has_failed else 0.0, has_failed)
        vehicle.topics.terrain_estimate.publish(ground)
        assert bool(ill(vehicle) & SensorBit.LASER_POSITION) is has_failed


def test_who_has_a_fix_and_no_position_has_lost_the_estimate() -> None:
    vehicle = ToyVehicle()
    vehicle.run(1.0)
    assert not ill(vehicle) & SensorBit.AHRS
    vehicle.position_valid = False
    assert ill(vehicle) & SensorBit.AHRS
    vehicle.fix_type = 1
    assert not ill(vehicle) & SensorBit.AHRS
    assert ill(vehicle) & SensorBit.GPS


def test_a_dead_inertial_sensor_is_blamed_alone() -> None:
    vehicle = ToyVehicle()
    vehicle.run(1.0)
    vehicle.imu_is_dead = True
    vehicle.failure.publish(FailureDetectorStatus(vehicle.now_us, False, False, 0, True))
    blamed = ill(vehicle)
    assert blamed & SensorBit.GYRO_3D
    assert not blamed & (SensorBit.AHRS | SensorBit.PROPULSION)


def test_a_gyroscope_beyond_its_bias_is_blamed_alone() -> None:
    vehicle = ToyVehicle()
    vehicle.run(1.0)
    vehicle.gyro_broken = True
    assert ill(vehicle) & ~SensorBit.PREARM_CHECK == SensorBit.GYRO_3D
