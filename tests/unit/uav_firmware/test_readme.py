"""The README and the pages of the autopilot agree with its code."""

import re
from dataclasses import fields
from pathlib import Path
from types import ModuleType

import pytest

from tests.support import pages, parameter_table
from uav_firmware.bus import Queue
from uav_firmware.config import read_config
from uav_firmware.modules.commander import module as commander
from uav_firmware.modules.land_detector import states
from uav_firmware.modules.logger import module as logger
from uav_firmware.modules.mavlink import module as mavlink
from uav_firmware.modules.navigator import module as navigator
from uav_firmware.modules.position_control import takeoff_ramp
from uav_firmware.topics import Topics
from uav_firmware.topology import Autopilot

PACKAGE = Path(__file__).parents[3] / "uav_firmware"
README = (PACKAGE / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def autopilot(tmp_path_factory: pytest.TempPathFactory) -> Autopilot:
    return parameter_table.autopilot(tmp_path_factory.mktemp("vehicle"))


def test_every_topic_stands_there() -> None:
    topics = Topics()
    declared = [
        f"`{entry.name}` (queue)"
        if isinstance(getattr(topics, entry.name), Queue)
        else f"`{entry.name}`"
        for entry in fields(Topics)
    ]
    assert sorted(
        row[0] for row in pages.rows(pages.section("reference/autopilot-topics.md", "Topics"))
    ) == sorted(declared)


def test_every_module_stands_there_with_its_rate(autopilot: Autopilot) -> None:
    rates = {group.name: 1e6 / group.period_us for group in autopilot.scheduler.groups}
    del rates["truth"]  # a second group of vehicle_io
    written = {}
    modules = README.split("\n## Modules\n")[1].split("\n## ")[0]
    for folder, _, _, rate in pages.rows(modules):
        name = folder.strip("`/").rsplit("/", 1)[1]
        written[name] = float(rate.removesuffix(" Hz"))
    assert written == pytest.approx(rates)
    folders = {path.parent.name for path in (PACKAGE / "modules").glob("*/module.py")}
    assert set(written) == folders


def test_every_module_that_a_topic_names_exists() -> None:
    modules = {path.parent.name for path in (PACKAGE / "modules").glob("*/module.py")}
    for _, writers, readers in pages.rows(pages.section("reference/autopilot-topics.md", "Topics")):
        named = re.findall(r"[a-z]+(?:_[a-z]+)*", writers + ", " + readers.split(", for ")[0])
        assert set(named) - {"all"} <= modules


@pytest.mark.parametrize("module", [commander, navigator, logger, mavlink])
def test_who_writes_and_reads_a_topic_is_as_the_module_states(module: ModuleType) -> None:
    name = module.__name__.split(".")[-2]
    table = pages.rows(pages.section("reference/autopilot-topics.md", "Topics"))
    for column, stated in ((1, module.WRITES), (2, module.READS)):
        documented = {
            row[0].split("`")[1] for row in table if name in re.split(r"[,; ]+", row[column])
        }
        assert documented == set(stated)


def test_every_flag_is_taken_and_every_default_is_right() -> None:
    defaults = read_config([], {})
    table = {
        row[0].strip("`"): row[2]
        for row in pages.rows(pages.text("reference/autopilot-settings.md"))
    }
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
    diagram = pages.section("reference/flight-modes.md", "Modes")
    for state, event in vars(module)["TRANSITIONS"]:
        assert state.name in diagram
        assert event.name in diagram


def test_every_line_of_the_checklist_has_proofs_and_every_proof_exists() -> None:
    table = pages.rows(pages.section("reference/conformance.md", "Checklist"))
    assert [line for line, _, _ in table] == [f"A{number}" for number in range(1, 15)]
    for line, _, proof in table:
        named = re.findall(r"`(tests/\S+?\.py)::(test_\w+)`", proof)
        assert len(named) == proof.count("`") // 2 > 0, line
        for path, name in named:
            text = (PACKAGE.parent / path).read_text(encoding="utf-8")
            assert re.search(rf"^def {name}\(", text, re.MULTILINE), f"{line}: {path}::{name}"
