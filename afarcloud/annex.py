"""The narrow ranges of the information model's own annex, as a table.

A plan with `"profile": "annex"` has to meet these as well. Its `hold_time` counts tens of
seconds; `in_seconds` brings a mission to the unit of the `field` profile.
"""

from collections.abc import Iterator
from typing import Final

from afarcloud.commands import Command, NavWaypoint
from afarcloud.enumerations import CommandType
from afarcloud.faults import Fault
from afarcloud.plan import Mission, Plan

MAXIMUM_COMMANDS: Final = 100

RANGES: Final[dict[CommandType, dict[str, tuple[float, float]]]] = {
    CommandType.NAV_TAKEOFF: {"yaw_angle": (0, 180), "altitude": (0, 10)},
    CommandType.NAV_LAND: {
        "minimum_target_altitude": (0, 10),
        "desired_yaw_angle": (0, 180),
        "landing_altitude": (0, 5),
    },
    CommandType.NAV_WAYPOINT: {
        "hold_time": (0, 3),
        "acceptance_radius": (0, 3),
        "trajectory_control": (0, 3),
        "desired_yaw_angle": (0, 180),
        "altitude": (0, 5),
    },
    CommandType.CAMERA_IMAGE: {"yaw_angle": (0, 180)},
    CommandType.NAV_FOLLOW_TARGET: {"altitude": (0, 10)},
}
"""Inclusive bounds per command type and parameter."""


def annex_faults(plan: Plan) -> Iterator[Fault]:
    """Yield what the annex refuses in a plan that the model accepts."""
    for index, mission in enumerate(plan.missions):
        path = f"missions.{index}.command_array"
        if len(mission.command_array) > MAXIMUM_COMMANDS:
            yield Fault(
                path,
                f"has {len(mission.command_array)} commands, annex allows {MAXIMUM_COMMANDS}",
            )
        for position, command in enumerate(mission.command_array):
            yield from _command_faults(command, f"{path}.{position}.parameters")


def _command_faults(command: Command, path: str) -> Iterator[Fault]:
    for name, (low, high) in RANGES.get(command.command_type_id, {}).items():
        value = getattr(command.parameters, name)
        if value is not None and not low <= value <= high:
            yield Fault(f"{path}.{name}", f"must be {low} to {high} under annex, not {value}")


def in_seconds(mission: Mission) -> Mission:
    """Turn an annex mission's hold times, given in tens of seconds, into seconds."""
    return mission.model_copy(
        update={"command_array": tuple(_hold_in_seconds(c) for c in mission.command_array)}
    )


def _hold_in_seconds(command: Command) -> Command:
    if not isinstance(command, NavWaypoint):
        return command
    parameters = command.parameters.model_copy(
        update={"hold_time": command.parameters.hold_time * 10.0}
    )
    return command.model_copy(update={"parameters": parameters})
