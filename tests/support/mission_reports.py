"""What the broker reports of a mission and of its vehicle, as an operator reads it."""

from afarcloud.enumerations import Status
from tests.support.broker_world import World


def messages(world: World, mission_id: int = 1201) -> list[str]:
    """The message of each report of a mission; empty where it has none."""
    return [report.get("message") or "" for report in world.edge.reports(mission_id)]


def message_of(world: World, mission_id: int = 1201) -> str:
    """The message of the newest report of a mission."""
    return str(world.edge.reports(mission_id)[-1]["message"])


def command_messages(world: World) -> list[str | None]:
    """What the newest report says of each command."""
    report = world.edge.reports(1201)[-1]
    return [command.get("message") for command in report["command_report_array"]]


def running(world: World) -> int | None:
    """Which command of the mission is reported as running, counted from 0."""
    if not world.edge.reports(1201):
        return None
    statuses = world.edge.statuses(1201)
    return statuses.index(Status.RUNNING) if Status.RUNNING in statuses else None


def warning(world: World) -> str:
    """What the newest registration of the vehicle warns of; empty if of nothing."""
    return world.edge.bodies("/vehicles/1")[-1]["warning"] or ""
