"""The flight archive as the API shows it: flights, their tracks, pictures and results; alarms."""

import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

from afarcloud.enumerations import AlarmType, Status
from afarcloud.wire import Kind
from edge_server.archive import losses, observation_files, reader, track_files
from edge_server.archive.reader import Row
from edge_server.archive.track_files import Track
from edge_server.pictures import footprint
from edge_server.pictures.program import BusyError, UnreadableError
from edge_server.services import audit
from edge_server.services.context import Context, show_time
from edge_server.services.errors import NotFoundError, TooMuchError, UnavailableError
from edge_server.services.reports.listing import Listing, fill
from edge_server.store.rows import plans

MOST_RESULTS: Final = 1000
"""Poses and batteries that are shown with a flight; a mission has at most 700 commands."""
_MEDIA_TYPES: Final = {"dng": "image/x-adobe-dng"}
_WITHOUT_THUMBNAIL: Final = frozenset({"dng"})
"""Raw formats, which need a library of their own."""


class Picture(NamedTuple):
    """A picture's bytes, their media type, and a key that no other picture has."""

    data: bytes
    media_type: str
    key: str


class Page(NamedTuple):
    """Part of a list: at most `limit` items after an id."""

    after_id: int
    limit: int
    vehicle_id: int | None = None
    since_s: float = 0.0


@contextmanager
def reading(context: Context) -> Iterator[sqlite3.Connection | None]:
    """Give a connection to the archive; raises UnavailableError if it cannot be read."""
    try:
        with context.archive.reading() as connection:
            yield connection
    except sqlite3.Error as error:
        raise UnavailableError(f"the flight archive cannot be read: {error}") from None


def flights(context: Context, page: Page) -> Listing:
    """List flights, oldest first."""
    with reading(context) as connection:
        if connection is None:
            return Listing()
        listing = fill(reader.flights(connection, **page._asdict()), _show_flight)
    _name_plans(context, listing)
    return listing


def flight(context: Context, flight_id: int) -> dict[str, Any]:
    """Return a flight without its commands; raises NotFoundError."""
    with reading(context) as connection:
        shown = _show_flight(_find(connection, flight_id))
    _name_plans(context, [shown])
    return shown


def flight_with_results(context: Context, flight_id: int) -> dict[str, Any]:
    """Return a flight, its commands, poses and batteries; raises NotFoundError."""
    with reading(context) as connection:
        found = _find(connection, flight_id)
        if connection is None:
            raise _missing(flight_id)
        kinds = (Kind.POSE.value, Kind.BATTERY.value)
        results = reader.results(connection, flight_id, kinds, limit=MOST_RESULTS)
        shown = {
            **_show_flight(found),
            "message": found["message"],
            "lost_reports": losses.of_flight(connection, found),
            "command_array": [_show_command(row) for row in reader.commands(connection, flight_id)],
            "results": [_show_result(row) for row in results],
        }
    _name_plans(context, [shown])
    return shown


def _name_plans(context: Context, flights: list[dict[str, Any]]) -> None:
    """Add the names of the plans that were flown."""
    names = plan_names(context, {flight["plan_id"] for flight in flights})
    for flight in flights:
        flight["plan_name"] = names.get(flight["plan_id"])


def plan_names(context: Context, plan_ids: set[str | None]) -> dict[str, str]:
    """Return the names of those of these plans that have one and are still kept."""
    wanted = {plan_id for plan_id in plan_ids if plan_id is not None}
    if not wanted:
        return {}
    with context.database.read() as connection:
        return plans.names(connection, wanted)


def _find(connection: sqlite3.Connection | None, flight_id: int) -> Row:
    found = None if connection is None else reader.flight(connection, flight_id)
    if found is None:
        raise _missing(flight_id)
    return found


def _missing(flight_id: int) -> NotFoundError:
    return NotFoundError(f"there is no flight {flight_id} in the archive")


