"""What a plan enters though it must not: faults of its own geofence, warnings of fields.

Fields are drawn and changed apart from plans, so that a no-fly area may be newer than a plan: at
each post, change and dispatch, the warnings name which vehicle enters which. To compare takes up to
seconds, and an abort must not wait: it is done before a transaction, for one plan at a time, so
that an abort gets half of the interpreter however many are posted.
"""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from afarcloud import rules
from afarcloud.area import TooManyComparisonsError
from afarcloud.faults import Fault
from afarcloud.fence_check import FenceCheck
from afarcloud.flyable import first_place
from afarcloud.geometry import contains, distance_m
from afarcloud.plan import Geofence, Mission, Plan, Polygon
from afarcloud.rules import FenceVerdict
from edge_server.services.context import Context
from edge_server.services.planning import fields

MOST_COMPARED: Final = 300
"""No-fly areas, those nearest to a mission's first place: a request waits for the comparison."""


class NoFlyArea(NamedTuple):
    """One ring of a field; the areas of a field are numbered from 1, as the console does."""

    field: int
    number: int
    ring: Polygon


def check(context: Context, plan: Plan) -> FenceVerdict:
    """Check a plan against its own geofence and the fields, while no other plan is checked."""
    areas = [
        NoFlyArea(identifier, number, ring)
        for identifier, field in fields.oldest(context)
        for number, ring in enumerate(field.exclusions, 1)
    ]
    if plan.geofence is None and not areas:
        return rules.check_fence(plan)
    with context.fence_check:
        return rules.check_fence(plan)._replace(warnings=_entered(plan, areas))


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
    begins = first.latitude_deg, first.longitude_deg
    nearest = sorted(areas, key=lambda one: min(distance_m(begins, it) for it in one.ring))
    for area in nearest[:MOST_COMPARED]:
        if contains(area.ring, begins):
            continue
        vehicle_id, (field, number, ring) = mission.vehicle_id, area
        check = FenceCheck(Geofence(exclusion=(ring,)))
        try:
            entered = next(check.faults(mission.command_array), None)
        except TooManyComparisonsError:
            text = (
                f"vehicle {vehicle_id} and no-fly area {number} of field {field} are not compared"
            )
            yield Fault(path, f"{text}: too many corners")
            continue
        if entered is not None:
            step = entered.command
            text = f"vehicle {vehicle_id} enters no-fly area {number} of field {field}"
            place = f"{path}.command_array.{step}.parameters"
            yield Fault(place, f"{text} on the way to step {step + 1}")
