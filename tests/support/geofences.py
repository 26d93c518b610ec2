"""Geofences and rally points: those of a plan, and those that an operator has put on a vehicle."""

from typing import Any

from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import World, first_flight
from tests.support.fenced_vehicle import FENCE, FencedVehicle
from tests.support.vehicle_script import HOME

INCLUSION, EXCLUSION = 5001, 5002
"""MAV_CMD of the corner of a polygon."""
RALLY_POINT = {"latitude": HOME[0] + 1e-4, "longitude": HOME[1], "altitude": 12.5}


def square(north_m: float = 0.0, half_m: float = 40.0) -> list[list[float]]:
    """A field round home, corners counter-clockwise."""
    half, middle = half_m * 9e-6, HOME[0] + north_m * 9e-6
    corners = [(-1, -1), (-1, 1), (1, 1), (1, -1)]
    return [[middle + n * half, HOME[1] + e * half * 1.3] for n, e in corners]


def fence(**more: Any) -> dict[str, Any]:
    """The geofence of a plan: a square round home, and what else is given."""
    return {"inclusion": [square()]} | more


def fly(world: World, geofence: dict[str, Any] | None, mission_id: int = 1201) -> None:
    """Fly a mission with this geofence to its end."""
    world.edge.plan(first_flight(mission_id), geofence=geofence)
    world.run_until_over(mission_id)


def placed(vehicle: FencedVehicle, corners: list[list[float]]) -> None:
    """An operator puts a fence there."""
    vehicle.plans[FENCE].items = [
        mavlink.MAVLink_mission_item_int_message(
            0,
            0,
            seq,
            0,
            INCLUSION,
            0,
            1,
            float(len(corners)),
            0.0,
            0.0,
            0.0,
            round(latitude * 1e7),
            round(longitude * 1e7),
            0.0,
            FENCE,
        )
        for seq, (latitude, longitude) in enumerate(corners)
    ]
