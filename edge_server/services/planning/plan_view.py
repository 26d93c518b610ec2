"""A plan as the API shows it: what was posted, with the live status; pure."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from afarcloud.enumerations import Status
from edge_server.services.context import show_time
from edge_server.services.fleet.vehicles import explain_hold
from edge_server.store.rows.plans import StoredPlan
from edge_server.store.rows.vehicle_holds import VehicleHold
from edge_server.store.rows.work import QUEUED, CommandProgress, Work

HELD: Final = "held"


def show(
    stored: StoredPlan,
    missions: Sequence[Work],
    progress: Mapping[int, Mapping[int, CommandProgress]],
    holds: Mapping[int, VehicleHold],
) -> dict[str, Any]:
    """Join a plan, its missions, the progress of their commands (by work id) and held vehicles."""
    status = overall(Status(item.status_id) for item in missions if item.status_id)
    return {
        "id": stored.id,
        **stored.body,
        "plan_id": stored.plan_id,
        "received_at": show_time(stored.received_at),
        "expires_at": show_time(stored.expires_at),
        "plan_status_id": int(status),
        "plan_status_name": status.name,
        "missions": [_mission(item, progress[item.id], holds) for item in missions],
        "warnings": stored.warnings,
    }


def overall(statuses: Iterable[Status]) -> Status:
    """Return the status of a plan: RUNNING until all missions have ended, then the worst."""
    seen = set(statuses)
    if seen <= {Status.NOT_STARTED}:
        return Status.NOT_STARTED
    if not all(status.is_terminal for status in seen):
        return Status.RUNNING
    for worst in (Status.FAILED, Status.ABORTED):
        if worst in seen:
            return worst
    return Status.FINISHED


def _mission(
    item: Work, progress: Mapping[int, CommandProgress], holds: Mapping[int, VehicleHold]
) -> dict[str, Any]:
    body = dict(item.body or {})
    commands = body.pop("command_array", [])
    return {
        **body,
        "dispatch_state": HELD if item.held and item.state == QUEUED else item.state,
        **_waiting(item, holds),
        **_status("mission", item.status_id, item.message),
        "command_array": [_command(entry, progress[entry["command_id"]]) for entry in commands],
    }


def _waiting(item: Work, holds: Mapping[int, VehicleHold]) -> dict[str, str]:
    """Explain why a queued mission is not published."""
    hold = holds.get(item.vehicle_id or 0)
    if hold is None or item.state != QUEUED or item.held:
        return {}
    return {"waiting": explain_hold(hold)}


def _command(entry: dict[str, Any], progress: CommandProgress) -> dict[str, Any]:
    return {**entry, **_status("command", progress.status_id, progress.message)}


def _status(of: str, status_id: int | None, message: str | None) -> dict[str, Any]:
    status = Status(status_id or Status.NOT_STARTED)
    shown: dict[str, Any] = {f"{of}_status_id": int(status), f"{of}_status_name": status.name}
    if message:
        shown["message"] = message
    return shown
