"""Indexes of a part of a table's rows; only migrations import them.

To name an option of PostgreSQL loads SQLAlchemy's whole dialect, 2 MB in each edge server.
"""

from typing import Any

from sqlalchemy import Column, Index, text

from edge_server.store.rows.tables import outbox, telemetry, work


def _index(name: str, *columns: Column[Any], where: str) -> Index:
    """Index the rows for which a condition holds."""
    return Index(name, *columns, sqlite_where=text(where), postgresql_where=text(where))


PARTIAL_INDEXES = (
    _index(
        "ix_telemetry_kind_size_bytes",
        telemetry.c.kind,
        telemetry.c.size_bytes,
        where="kind = 'image'",
    ),
    _index("ix_outbox_dead", outbox.c.id, where="state = 'dead'"),
    _index("ix_work_not_flown", work.c.vehicle_id, where="accepted_at IS NOT NULL AND NOT flown"),
)
