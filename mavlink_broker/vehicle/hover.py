"""Whether a vehicle waits in the air where a mission of ours has left it.

Where that is has been noted, so that a broker that was killed meanwhile knows it again: a vehicle
that is armed at that place, and that nobody else flies, has not been anywhere since.
"""

from typing import Final

from afarcloud.geodesy import distance_m
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.recovery.record import Pose
from mavlink_broker.vehicle.control_authority import ON_THE_WAY, Claim, InCommand, in_command
from mavlink_broker.vehicle.vehicle import Vehicle

WITHIN_M: Final = 30.0
"""Horizontally, with wind and another satellite fix."""
AS_HIGH_WITHIN_M: Final = 15.0
_OURS: Final = Claim(ON_THE_WAY, is_exclusive=True)


def begin(vehicle: Vehicle) -> None:
    """Take that a mission has left it in the air."""
    place = vehicle.snapshot.position
    vehicle.hovers = True
    vehicle.hover = place and Pose(place.latitude_deg, place.longitude_deg, place.altitude_m)


def end(vehicle: Vehicle) -> None:
    """Take that it hovers no more, or for somebody else."""
    vehicle.hovers, vehicle.hover = False, None


def watch(vehicle: Vehicle) -> None:
    """See a landing, and whether a hover that an earlier run has noted goes on."""
    snapshot = vehicle.snapshot
    is_left = vehicle.hovers and not _is_ours(vehicle)
    if snapshot.armed is False or is_left:
        end(vehicle)
    elif vehicle.hover is not None and not vehicle.hovers and snapshot.armed is not None:
        _recognise(vehicle, vehicle.hover)


def _recognise(vehicle: Vehicle, noted: Pose) -> None:
    place = vehicle.snapshot.position
    if place is None or not vehicle.is_identified:
        return
    is_near = distance_m(*place[:2], *noted[:2]) <= WITHIN_M
    is_as_high = abs(place.altitude_m - noted.altitude_m) <= AS_HIGH_WITHIN_M
    stands = vehicle.snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    if is_near and is_as_high and not stands and _is_ours(vehicle):
        vehicle.hovers = True
    else:
        end(vehicle)


def _is_ours(vehicle: Vehicle) -> bool:
    """Whether nobody else has taken it since."""
    return in_command(vehicle.seen, _OURS) is InCommand.BROKER
