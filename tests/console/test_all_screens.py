"""Every screen of the console, in each theme and on a phone too, by the rules of WCAG 2.2 AA."""

from pathlib import Path

import pytest

from edge_server.api.routes.planning.fields import EXAMPLE
from tests.support.browser import TEST_TIMEOUT_S, console_journey, sign_in_link
from tests.support.system import running, short_plan


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_no_screen_breaks_a_rule_of_accessibility(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, running(tmp_path / "farm") as farm:
        draft = farm.post("/plans/", short_plan() | {"dispatch": False})
        assert draft.status_code == 201, draft.text
        field = farm.post("/fields/", EXAMPLE)
        assert field.status_code == 201, field.text
        take(
            "all_screens",
            ADMIN_LINK=sign_in_link(farm, "admin", "ana"),
            DRAFT=str(draft.json()["id"]),
            FIELD=str(field.json()["id"]),
        )
