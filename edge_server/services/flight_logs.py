"""The logs of flights: taken from a broker part by part, shown with their flights."""

import sqlite3
from collections.abc import Callable, Collection, Iterator
from datetime import UTC, datetime
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeVar

from pydantic import BeforeValidator, Field, model_validator

from afarcloud.numbers import Model, Time, field_error, json_integer
from edge_server.archive import logs, reader, tables
from edge_server.archive.logs import LogGapError, LogUpload, Row
from edge_server.services.context import Context, show_time
from edge_server.services.errors import (
    ConflictError,
    FullError,
    NotFoundError,
    TooLargeError,
    UnavailableError,
)
from edge_server.services.reports.listing import Listing, fill

MEDIA_TYPE: Final = "application/octet-stream"
"""Neither ULog, DataFlash nor tlog has one of its own."""
FRAME_LOG: Final = "tlog"
OWN_FORMATS: Final = frozenset({"ulg", "bin"})
"""What vehicles write themselves."""
FORMATS: Final = ("ulg", "bin", FRAME_LOG)
MOST_LOGS: Final = 100
"""Logs of one flight, or incomplete ones of one vehicle, that are listed."""
_UINT32: Final = 2**32 - 1
_Result = TypeVar("_Result")


class VehicleLog(Model):
    """What a broker says of a log before it sends it.

    `started_at` and `ended_at` are when the vehicle was armed and disarmed, by the broker's clock.
    `listed_at` is the time that the vehicle lists the log with, by its own; null: its clock is not
    set.
    """

    format: Literal["ulg", "bin", "tlog"]  # `FORMATS`
    started_at: Time
    ended_at: Time
    listed_at: Time | None = None
    size_bytes: Annotated[int, Field(ge=1, le=_UINT32), BeforeValidator(json_integer)]

    @model_validator(mode="after")
    def _check_order(self) -> "VehicleLog":
        if self.ended_at < self.started_at:
            raise field_error("ended_at", "must not be before started_at")
        return self


class LogFile(NamedTuple):
    """A complete log: its name for the reader, its size, a tag, and how its bytes are read."""

    name: str
    size_bytes: int
    tag: str
    read: Callable[[int, int], Iterator[bytes]]
    """Gives the bytes from a first offset up to a last one, which is not included."""


def begin(
    context: Context, vehicle_id: int, name: str, described: VehicleLog
) -> tuple[dict[str, Any], bool]:
    """Begin a log, or continue one of the same name; returns it and whether it is new.

    Raises:
        TooLargeError: if the archive keeps no log of this size.
        NotFoundError: if the archive has no flight of the vehicle at that time (yet).
        ConflictError: if the name was given to another log, or nothing is archived.
        FullError, UnavailableError: if it cannot be written now.
    """
    _check_room(context)
    most = context.archive.largest_log_bytes
    if described.size_bytes > most:
        raise TooLargeError(f"the flight archive keeps logs of at most {most} bytes")
    listed_at = described.listed_at
    upload = LogUpload(
        vehicle_id,
        name,
        described.format,
        round(described.started_at.timestamp(), 3),  # As they are shown: a broker repeats them
        round(described.ended_at.timestamp(), 3),
        0 if listed_at is None else int(listed_at.timestamp()),
        described.size_bytes,
    )

    def write(connection: sqlite3.Connection) -> bool | None:
        if not logs.flies(connection, upload):
            return None
        return logs.begin(connection, upload, context.clock())

    is_new = _change(context, write)
    if is_new is None:
        raise NotFoundError(f"the archive has no flight of vehicle {vehicle_id} at that time")
    row = _find(context, vehicle_id, name)
    if not is_new and _upload_of(row) != upload:
        raise ConflictError(f"log {name} of vehicle {vehicle_id} is another one")
    return _show(row), is_new


def append(
    context: Context, vehicle_id: int, name: str, offset: int, data: bytes, *, is_last: bool
) -> dict[str, Any]:
    """Add a part of a log; returns the log.

    Raises:
        NotFoundError: if there is no such log (any more).
        ConflictError: if the part does not begin where the received ones end.
        TooLargeError: if the log becomes larger than it was said to be.
        FullError, UnavailableError: if it cannot be written now.
    """
    _check_room(context)
    row = _find(context, vehicle_id, name)
    if offset + len(data) > row["size_bytes"]:
        raise TooLargeError(f"log {name} was said to have {row['size_bytes']} bytes")

    def write(connection: sqlite3.Connection) -> None:
        logs.append(connection, row["id"], offset, data, context.clock(), is_last=is_last)

    try:
        _change(context, write)
    except LogGapError:
        row = _find(context, vehicle_id, name)
        raise ConflictError(_gap(row, name)) from None
    return _show(_find(context, vehicle_id, name))


def _gap(row: Row, name: str) -> str:
    if row["is_complete"]:
        return f"log {name} is complete"
    return f"log {name} continues at offset {row['received_bytes']}"


def incomplete(context: Context, vehicle_id: int) -> list[dict[str, Any]]:
    """List the logs of a vehicle that are not complete, newest first."""

    def read(connection: sqlite3.Connection | None) -> list[Row]:
        return [] if connection is None else logs.incomplete(connection, vehicle_id, MOST_LOGS)

    rows: list[Row] = _read(context, read, [])
    return [_show(row) for row in rows]


def discard(context: Context, vehicle_id: int, name: str) -> None:
    """Delete a log; raises NotFoundError."""
    row = _find(context, vehicle_id, name)
    _change(context, lambda connection: logs.mark(connection, row["id"]))


def of_flight(context: Context, flight_id: int) -> Listing:
    """List the logs of a flight, also incomplete ones; raises NotFoundError."""
    return fill(_rows(context, flight_id), lambda row: _show_of_flight(flight_id, row))


