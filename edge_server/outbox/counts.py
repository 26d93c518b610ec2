"""What is counted of the relay and of the outbox, for the metrics."""

from bisect import bisect_left
from enum import IntEnum
from typing import Final, NamedTuple

from sqlalchemy import Connection, func, select

from edge_server.outbox.answers import Outcome, Result
from edge_server.outbox.queue import OutboxRecord, State
from edge_server.store.files.tally import Tally
from edge_server.store.rows.tables import outbox, telemetry

UPLINK: Final = "uplink_state"
DELIVERY_BUCKETS_S: Final = (0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 5, 30, 300, 3600, 86400)
_ALPHABET: Final = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
_TIME_DIGITS: Final = 10
_STATUS_DIGITS: Final = 3


class UplinkState(IntEnum):
    """State of the uplink; STOPPED and STALLED are what other processes find.

    STOPPED: no relay runs. STALLED: it runs, but its loop does not.
    """

    STOPPED = 0
    OPEN = 1
    BLOCKED = 2
    PAUSED = 3
    STALLED = 4


class RelayCounts:
    """The relay's counters, kept in its tally file."""

    def __init__(self, tally: Tally) -> None:
        self._tally = tally

    def set_uplink(self, state: UplinkState) -> None:
        """Store the state of the uplink."""
        self._tally.put(UPLINK, value=state)

    def count(self, record: OutboxRecord, result: Result, now: float) -> None:
        """Count the cloud's answer to a record; `now` is wall clock [s]."""
        kind = record.stream.kind
        if result.outcome is Outcome.CONFIRMED:
            self._tally.add("fm_delivered", kind)
            self._count_delay(max(now - created_at_s(record.message_id), 0.0))
        elif result.outcome is Outcome.REJECTED:
            self._tally.add("fm_rejected", kind, str(result.status))
        else:
            reason = result.outcome.value.replace(" ", "_")
            status = f"_{result.status}" if result.status else ""
            self._tally.add("fm_retries", reason + status)

    def _count_delay(self, delay_s: float) -> None:
        bucket = bisect_left(DELIVERY_BUCKETS_S, delay_s)
        within = "+Inf" if bucket == len(DELIVERY_BUCKETS_S) else f"{DELIVERY_BUCKETS_S[bucket]:g}"
        self._tally.add("fm_delivery_seconds", within)
        self._tally.add("fm_delivery_seconds_sum", amount=delay_s)


def created_at_s(message_id: str) -> float:
    """Time [s since 1970] at which a message id was made: the first 48 bits of a ULID."""
    milliseconds = 0
    for digit in message_id[:_TIME_DIGITS]:
        milliseconds = milliseconds * 32 + _ALPHABET.index(digit)
    return milliseconds / 1000.0


class Waiting(NamedTuple):
    """Rows of the outbox by kind, and dead letters by kind and the cloud's status."""

    queued: dict[str, int]
    dead: dict[tuple[str, str], int]


def count_waiting(connection: Connection) -> Waiting:
    """Count the rows of the outbox; one pass over an index, so its time grows with the backlog."""
    queued: dict[str, int] = {}
    dead: dict[tuple[str, str], int] = {}
    rows = connection.execute(
        select(outbox.c.kind, outbox.c.state, func.count()).group_by(outbox.c.kind, outbox.c.state)
    )
    for kind, state, number in rows:
        if state == State.DEAD:
            dead = dead or _dead(connection)
        else:
            queued[kind] = queued.get(kind, 0) + number
    return Waiting(queued, dead)


def _dead(connection: Connection) -> dict[tuple[str, str], int]:
    status = func.substr(outbox.c.last_error, 1, _STATUS_DIGITS)
    rows = connection.execute(
        select(outbox.c.kind, status, func.count())
        .where(outbox.c.state == State.DEAD.value)
        .group_by(outbox.c.kind, status)
    )
    return {(kind, code if code.isdigit() else "none"): number for kind, code, number in rows}


def oldest_received_at(connection: Connection) -> float | None:
    """When the first record that still has to be sent was received; None if none waits."""
    found: float | None = connection.execute(
        select(telemetry.c.received_at)
        .join(outbox, outbox.c.record_id == telemetry.c.id)
        .where(outbox.c.state == State.QUEUED.value)
        .order_by(outbox.c.id)
        .limit(1)
    ).scalar_one_or_none()
    return found
