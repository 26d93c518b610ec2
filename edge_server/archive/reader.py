"""Reads the archive: pages of rows in the order of their ids, and the points of a track."""

import sqlite3
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from edge_server.archive import tables

_POINTS: Final = 1000  # Per query
_FLIGHT: Final = (
    "SELECT flight.*,"
    " (SELECT count(*) FROM picture WHERE picture.flight = flight.id) AS pictures,"
    " (SELECT count(*) FROM alarm WHERE alarm.flight = flight.id) AS alarms"
    " FROM flight WHERE dropped = 0"
)
_PICTURE: Final = "number, recorded_at, format, name, size_bytes, latitude, longitude, altitude"
Row = sqlite3.Row


class Point(NamedTuple):
    """A point of a track: time [ms since 1970], position, height above home [m].

    `speed` is in m/s, `heading` in degrees clockwise from north, `battery` a fraction.
    """

    at_ms: int
    sequence_number: int
    latitude: float
    longitude: float
    altitude: float
    speed: float
    heading: float
    battery: float | None


def flights(
    connection: sqlite3.Connection,
    *,
    after_id: int,
    limit: int,
    vehicle_id: int | None,
    since_s: float,
) -> list[Row]:
    """List flights, without those of which nothing was received since a time."""
    return connection.execute(
        f"{_FLIGHT} AND id > ? AND received_at >= ? AND (? IS NULL OR vehicle_id = ?)"
        " ORDER BY id LIMIT ?",
        (after_id, since_s, vehicle_id, vehicle_id, limit),
    ).fetchall()


def flight(connection: sqlite3.Connection, flight_id: int) -> Row | None:
    """Find a flight."""
    found: Row | None = connection.execute(f"{_FLIGHT} AND id = ?", (flight_id,)).fetchone()
    return found


def commands(connection: sqlite3.Connection, flight_id: int) -> list[Row]:
    """List the commands of a flight."""
    return connection.execute(
        "SELECT * FROM command WHERE flight = ? ORDER BY command_id", (flight_id,)
    ).fetchall()


def results(
    connection: sqlite3.Connection,
    flight_id: int,
    kinds: Sequence[str],
    *,
    after_id: int = 0,
    limit: int,
) -> list[Row]:
    """List results of some kinds of a flight, in the order of their receipt."""
    places = ", ".join("?" for _ in kinds)
    return connection.execute(
        f"SELECT * FROM result WHERE flight = ? AND kind IN ({places}) AND id > ?"  # noqa: S608  # places only
        " ORDER BY id LIMIT ?",
        (flight_id, *kinds, after_id, limit),
    ).fetchall()


def pictures(
    connection: sqlite3.Connection, flight_id: int, *, after_id: int, limit: int
) -> list[Row]:
    """List the pictures of a flight, without their data."""
    return connection.execute(
        f"SELECT {_PICTURE} FROM picture WHERE flight = ? AND number > ? ORDER BY number LIMIT ?",  # noqa: S608  # fixed text
        (flight_id, after_id, limit),
    ).fetchall()


def picture_heads(
    connection: sqlite3.Connection, flight_id: int, *, after_id: int, limit: int, size_bytes: int
) -> Iterator[Row]:
    """Give numbers and first bytes of the pictures of a flight, one at a time."""
    yield from connection.execute(
        "SELECT number, substr(data, 1, ?) AS head FROM picture"
        " WHERE flight = ? AND number > ? ORDER BY number LIMIT ?",
        (size_bytes, flight_id, after_id, limit),
    )


def picture(connection: sqlite3.Connection, flight_id: int, number: int) -> Row | None:
    """Find a picture with its data."""
    found: Row | None = connection.execute(
        "SELECT * FROM picture WHERE flight = ? AND number = ?", (flight_id, number)
    ).fetchone()
    return found


def flight_map(connection: sqlite3.Connection, flight_id: int, band: str) -> Row | None:
    """Find the map of a flight in a band; None before the first one is made."""
    try:
        found: Row | None = connection.execute(
            "SELECT made_at, about, data FROM flight_map WHERE flight = ? AND band = ?",
            (flight_id, band),
        ).fetchone()
    except sqlite3.OperationalError as error:
        if not tables.lacks_table(error):
            raise
        return None
    return found


def flight_maps(
    connection: sqlite3.Connection, *, after_id: int, limit: int, vehicle_id: int | None
) -> list[Row]:
    """List the maps of flights without their data, in the order in which they were made."""
    try:
        return connection.execute(
            "SELECT flight_map.rowid AS id, flight, vehicle_id, plan_id, band, made_at, about"
            " FROM flight_map JOIN flight ON flight.id = flight WHERE dropped = 0"
            " AND flight_map.rowid > ? AND (? IS NULL OR vehicle_id = ?)"
            " ORDER BY flight_map.rowid LIMIT ?",
            (after_id, vehicle_id, vehicle_id, limit),
        ).fetchall()
    except sqlite3.OperationalError as error:
        if not tables.lacks_table(error):
            raise
        return []


def points(connection: sqlite3.Connection, flight_id: int) -> Iterator[Point]:
    """Give the points of a track in the order of time, a part at a time."""
    last = (-(2**62), 0)
    while True:
        found = connection.execute(
            "SELECT at_ms, sequence_number, latitude, longitude, altitude, speed, heading, battery"
            " FROM point WHERE flight = ? AND (at_ms, sequence_number) > (?, ?)"
            " ORDER BY at_ms, sequence_number LIMIT ?",
            (flight_id, *last, _POINTS),
        ).fetchall()
        yield from (Point(*row) for row in found)
        if len(found) < _POINTS:
            return
        last = (found[-1][0], found[-1][1])


def alarms(
    connection: sqlite3.Connection,
    *,
    after_id: int,
    limit: int,
    vehicle_id: int | None,
    since_s: float,
) -> list[Row]:
    """List alarms, also those outside of a flight."""
    return connection.execute(
        "SELECT * FROM alarm WHERE id > ? AND received_at >= ? AND (? IS NULL OR vehicle_id = ?)"
        " ORDER BY id LIMIT ?",
        (after_id, since_s, vehicle_id, vehicle_id, limit),
    ).fetchall()


def present_alarms(connection: sqlite3.Connection, since_s: float, limit: int) -> list[Row]:
    """List alarms, newest first, that nobody has acknowledged, or that are newer than a time.

    The time [s since 1970] is compared with their reception and with their acknowledgement. Each
    of the three has its index: the live stream reads this several times a second.
    """
    return connection.execute(
        "SELECT * FROM alarm WHERE id IN (SELECT id FROM alarm WHERE acknowledged_at IS NULL"
        " UNION SELECT id FROM alarm WHERE acknowledged_at >= ?"
        " UNION SELECT id FROM alarm WHERE received_at >= ?) ORDER BY id DESC LIMIT ?",
        (since_s, since_s, limit),
    ).fetchall()


def alarm(connection: sqlite3.Connection, alarm_id: int) -> Row | None:
    """Find an alarm."""
    found: Row | None = connection.execute(
        "SELECT * FROM alarm WHERE id = ?", (alarm_id,)
    ).fetchone()
    return found
