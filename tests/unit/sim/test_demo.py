from pathlib import Path

import pytest

from sim.camera.develop import develop
from sim.demo import DemoError, read_plan, show_pictures
from sim.settings import from_environment
from tests.unit.sim.camera.shots import order, pose


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


def test_the_pictures_of_this_flight_are_laid_on_sheets(tmp_path: Path) -> None:
    settings = from_environment({"STATE_DIR": str(tmp_path)})
    folder = tmp_path / "vehicle-1" / "image"
    for number in range(2):
        develop(order(folder, number, pose(20.0, 60.0, 30.0, -90.0, 0.0), width_px=64))
    said: list[str] = []
    show_pictures(settings, {1: frozenset({"0.jpg"})}, said.append)
    (line,) = said
    assert "vehicle 1: 1 picture, " in line
    assert (tmp_path / "album" / "vehicle-1" / "mosaic.jpg").stat().st_size > 500


def test_without_pictures_nothing_is_said(tmp_path: Path) -> None:
    said: list[str] = []
    show_pictures(from_environment({"STATE_DIR": str(tmp_path)}), {1: frozenset()}, said.append)
    assert said == []
