"""What stores use of their budgets and of the disk, as an administrator sees it."""

import shutil

from farm_flight_bridge import VERSION
from tests.unit.edge_server import documents
from tests.unit.edge_server.conftest import Edge

MIB = 1024 * 1024


def test_budgets_are_those_in_force(edge: Edge) -> None:
    found = edge.get("/storage", "admin")
    disk_bytes = shutil.disk_usage(edge.config.edge_dir).total
    assert found["version"] == VERSION
    assert found["database"] == "sqlite"
    assert 0 < found["records"]["budget_bytes"] <= edge.config.data_budget_mib * MIB
    assert 0 < found["pictures"]["budget_bytes"] <= edge.config.picture_budget_mib * MIB
    assert found["archive"]["budget_bytes"] == edge.config.archive_mib * MIB
    assert found["archive"]["days"] == edge.config.archive_days
    assert found["disk"]["total_bytes"] == disk_bytes
    assert 0 < found["disk"]["free_bytes"] <= disk_bytes


def test_what_is_reported_uses_its_budget(edge: Edge) -> None:
    before = edge.get("/storage", "admin")["records"]["used_bytes"]
    for number in range(20):
        edge.report("pose", documents.telemetry("pose", number, 1))
    assert edge.get("/storage", "admin")["records"]["used_bytes"] > before
