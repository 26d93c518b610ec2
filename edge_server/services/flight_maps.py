"""The map of a survey: the pictures of a flight that look down, laid out on the ground."""

import json
import sqlite3
from typing import Any, Final

from edge_server.archive import reader
from edge_server.pictures import footprint, mosaics
from edge_server.pictures.program import BusyError
from edge_server.services import audit, flight_archive
from edge_server.services.context import Context, show_time
from edge_server.services.errors import (
    ConflictError,
    NotFoundError,
    TooMuchError,
    UnavailableError,
)

MEDIA_TYPE: Final = "image/webp"
_PAGE: Final = 500


def overview(context: Context, flight_id: int) -> dict[str, Any]:
    """Return the state of a flight's map, and what it shows once it is made.

    Raises NotFoundError if there is no such flight.
    """
    flight_archive.flight(context, flight_id)
    state, reason = "none", context.mosaics.failure(flight_id)
    stored = _stored(context, flight_id)
    if context.mosaics.is_making(flight_id):
        state, reason = "making", None
    elif reason is not None:
        state = "failed"
    elif stored is not None:
        state = "ready"
    shown: dict[str, Any] = {"state": state, "reason": reason, "url": None, "made_at": None}
    if stored is None:
        return {**shown, "corners": None, "pictures": 0, "metres_per_px": None}
    about = json.loads(stored["about"])
    return {
        **shown,
        "url": f"/flights/{flight_id}/map/picture?made={int(stored['made_at'])}",
        "made_at": show_time(stored["made_at"]),
        "corners": about["corners"],
        "pictures": about["pictures"],
        "metres_per_px": about["metres_per_px"],
    }


def picture(context: Context, flight_id: int) -> bytes:
    """Return the map as a WebP; raises NotFoundError."""
    flight_archive.flight(context, flight_id)
    stored = _stored(context, flight_id)
    if stored is None:
        raise NotFoundError(f"flight {flight_id} has no map yet")
    data: bytes = stored["data"]
    return data


def make(context: Context, flight_id: int) -> dict[str, Any]:
    """Begin to make the map of a flight; an existing one is replaced when the new one is done.

    Raises:
        NotFoundError: if there is no such flight.
        ConflictError: if fewer than two of its pictures look down.
        TooMuchError: while another map is made.
    """
    flight_archive.flight(context, flight_id)
    placed = _placed(context, flight_id)
    if len(placed) < 2:
        raise ConflictError(
            f"flight {flight_id} has no map: fewer than two of its pictures look down, or say "
            "where they were taken"
        )
    step = -(-len(placed) // mosaics.MOST_PICTURES)
    chosen = placed[::step]
    try:
        context.mosaics.begin(flight_id, lambda: _make(context, flight_id, chosen))
    except BusyError as error:
        raise TooMuchError(str(error)) from None
    with context.database.write():
        audit.about(f"flights/{flight_id}/map")
    return overview(context, flight_id)


def _make(context: Context, flight_id: int, placed: list[tuple[int, Any]]) -> None:
    numbers = [number for number, _ in placed]
    made = mosaics.lay_out(
        [corners for _, corners in placed],
        lambda index: flight_archive.picture(context, flight_id, numbers[index]).data,
    )
    context.archive.keep_map(flight_id, json.dumps(made.about), made.data, context.clock())


def _placed(context: Context, flight_id: int) -> list[tuple[int, Any]]:
    """List the pictures that look down, with their corners on the ground."""
    found: list[tuple[int, Any]] = []
    after_id = 0
    try:
        with context.archive.reading() as connection:
            while connection is not None:
                heads = list(
                    reader.picture_heads(
                        connection,
                        flight_id,
                        after_id=after_id,
                        limit=_PAGE,
                        size_bytes=footprint.HEAD_BYTES,
                    )
                )
                for row in heads:
                    corners = footprint.footprint(row["head"])
                    if corners is not None:
                        found.append((row["number"], corners))
                if len(heads) < _PAGE:
                    break
                after_id = heads[-1]["number"]
    except sqlite3.Error as error:
        raise UnavailableError(f"the flight archive cannot be read: {error}") from None
    return found


def _stored(context: Context, flight_id: int) -> reader.Row | None:
    try:
        with context.archive.reading() as connection:
            return None if connection is None else reader.flight_map(connection, flight_id)
    except sqlite3.Error as error:
        raise UnavailableError(f"the flight archive cannot be read: {error}") from None
