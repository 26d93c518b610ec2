"""What the cloud has rejected: looked at, sent once more, or given up. One transaction each."""

from typing import Any

from sqlalchemy import Connection

from edge_server.outbox import queue
from edge_server.services import telemetry
from edge_server.services.attempts import repeatable
from edge_server.services.context import Context
from edge_server.services.errors import NotFoundError
from edge_server.store import dead_letters
from edge_server.store import telemetry as records
from edge_server.store.dead_letters import DeadLetter


def page(
    context: Context, *, after_id: int, limit: int, kind: str | None, vehicle_id: int | None
) -> list[dict[str, Any]]:
    """List dead letters, oldest first; pictures without their frame."""
    with context.database.read() as connection:
        found = dead_letters.page(
            connection, after_id=after_id, limit=limit, kind=kind, vehicle_id=vehicle_id
        )
    shown = [show(letter) for letter in found]
    for item in shown:
        item["report"].pop("frame", None)
    return shown


def find(context: Context, record_id: int) -> dict[str, Any]:
    """Give one; raises NotFoundError."""
    with context.database.read() as connection:
        return show(_find(connection, record_id))


@repeatable
def retry(context: Context, record_id: int) -> dict[str, Any]:
    """Make a dead letter due again, in its old place in its stream; raises NotFoundError."""
    with context.database.write() as connection:
        letter = _find(connection, record_id, to_change=True)
        queue.requeue(connection, record_id)
    context.wake_relay(changed=True)
    return telemetry.show(letter.record)


@repeatable
def discard(context: Context, record_id: int) -> None:
    """Forget a dead letter for good; raises NotFoundError."""
    with context.database.write() as connection:
        letter = _find(connection, record_id, to_change=True)
        records.remove(connection, letter.record.kind, record_id)
    context.wake_relay(changed=True)


def show(letter: DeadLetter) -> dict[str, Any]:
    """Give a dead letter as the API shows it."""
    return {
        "id": letter.record.id,
        "kind": letter.record.kind,
        "vehicle_id": letter.record.vehicle_id,
        "attempts": letter.attempts,
        "reason": letter.reason,
        "report": telemetry.show(letter.record),
    }


def _find(connection: Connection, record_id: int, *, to_change: bool = False) -> DeadLetter:
    letter = dead_letters.find(connection, record_id, to_change=to_change)
    if letter is None:
        raise NotFoundError(f"there is no dead letter {record_id}")
    return letter