def track(context: Context, flight_id: int, form: str) -> Iterator[str]:
    """Write the track of a flight in one of `track_files.FORMATS`, as of now."""
    with reading(context) as connection:
        found = _find(connection, flight_id)
        if connection is None:
            return
        properties = {
            "flight_id": found["id"],
            "vehicle_id": found["vehicle_id"],
            "mission_id": found["mission_id"],
            "plan_id": found["plan_id"],
            "started_at": show_time(found["started_at"]),
            "ended_at": _show_time(found["ended_at"]),
        }
        _, write = track_files.FORMATS[form]
        yield from write(Track(properties, lambda: reader.points(connection, flight_id)))


def pictures(context: Context, flight_id: int, page: Page) -> Listing:
    """List the pictures of a flight without their data; raises NotFoundError."""
    return _of_flight(
        context,
        flight_id,
        lambda connection: fill(
            reader.pictures(connection, flight_id, after_id=page.after_id, limit=page.limit),
            lambda row: _show_picture(flight_id, row),
        ),
    )


def footprints(context: Context, flight_id: int, page: Page) -> Listing:
    """List what ground the pictures of a flight show; raises NotFoundError."""
    return _of_flight(
        context,
        flight_id,
        lambda connection: fill(
            reader.picture_heads(
                connection,
                flight_id,
                after_id=page.after_id,
                limit=page.limit,
                size_bytes=footprint.HEAD_BYTES,
            ),
            lambda row: {
                "id": row["number"],
                "corners": footprint.footprint(row["head"]),
                "band": footprint.band(row["head"]),
            },
        ),
    )


def observations(context: Context, flight_id: int, page: Page) -> Listing:
    """List the measurements of a flight; raises NotFoundError."""
    return _of_flight(
        context,
        flight_id,
        lambda connection: fill(
            reader.results(
                connection,
                flight_id,
                (Kind.OBSERVATION.value,),
                after_id=page.after_id,
                limit=page.limit,
            ),
            lambda row: {"id": row["id"], **_show_document(row)},
        ),
    )


def observations_csv(context: Context, flight_id: int) -> Iterator[str]:
    """Write all measurements of a flight as CSV, as of now."""
    with reading(context) as connection:
        _find(connection, flight_id)
        if connection is not None:
            yield from observation_files.write(_observed(connection, flight_id))


def _observed(connection: sqlite3.Connection, flight_id: int) -> Iterator[dict[str, Any]]:
    """Read the measurements, a part at a time."""
    after_id = 0
    while rows := reader.results(
        connection,
        flight_id,
        (Kind.OBSERVATION.value,),
        after_id=after_id,
        limit=MOST_RESULTS,
    ):
        after_id = rows[-1]["id"]
        for row in rows:
            yield json.loads(row["document"])


def _of_flight(
    context: Context, flight_id: int, read: Callable[[sqlite3.Connection], Listing]
) -> Listing:
    with reading(context) as connection:
        _find(connection, flight_id)
        return Listing() if connection is None else read(connection)


def picture(context: Context, flight_id: int, number: int) -> Picture:
    """Return a picture; raises NotFoundError."""
    with reading(context) as connection:
        _find(connection, flight_id)
        found = None if connection is None else reader.picture(connection, flight_id, number)
        if found is None:
            raise NotFoundError(f"flight {flight_id} has no picture {number}")
        return Picture(found["data"], _media_type(found["format"]), found["message_id"])


def thumbnail(context: Context, flight_id: int, number: int, found: Picture) -> bytes:
    """Return a small JPEG of a picture.

    Raises:
        NotFoundError: if the picture cannot be read.
        TooMuchError: if too many are wanted at once.
    """
    try:
        return context.thumbnails.of(found.key, found.data)
    except UnreadableError as error:
        message = f"picture {number} of flight {flight_id} has no thumbnail: {error}"
        raise NotFoundError(message) from None
    except BusyError as error:
        raise TooMuchError(str(error)) from None


def alarms(context: Context, page: Page) -> Listing:
    """List alarms, oldest first."""
    with reading(context) as connection:
        if connection is None:
            return Listing()
        return fill(reader.alarms(connection, **page._asdict()), _show_alarm)


