"""Pilots and ground stations that take a vehicle, and the wait of the next mission after them.

A person who has just landed a vehicle may be walking up to it: the broker does not arm it before
it has stood disarmed for a while.
"""

from typing import Final

from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.armed_period import STAND_S
from tests.support.broker_world import World, first_flight
from tests.support.scripted_vehicle import ScriptedVehicle

STATION: Final = 255
"""The system id of a ground station."""
LATE_S: Final = 10.0
"""What the broker needs at most between the end of a wait and its order to arm."""


def lands(vehicle: ScriptedVehicle) -> None:
    """The pilot lands and disarms the vehicle."""
    vehicle.armed = vehicle.airborne = vehicle.is_manual = False
    vehicle.heartbeat()


def acknowledge(vehicle: ScriptedVehicle, command: int, system: int = STATION) -> None:
    """The vehicle accepts an order: of the ground station, if nothing else is said."""
    vehicle.send(mavlink.MAVLink_command_ack_message(command, 0, target_system=system))


def assert_that_the_next_mission_waits(world: World, mission_id: int = 1202) -> int:
    """It comes now, and does not arm the vehicle before that has stood; gives its orders to arm."""
    before = world.only_vehicle.arm_orders
    world.edge.plan(first_flight(mission_id=mission_id))
    world.run(STAND_S - 1.0)
    assert world.only_vehicle.arm_orders == before
    return before
