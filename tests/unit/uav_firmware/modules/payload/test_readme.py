"""The README is held to the module."""

import re
from pathlib import Path

import uav_firmware.modules.payload as package
from uav_firmware.modules.navigator.mission.route import PAYLOAD
from uav_firmware.modules.payload.camera.states import TRANSITIONS
from uav_firmware.modules.payload.orders import _HANDLERS
from uav_firmware.msg.payload import PayloadCommand

FOLDER = Path(str(package.__file__)).parent
TEXT = (FOLDER / "README.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    return TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]


def test_every_command_stands_there_and_has_a_handler() -> None:
    told = re.findall(r"^\| ([A-Z_]+) (\d+)( M)? \|", section("Commands"), re.MULTILINE)
    assert {(name, int(number)) for name, number, _ in told} == {
        (command.name, command.value) for command in PayloadCommand
    }
    assert {int(number) for _, number, item in told if item} == {int(c) for c in PAYLOAD}
    assert set(_HANDLERS) == set(PayloadCommand)


def test_the_diagram_has_every_transition() -> None:
    diagram = section("States of the shutter")
    arrows = re.findall(r"(?=\b(\w+) --([A-Z_]+(?: or [A-Z_]+)*)--> (\w+))", diagram)
    drawn = {
        (source, event, target)
        for source, events, target in arrows
        for event in events.split(" or ")
    }
    assert drawn == {(s.name, e.name, t.name) for (s, e), t in TRANSITIONS.items()}


def test_every_file_stands_there() -> None:
    named = set(re.findall(r"`([\w/]+\.py)`", section("How it is built")))
    there = {path for path in FOLDER.rglob("*.py") if path.name != "__init__.py"}
    named.discard("uav_firmware/lib/payload_rules.py")
    assert named == {str(path.relative_to(FOLDER)) for path in there}
