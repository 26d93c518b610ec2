"""When a flight begins and ends, and which flight a report belongs to.

A flight begins with the first report of a mission that runs, or when its vehicle is armed; it ends
with the mission's terminal status, or when the vehicle is disarmed. A mission has one flight: its
repeated and reordered reports, and a landing in between, begin no other one.

All functions run in the transaction of their caller. Times are seconds since 1970.
"""

import sqlite3
from collections.abc import Iterable
from datetime import datetime
from typing import Any, Final, NamedTuple

from afarcloud.enumerations import Status
from afarcloud.state import CommandReport, MissionReport

LATE_S: Final = 60.0
"""A result may be recorded so long after the end of its flight."""
PARKED_LATE_S: Final = 1.0
"""The last point of a track, when the vehicle was disarmed at the end of its flight."""
EARLY_S: Final = 5.0
STALE_S: Final = 12 * 3600.0
"""A flight without any report for so long has ended with its last one."""
_PAST_S: Final = 7 * 86_400.0
_AHEAD_S: Final = 60.0
_PAUSE_S: Final = 600.0
"""Between two reports of a flight, at most, behind a step of the edge server's clock."""


class MissionName(NamedTuple):
    """What identifies a mission; `plan_id` is None if its plan is not known here."""

    mission_id: int
    plan_id: str | None


def time_of(
    connection: sqlite3.Connection,
    vehicle_id: int,
    recorded_at: datetime | None,
    received_at: float,
) -> float:
    """Return when something was recorded; a time that cannot be right is that of its receipt.

    One in the future is right if it continues the vehicle's last flight, of which something was
    received later than now: the edge server's own clock was set back since.
    """
    if recorded_at is None:
        return received_at
    recorded = recorded_at.timestamp()
    if recorded > received_at + _AHEAD_S:
        is_right = _continues(connection, vehicle_id, recorded, received_at)
        return recorded if is_right else received_at
    return recorded if recorded >= received_at - _PAST_S else received_at


def _continues(
    connection: sqlite3.Connection, vehicle_id: int, at: float, received_at: float
) -> bool:
    """Whether what was recorded then continues a flight during which the clock was set back."""
    row = connection.execute(
        "SELECT started_at, coalesce(ended_at + ?, last_at + ?) FROM flight"
        " WHERE vehicle_id = ? AND dropped = 0 AND received_at > ? ORDER BY id DESC LIMIT 1",
        (LATE_S, _PAUSE_S, vehicle_id, received_at + _AHEAD_S),
    ).fetchone()
    return row is not None and row[0] - EARLY_S <= at <= row[1]


def at_time(connection: sqlite3.Connection, vehicle_id: int, at: float) -> int | None:
    """Find the flight of a vehicle that something recorded then belongs to; None without one."""
    found = _latest(connection, vehicle_id, at)
    return None if found is None else found[0]


def of_point(connection: sqlite3.Connection, vehicle_id: int, at: float) -> int | None:
    """Find the flight whose track a point belongs to; None without one.

    A track goes on behind the end of its mission until the vehicle is disarmed: it may return
    after a failure. A point may arrive long after that.
    """
    found = _latest(connection, vehicle_id, at)
    if found is None:
        return None
    flight, ended_at = found
    is_over = ended_at is not None and at > ended_at + PARKED_LATE_S
    return None if is_over and _was_parked(connection, vehicle_id, at) else flight


def _latest(
    connection: sqlite3.Connection, vehicle_id: int, at: float
) -> tuple[int, float | None] | None:
    """Find the flight that had begun then, and when it ended; None if that is too long ago."""
    row: tuple[int, float | None] | None = connection.execute(
        "SELECT id, ended_at FROM flight WHERE vehicle_id = ? AND started_at <= ? AND dropped = 0"
        " ORDER BY started_at DESC, id DESC LIMIT 1",
        (vehicle_id, at + EARLY_S),
    ).fetchone()
    if row is None or (row[1] is not None and at > row[1] + LATE_S):
        return None
    return row


