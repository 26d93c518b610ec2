"""The plan editor in a browser, against an edge server without a flying vehicle."""

from pathlib import Path

import pytest

from edge_server.api.routes.planning.fields import EXAMPLE
from tests.console.test_plan_together import edge_server, post
from tests.support.browser import TEST_TIMEOUT_S, console_journey
from tests.support.system import short_plan


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_a_draft_is_edited_and_flown_from_the_editor(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, edge_server(tmp_path) as (server, needs):
        field = post(server, "/fields/", {"boundary": EXAMPLE["boundary"]})
        fence = {"inclusion": [EXAMPLE["boundary"]], "max_altitude": 60.0}
        plan = short_plan(2) | {"dispatch": False, "name": "Fenced", "geofence": fence}
        fenced = post(server, "/plans/", plan)
        take("edit_a_plan", **needs, FIELD=str(field["id"]), FENCED=str(fenced["id"]))
