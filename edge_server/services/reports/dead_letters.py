"""Records that the cloud has rejected: listed, retried, corrected or discarded."""

from collections.abc import Iterator
from typing import Any, Final

from sqlalchemy import Connection

from afarcloud.state import Report
from edge_server.outbox import queue
from edge_server.services.context import Context, show_time
from edge_server.services.errors import NotFoundError
from edge_server.services.reports import corrections, listing, telemetry
from edge_server.services.reports.listing import Listing
from edge_server.services.retries import retry_on_conflict
from edge_server.store.rows import dead_letters
from edge_server.store.rows import telemetry as telemetry_rows
from edge_server.store.rows.dead_letters import DeadLetter

_EXPORTED_AT_ONCE: Final = 4  # Pictures are large
_RETRIED_AT_ONCE: Final = 500


def page(
    context: Context, *, after_id: int, limit: int, kind: str | None, vehicle_id: int | None
) -> Listing:
    """List dead letters, oldest first; pictures without their frame."""
    with context.database.read() as connection:
        found = dead_letters.page(
            connection, after_id=after_id, limit=limit, kind=kind, vehicle_id=vehicle_id
        )
        return listing.fill(found, _show_without_frame)


def _show_without_frame(letter: DeadLetter) -> dict[str, Any]:
    shown = show(letter)
    shown["report"].pop("frame", None)
    return shown


def find(context: Context, record_id: int) -> dict[str, Any]:
    """Return one; raises NotFoundError."""
    with context.database.read() as connection:
        return show(_find(connection, record_id))


@retry_on_conflict
def retry(context: Context, record_id: int) -> dict[str, Any]:
    """Queue a dead letter again, in its old place in its stream; raises NotFoundError."""
    with context.database.write() as connection:
        letter = _find(connection, record_id, to_change=True)
        queue.requeue(connection, record_id)
    context.wake_relay(changed=True)
    return telemetry.show(letter.record)


def retry_all(context: Context, *, kind: str | None, vehicle_id: int | None) -> int:
    """Queue all dead letters again, or those of a kind or vehicle; returns how many."""
    retried, last = 0, _last(context)
    after_id = 0
    while found := _retry_some(context, after_id, last, kind, vehicle_id):
        retried += len(found)
        after_id = found[-1]
    if retried:
        context.wake_relay(changed=True)
    return retried


def _last(context: Context) -> int:
    """The newest dead letter: a letter that is rejected again meanwhile is not retried twice."""
    with context.database.read() as connection:
        return dead_letters.newest(connection)


@retry_on_conflict
def _retry_some(
    context: Context, after_id: int, up_to_id: int, kind: str | None, vehicle_id: int | None
) -> list[int]:
    with context.database.write() as connection:
        found = dead_letters.ids(
            connection, after_id=after_id, limit=_RETRIED_AT_ONCE, kind=kind, vehicle_id=vehicle_id
        )
        found = [record_id for record_id in found if record_id <= up_to_id]
        for record_id in found:
            queue.requeue(connection, record_id)
    return found


@retry_on_conflict
def edit(context: Context, record_id: int, report: Report) -> dict[str, Any]:
    """Correct a dead letter and queue it as a new message, in its old place in its stream.

    Raises:
        NotFoundError: if it is no dead letter.
        InvalidError, ConflictError: as `telemetry.replace`.
    """
    with context.database.write(*corrections.locks_of(report)) as connection:
        record = _find(connection, record_id, to_change=True).record
        corrected = corrections.apply(connection, record, report, context.clock())
    context.wake_relay(changed=True)
    return telemetry.show(corrected)


def export(
    context: Context, *, kind: str | None, vehicle_id: int | None
) -> Iterator[dict[str, Any]]:
    """Return all dead letters in full, oldest first, a few at a time."""
    after_id = 0
    while True:
        with context.database.read() as connection:
            found = list(
                dead_letters.page(
                    connection,
                    after_id=after_id,
                    limit=_EXPORTED_AT_ONCE,
                    kind=kind,
                    vehicle_id=vehicle_id,
                )
            )
        if not found:
            return
        yield from map(show, found)
        after_id = found[-1].record.id


@retry_on_conflict
def discard(context: Context, record_id: int) -> None:
    """Delete a dead letter; raises NotFoundError."""
    with context.database.write() as connection:
        letter = _find(connection, record_id, to_change=True)
        telemetry_rows.remove(connection, letter.record.kind, record_id)
    context.wake_relay(changed=True)


def show(letter: DeadLetter) -> dict[str, Any]:
    """Return a dead letter as the API shows it."""
    return {
        "id": letter.record.id,
        "kind": letter.record.kind,
        "vehicle_id": letter.record.vehicle_id,
        "attempts": letter.attempts,
        "reason": letter.reason,
        "rejected_at": None if letter.rejected_at is None else show_time(letter.rejected_at),
        "report": telemetry.show(letter.record),
    }


def _find(connection: Connection, record_id: int, *, to_change: bool = False) -> DeadLetter:
    letter = dead_letters.find(connection, record_id, to_change=to_change)
    if letter is None:
        raise NotFoundError(f"there is no dead letter {record_id}")
    return letter
