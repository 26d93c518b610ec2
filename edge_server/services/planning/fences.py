"""What a plan enters though it must not: faults of its own geofence, warnings of fields.

Fields are drawn and changed apart from plans, so that a no-fly area may be newer than a plan: at
each post, change and dispatch, the warnings name which vehicle enters which. To compare takes up to
seconds, and an abort must not wait: it is done before a transaction, for one plan at a time, so
that an abort gets half of the interpreter however many are posted.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

from afarcloud import rules
from afarcloud.area import TooManyComparisonsError
from afarcloud.faults import Fault
from afarcloud.fence_check import FenceCheck
from afarcloud.flyable import first_place
from afarcloud.geodesy import shifted
from afarcloud.geometry import contains
from afarcloud.plan import Geofence, Mission, Plan, Vertex
from afarcloud.route import Leg, route_of
from afarcloud.rules import FenceVerdict
from edge_server.services.context import Context
from edge_server.services.planning import fields
from edge_server.services.planning.fields import NoFlyArea

MOST_COMPARED: Final = 300
"""No-fly areas beside the path of a mission: a request waits for the comparison."""


class _Box(NamedTuple):
    """Bounds in degrees; longitudes from that of a mission's first place."""

    south: float
    west: float
    north: float
    east: float

    def touches(self, other: "_Box") -> bool:
        """Whether two have something in common."""
        is_beside = self.east < other.west or other.east < self.west
        return not (is_beside or self.north < other.south or other.north < self.south)


def check(context: Context, plan: Plan) -> FenceVerdict:
    """Check a plan against its own geofence and the fields, while no other plan is checked."""
    if plan.geofence is None and not fields.have_no_fly_areas(context):
        return rules.check_fence(plan)
    with context.fence_check:
        warnings = _entered(plan, fields.no_fly_areas(context))
        return rules.check_fence(plan)._replace(warnings=warnings)


def _entered(plan: Plan, areas: Sequence[NoFlyArea]) -> tuple[Fault, ...]:
    """Name each area that a mission enters, once, with the first command that does."""
    return tuple(
        warning
        for index, mission in enumerate(plan.missions)
        for warning in _warnings(mission, f"missions.{index}", areas)
    )


def _warnings(mission: Mission, path: str, areas: Sequence[NoFlyArea]) -> Iterator[Fault]:
    """An area in which the mission begins is none for it: it may be the farmyard."""
    first = first_place(mission)
    if first is None:
        return
    begins, vehicle = first[:2], f"vehicle {mission.vehicle_id}"
    path_box = _box_of((begins, *_outline(mission)), begins)
    near = [one for one in areas if path_box.touches(_box_of(one.ring, begins))]
    for field, number, ring in near[:MOST_COMPARED]:
        check = FenceCheck(Geofence(exclusion=(ring,)))
        try:
            entered = next(check.faults(mission.command_array), None)
        except TooManyComparisonsError:
            text = f"{vehicle} and no-fly area {number} of field {field} are not compared"
            yield Fault(path, f"{text}: too many corners")
            continue
        if entered is not None and not contains(ring, begins):
            step = entered.command
            text = f"{vehicle} enters no-fly area {number} of field {field}"
            place = f"{path}.command_array.{step}.parameters"
            yield Fault(place, f"{text} on the way to step {step + 1}")
    if len(near) > MOST_COMPARED:
        more = len(near) - MOST_COMPARED
        yield Fault(path, f"{vehicle} and {more} no-fly areas near its path are not compared")


def _outline(mission: Mission) -> Iterator[Vertex]:
    """Give places round all of a mission's legs and circles."""
    for part in route_of(mission.command_array, None, None):
        if isinstance(part, Leg):
            yield from (spot[:2] for spot in (part.start, part.end) if spot is not None)
        else:
            for bearing_deg in (0.0, 90.0, 180.0, 270.0):
                yield shifted(*part.centre[:2], bearing_deg, part.radius_m)


def _box_of(places: Iterable[Vertex], origin: Vertex) -> _Box:
    latitudes_deg, longitudes_deg = zip(*places, strict=True)
    east_deg = [(one - origin[1] + 180.0) % 360.0 - 180.0 for one in longitudes_deg]
    return _Box(min(latitudes_deg), min(east_deg), max(latitudes_deg), max(east_deg))
