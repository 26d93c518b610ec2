"""The connected vehicles: one row each, as a table or as JSON."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.vehicle import Vehicle

COLUMNS: Final = (
    *("system_id", "vehicle_id", "autopilot", "type", "family", "version", "link_state"),
    *("mode", "armed", "latitude", "longitude", "altitude", "battery_percentage"),
)
"""Altitude in metres above home, the battery as a fraction; unknown values are null."""
_NOTHING: Final = "-"


def row(vehicle: Vehicle, now: float) -> dict[str, Any]:
    """Describe one vehicle."""
    snapshot = vehicle.snapshot
    position = snapshot.position
    values = (
        vehicle.route.target_system,
        vehicle.vehicle_id,
        _name("MAV_AUTOPILOT", vehicle.autopilot),
        _name("MAV_TYPE", vehicle.vehicle_type),
        vehicle.family.name,
        vehicle.version,
        vehicle.link_state(now).value,
        None if snapshot.armed is None else vehicle.mode,
        snapshot.armed,
        None if position is None else position.latitude_deg,
        None if position is None else position.longitude_deg,
        None if position is None else position.altitude_m,
        snapshot.battery_fraction,
    )
    return dict(zip(COLUMNS, values, strict=True))


def table(rows: Iterable[dict[str, Any]]) -> Iterator[str]:
    """Give the rows as a table."""
    cells = [[_cell(one.get(column)) for column in COLUMNS] for one in rows]
    rows_of_text: list[Sequence[str]] = [COLUMNS, *cells]
    widths = [max(len(line[i]) for line in rows_of_text) for i in range(len(COLUMNS))]
    for line in rows_of_text:
        yield "  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip()


def _name(enumeration: str, number: int | None) -> str | None:
    if number is None:
        return None
    entry = mavlink.enums[enumeration].get(number)
    return str(number) if entry is None else str(entry.name).removeprefix(f"{enumeration}_").lower()


def _cell(value: Any) -> str:
    match value:
        case None:
            return _NOTHING
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:.7g}" if abs(value) < 1 else f"{value:.7f}".rstrip("0").rstrip(".")
        case _:
            return str(value)
