"""README and page agree with the module."""

import re
from pathlib import Path

import uav_firmware.modules.payload as package
from tests.support import pages
from uav_firmware.lib.mission_rules import PAYLOAD
from uav_firmware.modules.payload.camera.states import TRANSITIONS
from uav_firmware.modules.payload.orders import _HANDLERS
from uav_firmware.msg.payload import PayloadCommand

FOLDER = Path(str(package.__file__)).parent
TEXT = (FOLDER / "README.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    if title != "How it is built":
        return pages.section("reference/camera-and-gimbal.md", title)
    return TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]


def test_the_readme_lists_every_command_and_each_has_a_handler() -> None:
    reported = re.findall(r"^\| ([A-Z_]+) (\d+)( M)? \|", section("Commands"), re.MULTILINE)
    assert {(name, int(number)) for name, number, _ in reported} == {
        (command.name, command.value) for command in PayloadCommand
    }
    assert {int(number) for _, number, item in reported if item} == {int(c) for c in PAYLOAD}
    assert set(_HANDLERS) == set(PayloadCommand)


def test_the_readme_draws_every_camera_transition() -> None:
    diagram = section("States of the shutter")
    arrows = re.findall(r"(?=\b(\w+) --([A-Z_]+(?: or [A-Z_]+)*)--> (\w+))", diagram)
    drawn = {
        (source, event, target)
        for source, events, target in arrows
        for event in events.split(" or ")
    }
    assert drawn == {(s.name, e.name, t.name) for (s, e), t in TRANSITIONS.items()}


def test_the_readme_lists_every_payload_file() -> None:
    named = set(re.findall(r"`([\w/]+\.py)`", section("How it is built")))
    there = {path for path in FOLDER.rglob("*.py") if path.name != "__init__.py"}
    named.discard("uav_firmware/lib/payload_rules.py")
    assert named == {str(path.relative_to(FOLDER)) for path in there}