def present_alarms(context: Context, since_s: float, limit: int) -> list[dict[str, Any]]:
    """Return open alarms and those newer than a time (`reader.present_alarms`), newest first."""
    with reading(context) as connection:
        if connection is None:
            return []
        return [_show_alarm(row) for row in reader.present_alarms(connection, since_s, limit)]


def alarm(context: Context, alarm_id: int) -> dict[str, Any]:
    """Return an alarm; raises NotFoundError."""
    with reading(context) as connection:
        found = None if connection is None else reader.alarm(connection, alarm_id)
        if found is None:
            raise NotFoundError(f"there is no alarm {alarm_id} in the archive")
        return _show_alarm(found)


def acknowledge(context: Context, alarm_id: int, name: str) -> dict[str, Any]:
    """Acknowledge an alarm; the first acknowledgement stays.

    Raises:
        NotFoundError: if there is no such alarm.
        UnavailableError: if the archive cannot be written; nothing is in the audit log.
    """
    shown = alarm(context, alarm_id)
    if shown["acknowledged_at"] is not None:
        return shown
    try:  # Outside of the transaction: no other write waits for the archive's disk
        context.archive.acknowledge(alarm_id, name, context.clock())
    except sqlite3.Error as error:
        raise UnavailableError(f"the flight archive cannot be written: {error}") from None
    with context.database.write():
        audit.about(f"alarms/history/{alarm_id}")
    return alarm(context, alarm_id)


def _show_flight(row: Row) -> dict[str, Any]:
    return {
        "id": row["id"],
        "vehicle_id": row["vehicle_id"],
        "mission_id": row["mission_id"],
        "plan_id": row["plan_id"],
        "started_at": show_time(row["started_at"]),
        "ended_at": _show_time(row["ended_at"]),
        "mission_status_id": row["mission_status_id"],
        "distance_m": round(row["distance_m"], 1),
        "pictures": row["pictures"],
        "alarms": row["alarms"],
    }


def _show_command(row: Row) -> dict[str, Any]:
    return {
        "command_id": row["command_id"],
        "command_status_id": row["status_id"],
        "command_status_name": Status(row["status_id"]).name,
        "message": row["message"],
        "started_at": _show_time(row["started_at"]),
        "ended_at": _show_time(row["ended_at"]),
    }


def _show_result(row: Row) -> dict[str, Any]:
    return {"kind": row["kind"], **_show_document(row)}


def _show_document(row: Row) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(row["document"])
    return {**document, "recorded_at": show_time(row["recorded_at"])}


def _show_picture(flight_id: int, row: Row) -> dict[str, Any]:
    url = f"/flights/{flight_id}/pictures/{row['number']}"
    return {
        "id": row["number"],
        "recorded_at": show_time(row["recorded_at"]),
        "name": row["name"],
        "size_bytes": row["size_bytes"],
        "latitude": row["latitude"],
        "longitude": row["longitude"],
        "altitude": row["altitude"],
        "content_type": _media_type(row["format"]),
        "url": url,
        "thumbnail_url": None if row["format"] in _WITHOUT_THUMBNAIL else f"{url}/thumbnail",
    }


def _media_type(form: str) -> str:
    return _MEDIA_TYPES.get(form, f"image/{form}")


def _show_alarm(row: Row) -> dict[str, Any]:
    kind = AlarmType(row["alarm_type_id"])
    return {
        "id": row["id"],
        "recorded_at": show_time(row["recorded_at"]),
        "vehicle_id": row["vehicle_id"],
        "flight_id": row["flight"],
        "mission_id": row["mission_id"],
        "alarm_type_id": int(kind),
        "alarm_type_name": kind.name,
        "alarm_code_id": row["alarm_code_id"],
        "param_array": json.loads(row["param_array"]),
        "description": row["message"],
        "acknowledged_at": _show_time(row["acknowledged_at"]),
        "acknowledged_by": row["acknowledged_by"],
    }


def _show_time(epoch_s: float | None) -> str | None:
    return None if epoch_s is None else show_time(epoch_s)
