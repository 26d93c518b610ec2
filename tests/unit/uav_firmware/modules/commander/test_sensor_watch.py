"""The SYS_STATUS bits that ground stations judge the vehicle by."""

from tests.support.toy_vehicle import ToyVehicle, takeoff, waypoint
from uav_firmware.modules.commander.sensor_watch import SensorBit


def fence_kept(vehicle: ToyVehicle) -> bool:
    """Whether ground stations are told that no boundary is crossed."""
    vehicle.run(0.5)
    status = vehicle.status.value
    assert status is not None
    assert status.sensors_present & SensorBit.GEOFENCE
    return bool(status.sensors_health & SensorBit.GEOFENCE)


def test_without_a_fence_no_breach_is_told() -> None:
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
