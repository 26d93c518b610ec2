"""A plan's geofence: its items for the vehicle, and the check of a mission against it. Pure.

Areas are items of mission type FENCE, rally points of type RALLY. Each corner of a polygon
carries the number of corners, in the order of the outline. Heights are not items: see
`mavlink_broker.autopilots.parameter_settings`.

`AreaCheck` holds a mission, as its vehicle will fly it, against the geofence. The laws are
`afarcloud.fence_check` and `afarcloud.flyable`, which the edge server asks too; here they get what
only the broker knows: where the vehicle stands, its home, and what its family makes of a command.
"""

from collections.abc import Sequence
from typing import Final

from afarcloud import flyable
from afarcloud.area import TooManyComparisonsError
from afarcloud.commands import Command, NavFollowTarget, NavHotpoint
from afarcloud.fence_check import FenceCheck, OutlineFault
from afarcloud.geodesy import distance_m
from afarcloud.plan import Geofence, Mission, RallyPoint
from afarcloud.route import Spot
from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.mission_item import MissionItem, from_message
from mavlink_broker.microservices.mission_protocol import (
    ALTITUDE_TOLERANCE_M,
    FENCE,
    POSITION_TOLERANCE_DEG,
    RALLY,
)
from mavlink_broker.planning.hotpoint import kept_radius_m
from mavlink_broker.planning.situation import Home, Refusal, RefusedError

CAPABILITIES: Final = {
    FENCE: mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE,
    RALLY: mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY,
}
"""Bits of AUTOPILOT_VERSION for vehicles that store such items."""
_RESEMBLES_WITHIN_M: Final = 20.0
"""Error of a vehicle that stores a place coarsely, or wrongly; another party's fence is
elsewhere."""
_HAS_RADIUS: Final = frozenset(
    {mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION}
)


def fence_items(geofence: Geofence | None) -> tuple[MissionItem, ...]:
    """Give the areas of a geofence, inclusions first."""
    if geofence is None:
        return ()
    inclusion: int = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    exclusion: int = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
    outlines = [(inclusion, outline) for outline in geofence.inclusion]
    outlines += [(exclusion, outline) for outline in geofence.exclusion]
    return tuple(
        MissionItem(
            command=command,
            frame=mavlink.MAV_FRAME_GLOBAL,
            parameters=(float(len(outline)), 0.0, 0.0, 0.0),
            latitude_deg=latitude,
            longitude_deg=longitude,
        )
        for command, outline in outlines
        for latitude, longitude in outline
    )


def rally_items(points: Sequence[RallyPoint]) -> tuple[MissionItem, ...]:
    """Give rally points, their heights above home."""
    return tuple(
        MissionItem(
            command=mavlink.MAV_CMD_NAV_RALLY_POINT,
            frame=mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
            latitude_deg=point.latitude,
            longitude_deg=point.longitude,
            altitude_m=point.altitude,
        )
        for point in points
    )


def items_of(messages: Sequence[Message]) -> tuple[MissionItem, ...]:
    """Parse downloaded items."""
    return tuple(map(from_message, messages))


def difference(
    wanted: Sequence[MissionItem],
    held: Sequence[MissionItem],
    *,
    tolerance_deg: float = POSITION_TOLERANCE_DEG,
    altitude_step_m: float = 0.0,
) -> str | None:
    """Name the first difference that matters, or None.

    Frame and altitude of an area have no meaning and may differ; its first parameter is a number of
    corners or a radius. A rally point's altitude may be rounded to steps.
    """
    if len(wanted) != len(held):
        return f"the vehicle holds {len(held)} items instead of {len(wanted)}"
    altitude_m = max(ALTITUDE_TOLERANCE_M, altitude_step_m)
    for number, (one, other) in enumerate(zip(wanted, held, strict=True)):
        is_rally = one.command == mavlink.MAV_CMD_NAV_RALLY_POINT
        tolerance_m = 0.01 if one.command in _HAS_RADIUS else 0.0
        same = {
            "command": one.command == other.command,
            "parameter 1": abs(one.parameters[0] - other.parameters[0]) <= tolerance_m,
            "latitude": abs(one.latitude_deg - other.latitude_deg) <= tolerance_deg,
            "longitude": abs(one.longitude_deg - other.longitude_deg) <= tolerance_deg,
            "altitude": not is_rally or abs(one.altitude_m - other.altitude_m) <= altitude_m,
        }
        name = next((name for name, is_same in same.items() if not is_same), None)
        if name is not None:
            return f"item {number} on the vehicle differs in {name}"
    return None


