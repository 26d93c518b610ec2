"""The tables of the module's README are those of the code."""

import re
from pathlib import Path

import pytest

import uav_firmware.modules.mavlink as package
from uav_firmware.modules.mavlink.commands.commands import ANSWERED_HERE, FOR_PAYLOAD, FORWARDED
from uav_firmware.modules.mavlink.commands.modes import MODES, OFFERED
from uav_firmware.modules.mavlink.telemetry.streams import CAMERA_STREAMS, STREAMS
from uav_firmware.modules.mavlink.wire.dialect import mavlink

FOLDER = Path(str(package.__file__)).parent
TEXT = (FOLDER / "README.md").read_text()


def section(title: str) -> str:
    return TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]


def rows(title: str) -> list[list[str]]:
    """Cells of a section's table rows, without the header."""
    lines = [line for line in section(title).splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_the_table_of_streams() -> None:
    told = {name: (float(ground), float(onboard)) for name, ground, onboard, _ in rows("Streams")}
    assert told == {
        mavlink.mavlink_map[stream.message_id].msgname: (
            stream.ground_station_hz,
            stream.onboard_hz,
        )
        for stream in STREAMS
    }


def test_the_table_of_the_cameras_messages() -> None:
    told = {name: float(rate) for name, rate, _ in rows("The camera component")}
    assert told == {
        mavlink.mavlink_map[stream.message_id].msgname: stream.onboard_hz
        for stream in CAMERA_STREAMS
    }


def test_the_table_of_commands_names_every_command() -> None:
    told = {int(n) for row in rows("Commands") for n in re.findall(r"\b\d{2,4}\b", row[0])}
    assert told == FORWARDED | FOR_PAYLOAD | ANSWERED_HERE.keys()


def test_the_table_of_modes_tells_which_are_listed() -> None:
    told = {(name, place) for name, place, listed in rows("Modes") if listed == "yes"}
    assert told == {
        (MODES[state].name, f"{MODES[state].main}, {MODES[state].sub}") for state in OFFERED
    }


@pytest.mark.parametrize(
    ("title", "file"),
    [("Missions", "missions/mission_upload.py"), ("Commands", "commands/command_server.py")],
)
def test_a_diagram_is_that_of_its_file(title: str, file: str) -> None:
    diagram = [line for line in section(title).splitlines() if re.match(r" {4}\w.*-->", line)]
    code = (FOLDER / file).read_text()
    assert len(diagram) >= 6
    assert all(line in code for line in diagram)


def test_every_file_and_package_of_the_module_is_in_the_table() -> None:
    named = set(re.findall(r"`(\w+(?:\.py|/))`", section("How it is built")))
    files = {path.name for path in FOLDER.glob("*.py")} - {"__init__.py"}
    assert named == files | {f"{path.parent.name}/" for path in FOLDER.glob("*/__init__.py")}
