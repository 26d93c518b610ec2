"""The tester in the whole system: what a person says reaches the cloud."""

from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import Status
from tests.support.system import FarmSystem, short_plan, wait_for

pytestmark = pytest.mark.scenario

SCRIPT = """\
2
40.5
-3.5
12.5
270
1
2
4
2
55
1
# In the second command the navigation fails
3
2
3
0.5
1.5
0
@auto 0.2
"""


def test_entered_values_reach_the_cloud(tmp_path: Path) -> None:
    script = tmp_path / "script"
    script.write_text(SCRIPT)
    with FarmSystem(tmp_path / "state", vehicles=0, tester_script=script) as system:
        system.start().wait_until_connected()
        answer = system.post("/plans/", short_plan())
        assert answer.status_code == 201, answer.text
        (mission,) = system.wait_until_ended(answer.json()["id"])["missions"]
        statuses = [command["command_status_id"] for command in mission["command_array"]]
        assert statuses == [Status.FINISHED, Status.FAILED, Status.ABORTED]
        assert mission["mission_status_id"] == Status.FAILED
        system.wait_until_delivered()
        held = {kind: newest(system, kind) for kind in ("pose", "battery", "observation", "alarm")}
    assert (held["pose"]["latitude"], held["pose"]["yaw"]) == (40.5, pytest.approx(270.0))
    assert held["battery"]["percentage"] == pytest.approx(0.55)
    assert held["battery"]["capacity"] == pytest.approx(3.0)
    assert held["observation"]["observation_array"][0]["resource_id"] == "temp"
    assert (held["alarm"]["alarm_type_id"], held["alarm"]["alarm_code_id"]) == (2, 52)
    assert held["alarm"]["param_array"] == [0.5, 1.5]


def newest(system: FarmSystem, kind: str) -> dict[str, Any]:
    """The newest of a kind at the cloud; a busy broker may post it behind the mission's end."""
    received = wait_for(lambda: system.cloud(f"/{kind}"), f"{kind} at the cloud")
    body: dict[str, Any] = received[-1]["body"]
    return body