def _was_parked(connection: sqlite3.Connection, vehicle_id: int, at: float) -> bool:
    """Whether a vehicle was disarmed then, or has never been reported as armed."""
    row = connection.execute(
        "SELECT armed, disarming.at FROM vehicle LEFT JOIN disarming USING (vehicle_id)"
        " WHERE vehicle_id = ?",
        (vehicle_id,),
    ).fetchone()
    if row is None:
        return True
    armed, disarmed_at = row
    return not armed and (disarmed_at is None or at > disarmed_at + PARKED_LATE_S)


def note_report(connection: sqlite3.Connection, flight: int, at: float, received_at: float) -> None:
    """Note when a flight was last reported on."""
    connection.execute(
        "UPDATE flight SET last_at = max(last_at, ?), received_at = max(received_at, ?)"
        " WHERE id = ?",
        (at, received_at, flight),
    )


def take_mission_report(
    connection: sqlite3.Connection,
    report: MissionReport,
    mission: MissionName,
    at: float,
    received_at: float,
) -> None:
    """Begin, continue or end the flight of a mission."""
    status = report.mission_status_id
    flight = _of_mission(connection, report.vehicle_id, mission, status, at)
    if flight is None:
        if not status.has_begun:
            return  # It has not flown
        flight = _begin_mission(connection, report.vehicle_id, mission, at, received_at)
    note_report(connection, flight, at, received_at)
    _take_commands(connection, flight, report.command_report_array, at)
    (known,) = connection.execute(
        "SELECT mission_status_id FROM flight WHERE id = ?", (flight,)
    ).fetchone()
    if known is not None and (Status(known).is_terminal or status <= known):
        return
    connection.execute(
        "UPDATE flight SET mission_status_id = ?, message = coalesce(?, message) WHERE id = ?",
        (int(status), report.message, flight),
    )
    if status.is_terminal:
        _end(connection, flight, at)
        _abort_the_rest(connection, flight, at)


def _of_mission(
    connection: sqlite3.Connection, vehicle_id: int, mission: MissionName, status: Status, at: float
) -> int | None:
    row = connection.execute(
        "SELECT id, ended_at, mission_status_id FROM flight WHERE (? IS NULL OR plan_id = ?)"
        " AND mission_id = ? AND vehicle_id = ? AND dropped = 0 ORDER BY id DESC LIMIT 1",
        (mission.plan_id, mission.plan_id, mission.mission_id, vehicle_id),
    ).fetchone()
    if row is None:
        return None
    flight, ended_at, known = row
    is_this_one = mission.plan_id is not None or ended_at is None or at <= ended_at
    # Without its plan a mission may be flown again under its number
    return int(flight) if is_this_one or known in {Status.RUNNING, status} else None


def _begin_mission(
    connection: sqlite3.Connection,
    vehicle_id: int,
    mission: MissionName,
    at: float,
    received_at: float,
) -> int:
    """Begin the flight of a mission, or continue the one that began when the vehicle was armed."""
    opened = _open_flight(connection, vehicle_id)
    if opened is not None:
        flight, mission_id = opened
        if mission_id is None:
            connection.execute(
                "UPDATE flight SET mission_id = ?, plan_id = ? WHERE id = ?",
                (mission.mission_id, mission.plan_id, flight),
            )
            return flight
        _end(connection, flight, at)
    return _insert(connection, vehicle_id, mission, at, received_at)


