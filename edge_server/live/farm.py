"""The state of the farm as a reader sees it, and what differs between two of them; pure."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

Row = Mapping[str, Any]


class Farm(NamedTuple):
    """Rows by their id, as the REST paths show them."""

    vehicles: Mapping[int, Row]
    missions: Mapping[int, Row]
    """Those that have not ended, and the latest of the others."""
    events: Mapping[int, Row]
    alarms: Mapping[int, Row]
    """The latest ones of the flight archive."""
    uplink: Row


NOTHING = Farm({}, {}, {}, {}, {})


def differences(before: Farm, after: Farm) -> Iterator[tuple[str, int | None, Any]]:
    """Give what has changed: the name of the event, the vehicle that it is about, its object.

    A vehicle that was deleted is `vehicle_removed`. A mission, event or alarm that is no
    longer among the latest has not changed.
    """
    for vehicle_id in before.vehicles.keys() - after.vehicles.keys():
        yield "vehicle_removed", vehicle_id, {"vehicle_id": vehicle_id}
    for name, old, new in (
        ("vehicle", before.vehicles, after.vehicles),
        ("mission", before.missions, after.missions),
        ("event", before.events, after.events),
        ("alarm", before.alarms, after.alarms),
    ):
        for identifier, row in new.items():
            if old.get(identifier) != row:
                yield name, row["vehicle_id"], row
    if before.uplink != after.uplink:
        yield "uplink", None, after.uplink


def snapshot(farm: Farm, vehicle_ids: frozenset[int] | None) -> dict[str, Any]:
    """Give the complete state, of these vehicles alone (None: of all)."""

    def permitted(rows: Mapping[int, Row]) -> list[Row]:
        return [
            row for row in rows.values() if vehicle_ids is None or row["vehicle_id"] in vehicle_ids
        ]

    return {
        "vehicles": permitted(farm.vehicles),
        "missions": permitted(farm.missions),
        "events": permitted(farm.events),
        "alarms": permitted(farm.alarms),
        "uplink": farm.uplink,
    }
