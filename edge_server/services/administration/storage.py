"""What the edge server stores, and what its budgets and its disk leave."""

import shutil
from typing import Any

from edge_server.services.context import Context
from edge_server.services.space import budgets
from farm_flight_bridge import VERSION

_MIB = 1024 * 1024


def overview(context: Context) -> dict[str, Any]:
    """Return the version, and for each store the bytes that it uses and may use.

    The budgets are those in force: as set, limited by a small disk. On PostgreSQL the records lie
    with another program, so `disk` is that of the archive and the keys alone.
    """
    config, database = context.config, context.database
    records_budget, pictures_budget = budgets(config, database.is_shared)
    used = context.space.measure()
    archive = context.archive.figures()
    disk = shutil.disk_usage(config.edge_dir)
    return {
        "version": VERSION,
        "database": "postgresql" if database.is_shared else "sqlite",
        "records": {"used_bytes": used.data_bytes, "budget_bytes": records_budget},
        "pictures": {"used_bytes": used.picture_bytes, "budget_bytes": pictures_budget},
        "archive": {
            "used_bytes": archive.file_bytes,
            "budget_bytes": config.archive_mib * _MIB,
            "days": config.archive_days,
            "flights": archive.flights,
            "is_working": archive.is_working,
            "lost_reports": archive.lost,
        },
        "disk": {"free_bytes": disk.free, "total_bytes": disk.total},
    }
