"""The reference pages name the settings and faults that the code declares, and no others."""

import importlib.util
import json
import os
import re
import subprocess
import sys

import pytest

from afarcloud import wire
from afarcloud.enumerations import EventType
from afarcloud.plan import Event
from sim.fault_schedule import FIELDS
from tests.support import pages

NUMBER = re.compile(r"`([a-z_0-9]+)` \(([^)]+)\)")


def help_of(*command: str) -> str:
    run = subprocess.run(
        [sys.executable, "-m", *command, "--help"],
        check=True,
        capture_output=True,
        text=True,
        env={**os.environ, "COLUMNS": "1000"},
        timeout=60,
    )
    return run.stdout


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("program", "page", "variable"),
    [
        ("edge_server", "reference/edge-server-settings.md", r"\(([A-Z][A-Z0-9_]+)\)$"),
        ("mavlink_broker", "reference/broker-settings.md", r"\(environment: ([A-Z0-9_]+)\)$"),
    ],
)
def test_the_page_lists_every_setting(program: str, page: str, variable: str) -> None:
    command = [program, "run"] if program == "mavlink_broker" else [program]
    taken = set(re.findall(variable, help_of(*command), re.MULTILINE))
    rows = re.findall(r"^\| (`[A-Z0-9_`, ]+`) \|", pages.text(page), re.MULTILINE)
    assert {name for row in rows for name in re.findall(r"`([A-Z0-9_]+)`", row)} == taken
    assert len(taken) > 20


def test_the_page_of_faults_lists_every_kind_with_its_numbers() -> None:
    listed = {}
    for kinds, numbers, _ in pages.rows(pages.section("reference/faults.md", "Kinds")):
        for kind in re.findall(r"`(\w+)`", kinds):
            listed[kind] = dict(NUMBER.findall(numbers))
    declared = {
        kind.value: {
            name: "required" if field.default is None else f"{field.default:g}"
            for name, field in fields.items()
        }
        for kind, fields in FIELDS.items()
    }
    assert listed == declared


COMMAND = re.compile(r"python -m ([\w.]+)([^`\n|#]*)")


def documented_commands() -> list[tuple[str, str]]:
    """Module and arguments of every command line that a document shows."""
    documents = [*pages.DOCS.rglob("*.md"), *pages.ROOT.glob("*/README.md")]
    return sorted({found for path in documents for found in COMMAND.findall(path.read_text())})


@pytest.mark.parametrize(("module", "arguments"), documented_commands())
def test_a_documented_command_exists_with_its_flags(module: str, arguments: str) -> None:
    assert importlib.util.find_spec(module) is not None
    sections = pages.text("reference/command-lines.md").split("\n## ")
    of_program = [text for text in sections if text.split("\n")[0].split(" ")[0] == module]
    if of_program:
        known = set(re.findall(r"^\| `(--[\w-]+)", "\n".join(of_program), re.MULTILINE))
        assert set(re.findall(r"--[a-z][\w-]*", arguments)) <= known | {"--help"}


def test_the_events_of_the_guide_are_events() -> None:
    bodies = re.findall(
        r"-d '(\{[^']*event_type_id[^']*\})'", pages.text("how-to/abort-and-release.md")
    )
    events = [wire.read_as(Event, json.loads(body)) for body in bodies]
    assert {event.event_type_id for event in events} == set(EventType)
