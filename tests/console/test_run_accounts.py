"""An administrator at the console, in a real Chromium, against the running system."""

from pathlib import Path
from typing import Any

import pytest
import requests

from tests.support.browser import TEST_TIMEOUT_S, console_journey, sign_in_link
from tests.support.system import FarmSystem, running


@pytest.mark.thorough
@pytest.mark.timeout(TEST_TIMEOUT_S)
def test_accounts_sessions_and_keys_are_made_changed_and_ended(tmp_path: Path) -> None:
    with console_journey(tmp_path) as take, running(tmp_path / "farm") as farm:
        take("run_accounts", ADMIN_LINK=sign_in_link(farm, "admin", "ana"))
        names = [one["name"] for one in _read(farm, "/users/")]
        keys = {one["name"]: one["role"] for one in _read(farm, "/keys/")}
    assert names == ["ana"]
    assert keys["north-broker"] == "broker"


def _read(farm: FarmSystem, path: str) -> list[dict[str, Any]]:
    url = f"{farm.settings.edge_url}{path}"
    answer = requests.get(url, headers=farm.headers("admin"), timeout=10)
    listed: list[dict[str, Any]] = answer.json()
    return listed
