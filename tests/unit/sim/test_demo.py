from pathlib import Path

import pytest

from sim.demo import DemoError, read_plan
from sim.settings import from_environment


def test_the_demo_flies_as_many_vehicles_as_a_plan_may_have() -> None:
    assert len(read_plan(from_environment({"VEHICLES": "16"}))["missions"]) == 16
    with pytest.raises(DemoError, match="VEHICLES: a plan holds 1 to 16 missions, not 17"):
        read_plan(from_environment({"VEHICLES": "17"}))


@pytest.mark.parametrize("text", ["", "[]", "{}", '"plan"', '{"missions": 3}', "\x00"])
def test_a_file_that_holds_no_plan_is_named(text: str, tmp_path: Path) -> None:
    path = tmp_path / "broken.json"
    path.write_text(text)
    with pytest.raises(DemoError, match=r"broken\.json holds no plan"):
        read_plan(from_environment({"VEHICLES": "2", "PLAN": str(path)}))