def take_armed(
    connection: sqlite3.Connection,
    vehicle_id: int,
    recorded_at: datetime | None,
    received_at: float,
    *,
    armed: bool,
) -> None:
    """Begin or end a flight of a vehicle that was armed or disarmed."""
    at = time_of(connection, vehicle_id, recorded_at, received_at)
    row = connection.execute(
        "SELECT armed FROM vehicle WHERE vehicle_id = ?", (vehicle_id,)
    ).fetchone()
    was_armed = row is not None and bool(row[0])
    if row is None or was_armed != armed:
        connection.execute("REPLACE INTO vehicle VALUES (?, ?)", (vehicle_id, int(armed)))
    if was_armed and not armed:
        connection.execute("REPLACE INTO disarming VALUES (?, ?)", (vehicle_id, at))
    opened = _open_flight(connection, vehicle_id)
    if armed and not was_armed and opened is None and not _resume(connection, vehicle_id):
        _insert(connection, vehicle_id, MissionName(0, None), at, at, has_mission=False)
    elif was_armed and not armed and opened is not None:
        _end(connection, opened[0], at)


def _resume(connection: sqlite3.Connection, vehicle_id: int) -> bool:
    """Continue the last flight of a vehicle if its mission still runs: it has landed in between."""
    return bool(
        connection.execute(
            "UPDATE flight SET ended_at = NULL WHERE mission_status_id = ? AND dropped = 0 AND id ="
            " (SELECT max(id) FROM flight WHERE vehicle_id = ?)",
            (int(Status.RUNNING), vehicle_id),
        ).rowcount
    )


def _open_flight(connection: sqlite3.Connection, vehicle_id: int) -> tuple[int, int | None] | None:
    found: tuple[int, int | None] | None = connection.execute(
        "SELECT id, mission_id FROM flight WHERE vehicle_id = ? AND ended_at IS NULL"
        " AND dropped = 0 ORDER BY id DESC LIMIT 1",
        (vehicle_id,),
    ).fetchone()
    return found


def _insert(
    connection: sqlite3.Connection,
    vehicle_id: int,
    mission: MissionName,
    at: float,
    received_at: float,
    *,
    has_mission: bool = True,
) -> int:
    names = mission if has_mission else (None, None)
    made = connection.execute(
        "INSERT INTO flight (vehicle_id, mission_id, plan_id, started_at, last_at, received_at)"
        " VALUES (?, ?, ?, ?, ?, ?)",
        (vehicle_id, *names, at, at, received_at),
    )
    return int(made.lastrowid or 0)


def _end(connection: sqlite3.Connection, flight: int, at: float) -> None:
    connection.execute(
        "UPDATE flight SET ended_at = max(started_at, ?) WHERE id = ? AND ended_at IS NULL",
        (at, flight),
    )


def end_stale(connection: sqlite3.Connection, now: float) -> None:
    """End flights that nothing has been received of for a long time, with their last report."""
    connection.execute(
        "UPDATE flight SET ended_at = last_at WHERE ended_at IS NULL AND received_at < ?",
        (now - STALE_S,),
    )


def _take_commands(
    connection: sqlite3.Connection, flight: int, reports: Iterable[CommandReport], at: float
) -> None:
    known: dict[int, int] = dict(
        connection.execute("SELECT command_id, status_id FROM command WHERE flight = ?", (flight,))
    )
    changed: list[dict[str, Any]] = []
    for report in reports:
        status = report.command_status_id
        before = known.get(report.command_id)
        if before is not None and (Status(before).is_terminal or status <= before):
            continue
        changed.append(
            {
                "flight": flight,
                "command": report.command_id,
                "status": int(status),
                "message": report.message,
                "started_at": at if status == Status.RUNNING else None,
                "ended_at": at if status.is_terminal else None,
            }
        )
    connection.executemany(
        "INSERT INTO command VALUES"
        " (:flight, :command, :status, :message, :started_at, :ended_at)"
        " ON CONFLICT DO UPDATE SET status_id = excluded.status_id,"
        " message = coalesce(excluded.message, message),"
        " started_at = coalesce(started_at, excluded.started_at), ended_at = excluded.ended_at",
        changed,
    )


def _abort_the_rest(connection: sqlite3.Connection, flight: int, at: float) -> None:
    connection.execute(
        "UPDATE command SET status_id = ?, ended_at = ? WHERE flight = ? AND status_id <= ?",
        (int(Status.ABORTED), at, flight, int(Status.RUNNING)),
    )
