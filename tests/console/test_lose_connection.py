"""The console without a connection, against an edge server without a flying vehicle."""

from pathlib import Path

import pytest

from tests.console.test_plan_together import edge_server, link
from tests.support.browser import TEST_TIMEOUT_S, console_journey


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_stop_stays_where_a_screen_cannot_be_loaded(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, edge_server(tmp_path) as (server, needs):
        take("lose_connection", **needs, JUAN_LINK=link(server, "juan"))