def resembles(held: Sequence[MissionItem], wanted: Sequence[MissionItem]) -> bool:
    """Whether a vehicle may hold what it was sent, changed in its storage; else it is another's."""
    if [item.command for item in held] != [item.command for item in wanted]:
        return False
    return all(
        distance_m(one.latitude_deg, one.longitude_deg, other.latitude_deg, other.longitude_deg)
        <= _RESEMBLES_WITHIN_M
        for one, other in zip(held, wanted, strict=True)
    )


def check_flyable(mission: Mission) -> None:
    """Check a mission against the limits of every vehicle.

    Raises:
        RefusedError: for the first command that no vehicle can fly.
    """
    for index, field, text in flyable.unflyable(mission):
        place = index or 0
        parameter = field.removeprefix("parameters.")
        raise RefusedError(place, mission.command_array[place], Refusal(parameter, text))


class AreaCheck:
    """Checks missions, positions and legs against one geofence."""

    def __init__(self, geofence: Geofence) -> None:
        self._check = FenceCheck(geofence)
        self.fault_of_order = self._check.fault_of_order

    def check(
        self,
        mission: Mission,
        family: Family,
        *,
        start: Spot | None,
        home: Home | None,
        rally: tuple[Spot, ...] = (),
        own_limit_m: float | None = None,
    ) -> None:
        """Check a mission from the vehicle's position on.

        An unknown `start` or `home` is not checked. `own_limit_m` is a height limit of the vehicle
        itself.

        Raises:
            RefusedError: for an invalid polygon, or the first command that leaves the geofence.
        """
        self._check.renew()
        for outline in self._check.outline_faults:
            raise _refused(outline, mission)
        faults = self._check.faults(
            as_flown(mission.command_array, family),
            start=start,
            home=None if home is None else Spot(home.latitude_deg, home.longitude_deg, 0.0),
            rally=rally,
            own_limit_m=own_limit_m,
        )
        try:
            fault = next(faults, None)
        except TooManyComparisonsError:
            raise _refused(self._check.too_many_comparisons, mission) from None
        if fault is not None:
            command = mission.command_array[fault.command]
            raise RefusedError(fault.command, command, Refusal(fault.parameter, fault.text))


def _refused(outline: OutlineFault, mission: Mission) -> RefusedError:
    """Give the error for a geofence that cannot be checked; it concerns the whole mission."""
    refusal = Refusal(f"geofence.{outline.field}", outline.text)
    return RefusedError(0, mission.command_array[0], refusal)


def as_flown(commands: tuple[Command, ...], family: Family) -> tuple[Command, ...]:
    """Give commands with the positions and heights at which a family's vehicles fly them."""
    return tuple(_as_flown(command, family) for command in commands)


def _as_flown(command: Command, family: Family) -> Command:
    match command:
        case NavFollowTarget(parameters=p) if p.altitude < family.lowest_follow_m:
            higher = p.model_copy(update={"altitude": family.lowest_follow_m})
            return command.model_copy(update={"parameters": higher})
        case NavHotpoint(parameters=p):
            kept = p.model_copy(update={"radius": kept_radius_m(p, family)})
            return command.model_copy(update={"parameters": kept})
        case _:
            return command
