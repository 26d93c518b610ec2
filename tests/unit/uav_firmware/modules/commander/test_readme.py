"""The tables of the commander's README and pages are those of the code."""

import re
from pathlib import Path

import uav_firmware.modules.commander as package
from tests.support import pages
from tests.support.toy_vehicle import ToyVehicle
from uav_firmware.modules.commander import health_checks
from uav_firmware.modules.commander.arm_state_machine import TRANSITIONS
from uav_firmware.modules.commander.commands.dispatch import HANDLERS
from uav_firmware.modules.commander.failsafe.causes import Cause
from uav_firmware.modules.commander.failsafe_actions import Action
from uav_firmware.modules.commander.mode_requirements import REQUIREMENTS, STARTABLE, Need

FOLDER = Path(str(package.__file__)).parent
TEXT = (FOLDER / "README.md").read_text(encoding="utf-8")


PAGES = {
    "Arming": ("reference/arming.md", "Arming"),
    "Commands": ("reference/mavlink-commands.md", "Flight commands"),
    "Failsafes": ("reference/failsafes.md", "Failsafes"),
    "Modes": ("reference/flight-modes.md", "What a mode needs"),
}


def section(title: str) -> str:
    if title in PAGES:
        return pages.section(*PAGES[title])
    return TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]


def rows(title: str) -> list[list[str]]:
    """Cells of a section's table rows, heads left out."""
    lines = [line for line in section(title).splitlines() if line.startswith("| `")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_every_cause_stands_there_in_order() -> None:
    assert [row[0].strip("`") for row in rows("Failsafes")] == [cause.name for cause in Cause]


def test_every_parameter_that_is_named_exists() -> None:
    vehicle = ToyVehicle()
    known = set(vehicle.registry.names())
    named = set(re.findall(r"`([A-Z][A-Z0-9]+_[A-Z0-9_]+)`", section("Failsafes")))
    named -= {cause.name for cause in Cause}
    assert named <= known
    assert len(named) > 15


def test_the_order_of_the_actions() -> None:
    assert " < ".join(action.name for action in sorted(Action)) in section("Failsafes")


def test_the_diagram_of_the_failsafe_machine() -> None:
    diagram = [line for line in section("Failsafes").splitlines() if re.match(r" {4}\w.*-->", line)]
    code = (FOLDER / "failsafe" / "machine.py").read_text(encoding="utf-8").splitlines()
    assert diagram == [line for line in code if re.match(r" {4}\w.*-->", line)]
    assert len(diagram) == 10


def test_the_table_of_modes() -> None:
    documented = {row[0].strip("`"): row[1:] for row in rows("Modes")}
    assert documented == {
        state.name: [
            *("x" if need in needs else "" for need in Need),
            "x" if state in STARTABLE else "",
        ]
        for state, needs in REQUIREMENTS.items()
    }


def test_the_table_of_arming() -> None:
    documented = {
        (state.strip("`"), event.strip("`")): then.strip("`")
        for state, event, then, _ in (row for row in rows("Arming") if len(row) == 4)
    }
    assert documented == {(s.name, e.name): then.name for (s, e), then in TRANSITIONS.items()}


def test_every_arming_check_stands_there() -> None:
    documented = {
        name
        for check, *_ in (row for row in rows("Arming") if len(row) == 2)
        for name in re.findall(r"`([a-z_]+)`", check)
    }
    checks = health_checks.ARMING_CHECKS + health_checks.POSITION_CHECKS
    assert documented == {check.__name__ for check in checks}


def test_every_command_stands_there() -> None:
    documented = {int(n) for row in rows("Commands") for n in re.findall(r"` (\d+)", row[0])}
    assert documented == {int(command) for command in HANDLERS}


def test_the_readme_lists_every_file() -> None:
    named = set(re.findall(r"`(\w+\.py)`", section("How it is built")))
    assert named == {path.name for path in FOLDER.glob("*.py")} - {"__init__.py"}
