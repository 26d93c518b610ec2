"""Holds a mission, as its vehicle will fly it, against the geofence of its plan. Pure.

The laws are `afarcloud.fence_check` and `afarcloud.flyable`, which the edge server asks too; here
they get what only the broker knows: where the vehicle stands, its home, and what its family makes
of a command.
"""

from afarcloud import flyable
from afarcloud.area import TooManyComparisonsError
from afarcloud.commands import Command, NavFollowTarget, NavHotpoint
from afarcloud.fence_check import FenceCheck, OutlineFault
from afarcloud.plan import Geofence, Mission
from mavlink_broker.autopilots.families import Family
from mavlink_broker.planning.hotpoint import kept_radius_m
from mavlink_broker.planning.situation import Home, Refusal, RefusedError, Spot


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
