"""The firmware's README is held to the firmware."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from tests.support import parameter_table
from uav_firmware.bus import Queue
from uav_firmware.config import read_config
from uav_firmware.modules.land_detector import states
from uav_firmware.modules.position_control import takeoff_ramp
from uav_firmware.topics import Topics
from uav_firmware.topology import Autopilot

PACKAGE = Path(__file__).parents[3] / "uav_firmware"
README = (PACKAGE / "README.md").read_text(encoding="utf-8")


def rows(heading: str) -> list[list[str]]:
    """Cells of the first table under a heading, without its head."""
    section = README.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[2:]]


@pytest.fixture(scope="module")
def autopilot(tmp_path_factory: pytest.TempPathFactory) -> Autopilot:
    return parameter_table.autopilot(tmp_path_factory.mktemp("vehicle"))


def test_every_parameter_stands_there_as_it_is_declared() -> None:
    assert README.endswith(parameter_table.table()), "run python -m tests.support.parameter_table"


def test_every_topic_stands_there() -> None:
    topics = Topics()
    declared = [
        f"`{entry.name}` (queue)"
        if isinstance(getattr(topics, entry.name), Queue)
        else f"`{entry.name}`"
        for entry in fields(Topics)
    ]
    assert sorted(row[0] for row in rows("Topics")) == sorted(declared)


def test_every_module_stands_there_with_its_rate(autopilot: Autopilot) -> None:
    rates = {group.name: 1e6 / group.period_us for group in autopilot.scheduler.groups}
    del rates["truth"]  # a second group of vehicle_io
    written = {}
    for folder, _, _, rate in rows("Modules"):
        name = folder.strip("`/").rsplit("/", 1)[1]
        written[name] = float(rate.removesuffix(" Hz"))
    assert written == pytest.approx(rates)
    folders = {path.parent.name for path in (PACKAGE / "modules").glob("*/module.py")}
    assert set(written) == folders


def test_every_module_that_a_topic_names_exists() -> None:
    modules = {path.parent.name for path in (PACKAGE / "modules").glob("*/module.py")}
    for _, writers, readers in rows("Topics"):
        named = re.findall(r"[a-z]+(?:_[a-z]+)*", writers + ", " + readers.split(", for ")[0])
        assert set(named) - {"all"} <= modules


def test_every_flag_is_taken_and_every_default_is_right() -> None:
    defaults = read_config([], {})
    table = {row[0].strip("`"): row[2] for row in rows("Run it alone")}
    assert float(table["--speed"]) == defaults.speed
    assert int(table["--seed"]) == defaults.seed
    assert float(table["--wind"]) == defaults.wind_m_s
    assert float(table["--wind-from"]) == defaults.wind_from_deg
    assert float(table["--noise"]) == defaults.noise
    assert table["--bind"] == defaults.bind
    assert table["--driver"] == defaults.driver
    assert table["--state-dir"] == str(defaults.state_dir)
    for flag in table:
        value = {
            "--driver": "jsbsim",
            "--home": "1,2,3,4",
            "--truth": "1",
            "--setup-signing": "signed",
        }.get(flag, "1")
        read_config([flag, "host:1" if flag in {"--broker", "--gcs"} else value], {})


@pytest.mark.parametrize("module", [states, takeoff_ramp], ids=["landed states", "take-off"])
def test_every_state_and_event_stands_in_its_diagram(module: object) -> None:
    diagram = README.split("\n## Modes\n")[1]
    for state, event in vars(module)["TRANSITIONS"]:
        assert state.name in diagram
        assert event.name in diagram


def test_every_line_of_the_checklist_has_proofs_and_every_proof_exists() -> None:
    table = rows("What ground stations can rely on")
    assert [line for line, _, _ in table] == [f"A{number}" for number in range(1, 15)]
    for line, _, proof in table:
        named = re.findall(r"`(tests/\S+?\.py)::(test_\w+)`", proof)
        assert len(named) == proof.count("`") // 2 > 0, line
        for path, name in named:
            text = (PACKAGE.parent / path).read_text(encoding="utf-8")
            assert re.search(rf"^def {name}\(", text, re.MULTILINE), f"{line}: {path}::{name}"
