"""The console without a connection, against an edge server without a flying vehicle."""

from datetime import UTC, datetime
from pathlib import Path

import pytest
import requests

from tests.console.test_plan_together import edge_server, headers, link
from tests.support.browser import TEST_TIMEOUT_S, console_journey

LOST_S = 25 * 3600


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_stop_stays_where_a_screen_cannot_be_loaded(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, edge_server(tmp_path) as (server, needs):
        lost = {
            "link_state": "lost",
            "position_age": LOST_S,
            "recorded_at": datetime.now(UTC).isoformat(),
        }
        vehicle = f"{server.url}/vehicles/2"
        answer = requests.put(vehicle, json=lost, headers=headers(server), timeout=10)
        assert answer.ok, answer.text
        take("lose_connection", **needs, JUAN_LINK=link(server, "juan"))