def file_of_flight(context: Context, flight_id: int, number: int) -> LogFile:
    """Find a complete log of a flight by its number; raises NotFoundError."""
    rows = [row for row in _rows(context, flight_id) if row["id"] == number]
    if not rows:
        raise NotFoundError(f"flight {flight_id} has no log {number}")
    return _largest(context, flight_id, rows)


def largest_of_flight(context: Context, flight_id: int, formats: Collection[str]) -> LogFile:
    """Find the largest complete log of a flight that has one of these formats.

    Raises:
        NotFoundError: if there is none (yet).
    """
    rows = [row for row in _rows(context, flight_id) if row["format"] in formats]
    if not rows:
        raise NotFoundError(_absence(flight_id, formats))
    return _largest(context, flight_id, rows)


def _largest(context: Context, flight_id: int, rows: list[Row]) -> LogFile:
    complete = [row for row in rows if row["is_complete"]]
    if not complete:
        received, size = rows[0]["received_bytes"], rows[0]["size_bytes"]
        raise NotFoundError(
            f"the log of flight {flight_id} is being received: {received} of {size} bytes so far"
        )
    row = max(complete, key=lambda one: int(one["received_bytes"]))
    return LogFile(
        _file_name(flight_id, row),
        row["received_bytes"],
        f"log-{row['id']}-{row['changed_at']:.3f}",
        lambda first, end: _bytes(context, row["id"], first, end),
    )


def _absence(flight_id: int, formats: Collection[str]) -> str:
    """Say why there is no log."""
    if FRAME_LOG in formats:
        return (
            f"flight {flight_id} has no log of MAVLink messages: the broker keeps none (TLOG_DIR), "
            "has not sent it yet or has given it up, or it was deleted to keep the archive's budget"
        )
    return (
        f"flight {flight_id} has no log: its vehicle keeps none, the broker has not fetched it yet "
        "or has given it up, or it was deleted to keep the archive's budget"
    )


def _bytes(context: Context, row_id: int, first: int, end: int) -> Iterator[bytes]:
    """Read a log part by part; a slow reader keeps no view of the archive open."""
    while first < end:
        with context.archive.reading() as connection:
            part = b"" if connection is None else logs.part_at(connection, row_id, first)
        if not part:  # It was dropped meanwhile: the reader notices that the length is wrong
            return
        yield part[: end - first]
        first += len(part)


def _rows(context: Context, flight_id: int) -> list[Row]:
    def read(connection: sqlite3.Connection | None) -> list[Row]:
        if connection is None or reader.flight(connection, flight_id) is None:
            raise NotFoundError(f"there is no flight {flight_id} in the archive")
        return logs.of_flight(connection, flight_id, MOST_LOGS)

    return _read(context, read, [])


def _find(context: Context, vehicle_id: int, name: str) -> Row:
    def read(connection: sqlite3.Connection | None) -> Row | None:
        return None if connection is None else logs.find(connection, vehicle_id, name)

    found = _read(context, read, None)
    if found is None:
        raise NotFoundError(f"vehicle {vehicle_id} has no log {name} in the archive")
    return found


def _read(
    context: Context, read: Callable[[sqlite3.Connection | None], _Result], nothing: _Result
) -> _Result:
    """Read the archive; `nothing` if an older version has written it last."""
    try:
        with context.archive.reading() as connection:
            return read(connection)
    except sqlite3.Error as error:
        if tables.lacks_table(error):
            return nothing
        raise UnavailableError(f"the flight archive cannot be read: {error}") from None


def _change(context: Context, change: Callable[[sqlite3.Connection], _Result]) -> _Result:
    try:
        return context.archive.change_logs(change)
    except (sqlite3.Error, OSError) as error:
        if tables.is_full(error):
            raise FullError("the flight archive has no room; nothing was stored") from None
        raise UnavailableError(f"the flight archive cannot be written: {error}") from None


def _check_room(context: Context) -> None:
    if not context.archive.is_on:
        raise ConflictError("nothing is archived here: EDGE_ARCHIVE_MIB is 0")
    if not context.archive.has_room:
        raise FullError("the disk is nearly full, and records come first; nothing was stored")


def _upload_of(row: Row) -> LogUpload:
    return LogUpload(*(row[name] for name in LogUpload._fields))


def _show(row: Row) -> dict[str, Any]:
    listed_s = row["listed_s"]
    return {
        "name": row["name"],
        "vehicle_id": row["vehicle_id"],
        "format": row["format"],
        "started_at": show_time(row["started_at"]),
        "ended_at": show_time(row["ended_at"]),
        "listed_at": show_time(listed_s) if listed_s else None,
        "size_bytes": row["size_bytes"],
        "received_bytes": row["received_bytes"],
        "is_complete": bool(row["is_complete"]),
    }


def _show_of_flight(flight_id: int, row: Row) -> dict[str, Any]:
    is_complete = bool(row["is_complete"])
    return {
        "id": row["id"],
        "format": row["format"],
        "file_name": _file_name(flight_id, row),
        "started_at": show_time(row["started_at"]),
        "ended_at": show_time(row["ended_at"]),
        "size_bytes": row["received_bytes"] if is_complete else row["size_bytes"],
        "received_bytes": row["received_bytes"],
        "is_complete": is_complete,
        "url": f"/flights/{flight_id}/logs/{row['id']}" if is_complete else None,
    }


def _file_name(flight_id: int, row: Row) -> str:
    """Name a log after its flight, its vehicle and its beginning."""
    began = datetime.fromtimestamp(row["started_at"], UTC).strftime("%Y-%m-%dT%H-%M-%SZ")
    return f"flight-{flight_id}-vehicle-{row['vehicle_id']}-{began}.{row['format']}"
