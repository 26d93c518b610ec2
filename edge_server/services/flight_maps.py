"""The map of a survey: the pictures of a flight that look down, laid out on the ground.

Pictures of one band make a map: colours, near infrared, or the vegetation index.
"""

import json
from typing import Any, Final

from edge_server.archive import reader
from edge_server.pictures import footprint, index_colours, mosaics
from edge_server.pictures.mosaics import MapKey
from edge_server.pictures.program import BusyError
from edge_server.services import audit, flight_archive
from edge_server.services.context import Context, show_time
from edge_server.services.errors import (
    ConflictError,
    NotFoundError,
    TooMuchError,
)

MEDIA_TYPE: Final = "image/webp"
_PAGE: Final = 500


def overview(context: Context, flight_id: int, band: str) -> dict[str, Any]:
    """Return the state of a flight's map, and what it shows once it is made.

    Raises NotFoundError if there is no such flight.
    """
    flight_archive.flight(context, flight_id)
    key = MapKey(flight_id, band)
    state, reason = "none", context.mosaics.failure(key)
    stored = _stored(context, key)
    if context.mosaics.is_making(key):
        state, reason = "making", None
    elif reason is not None:
        state = "failed"
    elif stored is not None:
        state = "ready"
    shown: dict[str, Any] = {"band": band, "state": state, "reason": reason}
    shown |= {"url": None, "made_at": None}
    if stored is None:
        return {**shown, "corners": None, "pictures": 0, "metres_per_px": None}
    return shown | _show_map(key, stored)


def listing(
    context: Context, *, after_id: int, limit: int, vehicle_id: int | None
) -> list[dict[str, Any]]:
    """List the maps that are made, in the order in which they were made; one made anew is last."""
    with flight_archive.reading(context) as connection:
        if connection is None:
            return []
        rows = reader.flight_maps(connection, after_id=after_id, limit=limit, vehicle_id=vehicle_id)
    names = flight_archive.plan_names(context, {row["plan_id"] for row in rows})
    return [
        {"id": row["id"], "flight_id": row["flight"], "vehicle_id": row["vehicle_id"]}
        | {"plan_name": names.get(row["plan_id"]), "band": row["band"]}
        | _show_map(MapKey(row["flight"], row["band"]), row)
        for row in rows
    ]


def _show_map(key: MapKey, stored: reader.Row) -> dict[str, Any]:
    """Show where the picture of a map is, and what ground it shows."""
    about = json.loads(stored["about"])
    band, made_at = key.band, stored["made_at"]
    return {
        "url": f"/flights/{key.flight_id}/map/picture?band={band}&made={int(made_at)}",
        "made_at": show_time(made_at),
        "corners": about["corners"],
        "pictures": about["pictures"],
        "metres_per_px": about["metres_per_px"],
    }


def picture(context: Context, flight_id: int, band: str) -> bytes:
    """Return the map as a WebP; raises NotFoundError."""
    flight_archive.flight(context, flight_id)
    stored = _stored(context, MapKey(flight_id, band))
    if stored is None:
        raise NotFoundError(f"flight {flight_id} has no {band} map yet")
    data: bytes = stored["data"]
    return data


def make(context: Context, flight_id: int, band: str) -> dict[str, Any]:
    """Begin to make the map of a flight; an existing one is replaced when the new one is done.

    Raises:
        NotFoundError: if there is no such flight.
        ConflictError: if fewer than two of its pictures of the band look down.
        TooMuchError: while another map is made.
    """
    flight_archive.flight(context, flight_id)
    key = MapKey(flight_id, band)
    placed = _placed(context, key)
    if len(placed) < 2:
        raise ConflictError(
            f"flight {flight_id} has no {band} map: fewer than two of its pictures of this band "
            "look down, or say where they were taken"
        )
    step = -(-len(placed) // mosaics.MOST_PICTURES)
    chosen = placed[::step]
    try:
        context.mosaics.begin(key, lambda: _make(context, key, chosen))
    except BusyError as error:
        raise TooMuchError(str(error)) from None
    with context.database.write():
        audit.about(f"flights/{flight_id}/map?band={band}")
    return overview(context, flight_id, band)


def _make(context: Context, key: MapKey, placed: list[tuple[int, Any]]) -> None:
    numbers = [number for number, _ in placed]
    made = mosaics.lay_out(
        [corners for _, corners in placed],
        lambda index: flight_archive.picture(context, key.flight_id, numbers[index]).data,
        colours=index_colours.colours_of_grey() if key.band == "ndvi" else None,
    )
    about = json.dumps(made.about)
    context.archive.keep_map(*key, about, made.data, context.clock())


def _placed(context: Context, key: MapKey) -> list[tuple[int, Any]]:
    """List the pictures of a band that look down, with their corners on the ground."""
    found: list[tuple[int, Any]] = []
    after_id = 0
    with flight_archive.reading(context) as connection:
        while connection is not None:
            heads = list(
                reader.picture_heads(
                    connection,
                    key.flight_id,
                    after_id=after_id,
                    limit=_PAGE,
                    size_bytes=footprint.HEAD_BYTES,
                )
            )
            for row in heads:
                is_of_band = footprint.band(row["head"]) == key.band
                corners = footprint.footprint(row["head"]) if is_of_band else None
                if corners is not None:
                    found.append((row["number"], corners))
            if len(heads) < _PAGE:
                break
            after_id = heads[-1]["number"]
    return found


def _stored(context: Context, key: MapKey) -> reader.Row | None:
    with flight_archive.reading(context) as connection:
        return None if connection is None else reader.flight_map(connection, *key)
