"""`translate` prints what a plan becomes; nothing is flown."""

import io
import json
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.cli.program import UsageError
from mavlink_broker.cli.translate import FAMILIES, run
from tests.support.broker_world import first_flight, go_home, land, mission, takeoff, waypoint
from tests.support.vehicle_script import HOME

NOW = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
ROOT = Path(__file__).parents[4]
EXAMPLES = ROOT / "examples" / "plans"
PANORAMA = {"command_id": 1, "command_type_id": 10, "parameters": {"panorama_mode": 0}}


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    return saved(tmp_path, {"missions": [first_flight(), first_flight(1202, 2)]})


def saved(folder: Path, document: Any) -> Path:
    path = folder / "plan.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert run([*arguments, "--json"], NOW) == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    return document


@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize("name", ["first_flight.json", "eleven_commands.json"])
def test_the_examples_are_flown_by_every_family(
    name: str, family: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([str(EXAMPLES / name), "--family", family, "--json"], NOW) == 0
    capsys.readouterr()
    assert run([str(EXAMPLES / name), "--family", family], NOW) == 0
    assert "NAV_TAKEOFF (22)" in capsys.readouterr().out


def test_items_are_listed_as_they_are_uploaded(
    plan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = printed(capsys, str(plan), "--family", "px4")
    (segment,) = document["missions"][0]["segments"]
    items = segment["items"]
    assert [item["seq"] for item in items] == list(range(len(items)))
    assert [item["command"] for item in items] == [178, 22, 16, 16, 20]
    assert [item["command_id"] for item in items] == [1, 1, 1, 2, 3]
    assert items[1]["frame"] == 6
    assert items[1]["x"] == 404434000
    assert items[1]["param4"] is None


def test_several_missions_are_printed_separately(
    plan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = printed(capsys, str(plan))["missions"]
    assert [(one["mission_id"], one["vehicle_id"]) for one in both] == [(1201, 1), (1202, 2)]
    (second,) = printed(capsys, str(plan), "--vehicle-id", "2")["missions"]
    assert second["mission_id"] == 1202
    (first,) = printed(capsys, str(plan), "--mission-id", "1201")["missions"]
    assert first["vehicle_id"] == 1


def test_a_missing_mission_is_an_error(plan: Path) -> None:
    with pytest.raises(UsageError, match=r"only 1201 \(vehicle 1\), 1202 \(vehicle 2\)"):
        run([str(plan), "--mission-id", "7"], NOW)


def test_home_is_the_place_of_the_option(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [str(plan), "--family", "ardupilot", "--home", "40.5,-3.5,650"]
    item = printed(capsys, *arguments)["missions"][0]["segments"][0]["items"][0]
    assert (item["x"], item["y"], item["z"]) == (405000000, -35000000, 650.0)


@pytest.mark.parametrize("home", ["40.5,-3.5", "north,east,up", "91,0,0", "nan,0,0"])
def test_a_home_that_is_nowhere_is_refused(
    home: str, plan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        run([str(plan), "--home", home], NOW)
    assert ended.value.code == 2
    assert home in capsys.readouterr().err


def test_what_cannot_be_flown_is_named_with_its_parameter(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Only with a home position the path to it can be checked."""
    east = [HOME[1] + metres * 1.2e-5 for metres in (10, 15, 40)]
    hedge = [[HOME[0] + m * 9e-6, at] for m in (-50, 50) for at in east[:2]]
    plan = {
        "missions": [
            mission(takeoff(1), waypoint(2), go_home(3)),
            mission(takeoff(1), waypoint(2), land(3), mission_id=1202, vehicle_id=2),
        ],
        "geofence": {"exclusion": [[hedge[0], hedge[1], hedge[3], hedge[2]]]},
    }
    home = f"--home={HOME[0]},{east[2]},650"
    assert run([str(saved(tmp_path, plan)), "--json", home], NOW) == 1
    out, errors = capsys.readouterr()
    assert "mission 1201, command 3 (NAV_HOME) cannot be flown: landing" in errors
    refused, flown = json.loads(out)["missions"]
    assert refused["refused"]["command_id"] == 3
    assert refused["refused"]["parameter"] == "landing"
    assert "the leg there enters" in refused["refused"]["reason"]
    assert flown["segments"]


def test_a_leg_across_a_forbidden_area_is_refused(tmp_path: Path) -> None:
    """Both ends may be flown to; the leg between them may not."""
    west, east = HOME[1] - 1e-4, HOME[1] + 1e-4
    pond = [[HOME[0] + m * 9e-6, east_or_west] for m in (4, 6) for east_or_west in (west, east)]
    fence = {"exclusion": [[pond[0], pond[1], pond[3], pond[2]]]}
    plan = {"missions": [first_flight()], "geofence": fence}
    with pytest.raises(UsageError, match=r"command_array\.1\.parameters: the leg there enters"):
        run([str(saved(tmp_path, plan))], NOW)


def test_downgrades_are_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = saved(tmp_path, mission(takeoff(), waypoint(trajectory_control=2), go_home()))
    assert run([str(path)], NOW) == 0
    assert "command 2 (NAV_WAYPOINT): trajectory_control" in capsys.readouterr().out


def test_the_annex_counts_tens_of_seconds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flown = mission(takeoff(), waypoint(hold_time=1.5), go_home())
    path = saved(tmp_path, {"profile": "annex", "missions": [flown]})
    items = printed(capsys, str(path))["missions"][0]["segments"][0]["items"]
    assert [item["param1"] for item in items if item["command_id"] == 2] == [15.0]


@pytest.mark.parametrize("document", [{"missions": []}, [], {"missions": [{"vehicle_id": 1}]}, 7])
def test_what_is_no_plan_is_refused_with_its_paths(document: Any, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be flown") as refused:
        run([str(saved(tmp_path, document))], NOW)
    assert refused.value.status == 1


def test_a_rule_that_is_broken_names_the_field(tmp_path: Path) -> None:
    twice = mission(takeoff(1), waypoint(1), go_home(2))
    with pytest.raises(UsageError, match=r"missions.0.command_array.1.command_id") as refused:
        run([str(saved(tmp_path, {"plan": {"missions": [twice]}}))], NOW)
    assert refused.value.status == 1


def test_a_file_that_is_not_there_is_misuse(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="No such file") as refused:
        run([str(tmp_path / "none.json")], NOW)
    assert refused.value.status == 2


def test_a_plan_may_come_from_the_standard_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    raw = io.BytesIO(json.dumps(first_flight()).encode())
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(raw))
    assert len(printed(capsys, "-")["missions"]) == 1


@pytest.mark.thorough
def test_a_standard_output_without_room_is_reported_in_one_sentence(plan: Path) -> None:
    command = [sys.executable, "-m", "mavlink_broker", "translate", str(plan)]
    with Path("/dev/full").open("wb") as full:
        ended = subprocess.run(
            command, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert ended.returncode == 2
    assert ended.stderr == "mavlink_broker: the standard output: No space left on device\n"
