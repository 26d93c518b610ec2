"""Which table a row belongs to that was found in a page without its tree; pure.

Rows in pages do not name their table. Of the tables with data of people and brokers, no two have
rows of the same shape: number of columns, type of each value, and content of its JSON.

Left out are access keys, since a copy from before its revocation would be valid again; the audit
log, whose chain shows what is missing; and tables that can be made again: idempotency, streams.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

from sqlalchemy import Boolean, Column, Float, Integer, LargeBinary, String, Table

from edge_server.store.files.salvage import Row, Value
from edge_server.store.rows.tables import (
    command,
    event,
    field,
    plan,
    tombstone,
    vehicle,
    vehicle_hold,
    withdrawn,
    work,
)

TABLES: Final = (plan, work, command, event, field, vehicle, vehicle_hold, withdrawn, tombstone)
JSON_COLUMNS: Final[Mapping[str, Mapping[str, type]]] = {
    "plan": {"body": dict, "warnings": list},
    "work": {"body": dict, "report": dict},
    "field": {"body": dict},
    "vehicle": {"state": dict},
}
"""Columns that hold JSON, and its type."""
_BOUNDARY: Final = "boundary"
"""What every field has, and no vehicle."""
_QUEUED: Final = "queued"
_MISSION: Final = "mission"


def row_of(table: Table, names: Sequence[str], found: Row) -> dict[str, Any] | None:
    """Return a row by its columns if it may be one of this table, else None.

    `names` are the columns in the order of the database. A queued mission is held, since the row
    may be older than the mission's last change.
    """
    if len(found.values) != len(names):
        return None
    row: dict[str, Any] = {}
    for name, value in zip(names, found.values, strict=True):
        column = table.columns[name]
        if _is_rowid(table, column):
            if value is not None or found.rowid < 1:
                return None
            row[column.name] = found.rowid
        elif _fits(column, value):
            row[column.name] = value
        else:
            return None
    if not has_readable_json(table.name, row):
        return None
    if table is work and row["kind"] == _MISSION and row["state"] == _QUEUED:
        row["held"] = 1
    return row


def _is_rowid(table: Table, column: Column[Any]) -> bool:
    """Whether SQLite keeps a column as the row's own number, and NULL in its place."""
    alone = len(table.primary_key.columns) == 1
    return column.primary_key and alone and isinstance(column.type, Integer)


def _fits(column: Column[Any], value: Value) -> bool:
    kind = column.type
    if value is None:
        return bool(column.nullable)
    if isinstance(kind, Boolean):
        return value in {0, 1}
    if isinstance(kind, Float):
        return isinstance(value, (int, float))  # SQLite keeps 2.0 as 2
    if isinstance(kind, LargeBinary):
        return isinstance(value, bytes) and len(value) <= (kind.length or len(value))
    if isinstance(kind, String):
        return isinstance(value, str) and len(value) <= (kind.length or len(value))
    return isinstance(kind, Integer) and isinstance(value, int)


def has_readable_json(table: str, row: Mapping[str, Any]) -> bool:
    """Whether the JSON in a row of a table can be read and is of that table."""
    for name, kind in JSON_COLUMNS.get(table, {}).items():
        if row.get(name) is None:
            continue
        try:
            document = json.loads(row[name])
        except (ValueError, TypeError, RecursionError):
            return False
        is_field = isinstance(document, dict) and _BOUNDARY in document
        if table in {"field", "vehicle"} and is_field != (table == "field"):
            return False
        if not isinstance(document, kind):
            return False
    return True
