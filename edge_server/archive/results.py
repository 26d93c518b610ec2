"""What a flight leaves: its track, the results of its commands, pictures and alarms.

Each report is stored once, however often it is received: a point of the track by its time and
number, everything else by its message id. All functions run in the transaction of their caller.
"""

import base64
import json
import sqlite3
from typing import Any, NamedTuple, TypeAlias

from afarcloud.geodesy import distance_m
from afarcloud.state import Alarm, Image, Report, StateVector
from afarcloud.wire import Kind, write
from edge_server.archive import flights

Place: TypeAlias = tuple[float, float, float]
"""Latitude and longitude [deg], height above home [m]."""


class Stored(NamedTuple):
    """A report, when it was recorded and received [s since 1970], and its message id.

    `place` is where a picture says that it was taken.
    """

    report: Report
    kind: Kind
    message_id: str
    at: float
    received_at: float
    place: Place | None


def take(connection: sqlite3.Connection, stored: Stored) -> None:
    """Store a report of its vehicle's flight; without a flight only an alarm is stored."""
    vehicle_id = stored.report.vehicle_id
    if isinstance(stored.report, StateVector):
        flight = flights.of_point(connection, vehicle_id, stored.at)
        if flight is not None:
            _take_point(connection, stored.report, stored, flight)
        return
    flight = flights.at_time(connection, vehicle_id, stored.at)
    if isinstance(stored.report, Alarm):
        _take_alarm(connection, stored.report, stored, flight)
        return
    if flight is None:
        return
    if isinstance(stored.report, Image):
        _take_picture(connection, stored.report, stored, flight)
    else:
        _take_result(connection, stored, flight)
    flights.note_report(connection, flight, stored.at, stored.received_at)


def _take_point(
    connection: sqlite3.Connection, state: StateVector, stored: Stored, flight: int
) -> None:
    made = connection.execute(
        "INSERT OR IGNORE INTO point VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
        (
            flight,
            round(stored.at * 1000),
            state.sequence_number,
            state.latitude,
            state.longitude,
            state.altitude,
            state.linear_speed,
            state.yaw,
            state.battery_percentage,
        ),
    )
    if made.rowcount:
        _extend(connection, state, stored, flight)


def _extend(
    connection: sqlite3.Connection, state: StateVector, stored: Stored, flight: int
) -> None:
    """Add the distance from the last point; a point that arrives out of order adds nothing."""
    latitude, longitude, point_at = connection.execute(
        "SELECT latitude, longitude, point_at FROM flight WHERE id = ?", (flight,)
    ).fetchone()
    if point_at is not None and stored.at < point_at:
        return
    flown_m = (
        0.0
        if point_at is None
        else distance_m(latitude, longitude, state.latitude, state.longitude)
    )
    connection.execute(
        "UPDATE flight SET latitude = ?, longitude = ?, point_at = ?, distance_m = distance_m + ?,"
        " last_at = max(last_at, ?), received_at = max(received_at, ?) WHERE id = ?",
        (
            state.latitude,
            state.longitude,
            stored.at,
            flown_m,
            stored.at,
            stored.received_at,
            flight,
        ),
    )


def _take_picture(
    connection: sqlite3.Connection, image: Image, stored: Stored, flight: int
) -> None:
    """Store a picture, with its own place, else the vehicle's last position before it."""
    place = (
        stored.place
        or connection.execute(
            "SELECT latitude, longitude, altitude FROM point WHERE flight = ? AND at_ms <= ?"
            " ORDER BY at_ms DESC LIMIT 1",
            (flight, round(stored.at * 1000)),
        ).fetchone()
        or (None, None, None)
    )
    (number,) = connection.execute(
        "SELECT coalesce(max(number), 0) + 1 FROM picture WHERE flight = ?", (flight,)
    ).fetchone()
    connection.execute(
        "INSERT OR IGNORE INTO picture VALUES (NULL, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        (
            flight,
            number,
            stored.message_id,
            stored.at,
            image.format.value,
            image.name,
            image.image_size,
            *place,
            base64.b64decode(image.frame),
        ),
    )


def _take_result(connection: sqlite3.Connection, stored: Stored, flight: int) -> None:
    document: dict[str, Any] = write(stored.report)
    connection.execute(
        "INSERT OR IGNORE INTO result VALUES (NULL, ?, ?, ?, ?, ?)",
        (flight, stored.kind.value, stored.message_id, stored.at, json.dumps(document)),
    )


def _take_alarm(
    connection: sqlite3.Connection, alarm: Alarm, stored: Stored, flight: int | None
) -> None:
    connection.execute(
        "INSERT OR IGNORE INTO alarm VALUES (NULL, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, NULL, NULL)",
        (
            flight,
            alarm.vehicle_id,
            alarm.mission_id,
            stored.message_id,
            stored.at,
            stored.received_at,
            int(alarm.alarm_type_id),
            alarm.alarm_code_id,
            json.dumps(alarm.param_array),
            alarm.message,
        ),
    )
