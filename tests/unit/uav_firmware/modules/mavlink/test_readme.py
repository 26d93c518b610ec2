"""The tables of the module's README and pages are those of the code."""

import re
from pathlib import Path

import pytest

import uav_firmware.modules.mavlink as package
from tests.support import pages
from uav_firmware.modules.mavlink.commands.commands import FOR_PAYLOAD, FORWARDED, HANDLED_HERE
from uav_firmware.modules.mavlink.commands.modes import MODES, OFFERED
from uav_firmware.modules.mavlink.telemetry.streams import CAMERA_STREAMS, STREAMS
from uav_firmware.modules.mavlink.wire.dialect import mavlink

FOLDER = Path(str(package.__file__)).parent
TEXT = (FOLDER / "README.md").read_text()


PAGES = {
    "Streams": "reference/mavlink-messages.md",
    "The camera component": "reference/mavlink-messages.md",
    "The command protocol": "reference/mavlink-commands.md",
    "Missions": "reference/mavlink-missions.md",
    "Modes on MAVLink": "reference/flight-modes.md",
}


def section(title: str) -> str:
    if title in PAGES:
        return pages.section(PAGES[title], title)
    return TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]


def rows(title: str) -> list[list[str]]:
    """Cells of a section's table rows, without the header."""
    lines = [line for line in section(title).splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_the_table_of_streams() -> None:
    reported = {
        name: (float(ground), float(onboard)) for name, ground, onboard, _ in rows("Streams")
    }
    assert reported == {
        mavlink.mavlink_map[stream.message_id].msgname: (
            stream.ground_station_hz,
            stream.onboard_hz,
        )
        for stream in STREAMS
    }


def test_the_table_of_the_cameras_messages() -> None:
    reported = {name: float(rate) for name, rate, _ in rows("The camera component")}
    assert reported == {
        mavlink.mavlink_map[stream.message_id].msgname: stream.onboard_hz
        for stream in CAMERA_STREAMS
    }


def test_the_table_of_commands_names_every_command() -> None:
    reported = {
        int(n) for row in rows("The command protocol") for n in re.findall(r"\b\d{2,4}\b", row[0])
    }
    assert reported == FORWARDED | FOR_PAYLOAD | HANDLED_HERE.keys()


def test_the_table_of_modes_marks_the_listed_ones() -> None:
    reported = {
        (name, place) for name, place, listed in rows("Modes on MAVLink") if listed == "yes"
    }
    assert reported == {
        (MODES[state].name, f"{MODES[state].main}, {MODES[state].sub}") for state in OFFERED
    }


@pytest.mark.parametrize(
    ("title", "file"),
    [
        ("Missions", "missions/mission_upload.py"),
        ("The command protocol", "commands/command_server.py"),
    ],
)
def test_a_diagram_is_that_of_its_file(title: str, file: str) -> None:
    diagram = [line for line in section(title).splitlines() if re.match(r" {4}\w.*-->", line)]
    code = (FOLDER / file).read_text()
    assert len(diagram) >= 6
    assert all(line in code for line in diagram)


def test_the_readme_lists_every_file_and_package() -> None:
    named = set(re.findall(r"`(\w+(?:\.py|/))`", section("How it is built")))
    files = {path.name for path in FOLDER.glob("*.py")} - {"__init__.py"}
    assert named == files | {f"{path.parent.name}/" for path in FOLDER.glob("*/__init__.py")}
