"""The console translates reports and faults by their English words: those that programs write."""

import ast
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
TEXTS = ROOT / "console" / "src" / "i18n"
PHRASES = TEXTS / "reports.es.json"
FAULTS = TEXTS / "faults.es.json"
RULES = (
    *(ROOT / "afarcloud" / f"{name}.py" for name in ("area", "fence_check", "flyable", "rules")),
    ROOT / "afarcloud" / "geometry.py",
    *(
        ROOT / "edge_server" / "survey" / f"{name}.py"
        for name in ("part", "planner", "request", "sorties")
    ),
    *sorted((ROOT / "edge_server" / "exchange").glob("*.py")),
    *(
        ROOT / "edge_server" / "geodata" / f"{name}.py"
        for name in ("field", "geojson", "kml", "projection", "rings", "shapefile", "utm", "zipped")
    ),
)
"""What judges the plans, fields, surveys and files of a person."""
REPORTING = (
    *(
        path
        for folder in ("live", "mission", "pictures", "planning")
        for path in sorted((ROOT / "mavlink_broker" / folder).rglob("*.py"))
    ),
    *(
        ROOT / "mavlink_broker" / "microservices" / f"{name}.py"
        for name in ("command", "ftp_download", "ftp_requests", "parameter")
    ),
    *sorted((ROOT / "mavlink_broker" / "microservices").glob("mission_*.py")),
    *(
        ROOT / "mavlink_broker" / "vehicle" / f"{name}.py"
        for name in ("alarms", "flight_logs", "lost_mission")
    ),
)
"""Modules of the broker whose sentences reach the console in missions, commands and events."""
REFUSING = (
    ROOT / "edge_server" / "api" / "freshness.py",
    *(
        ROOT / "edge_server" / "services" / f"{name}.py"
        for name in (
            "administration/backups",
            "administration/passwords",
            "flight_archive",
            "flight_maps",
        )
    ),
)
"""What refuses requests of the console by a sentence."""
UNREPORTED = {"this program sends no logs"}
"""Of a mistake in the program."""
LOGGED = {"debug", "info", "warning", "error", "exception"}
OF_PYDANTIC = ("String should have at ", "must be a valid ", "must be greater than", "must be less")
PROGRAMS = ("afarcloud", "edge_server", "mavlink_broker")
SHORTEST = 4
"""Shorter pieces between two values prove nothing."""
GAP = "\0"


def texts_of(path: Path) -> Iterator[str]:
    """Give the texts of a module but its docstrings; a value within one becomes a gap."""
    tree = ast.parse(path.read_text())
    statements = (node.value for node in ast.walk(tree) if isinstance(node, ast.Expr))
    docstrings = {id(value) for value in statements}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) not in docstrings:
                yield node.value
        elif isinstance(node, ast.JoinedStr):
            yield "".join(
                str(part.value) if isinstance(part, ast.Constant) else GAP for part in node.values
            )


def unreported(phrases: Iterable[str], reported: str) -> set[str]:
    """Give the phrases of which a piece is in no text of a program."""
    return {
        phrase
        for phrase in phrases
        for piece in re.split(r"\{\w+\}|: |, |; ", phrase)
        if len(piece.strip()) >= SHORTEST and piece.strip() not in reported
    }


@pytest.fixture(scope="module")
def reported() -> str:
    """All texts of the programs, one a line."""
    modules = (path for name in PROGRAMS for path in sorted((ROOT / name).rglob("*.py")))
    return "\n".join(text for path in modules for text in texts_of(path))


def test_each_phrase_is_made_of_what_a_program_reports(reported: str) -> None:
    phrases = json.loads(PHRASES.read_text())
    assert len(phrases) > 100
    assert not unreported(phrases, reported)


def test_each_phrase_of_a_fault_is_made_of_what_a_program_finds(reported: str) -> None:
    faults = json.loads(FAULTS.read_text())
    assert not unreported((one for one in faults if not one.startswith(OF_PYDANTIC)), reported)


def sentences_of(path: Path) -> Iterator[str]:
    """Give the texts of a module that are sentences, values as a number; no log messages."""
    tree = ast.parse(path.read_text())
    joined = (node.values for node in ast.walk(tree) if isinstance(node, ast.JoinedStr))
    pieces = {part.value for parts in joined for part in parts if isinstance(part, ast.Constant)}
    logged = {
        argument.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in LOGGED
        for argument in node.args
        if isinstance(argument, ast.Constant)
    }
    pieces |= logged
    for text in texts_of(path):
        shown = text.replace(GAP, "7").strip()
        if text not in pieces and re.search(r"[a-z]{2,} [a-z(]", shown):
            yield shown


@pytest.mark.parametrize("module", RULES, ids=lambda path: path.name)
def test_each_fault_of_a_plan_a_field_and_a_survey_has_a_phrase(module: Path) -> None:
    """A person who has never written JSON reads them."""
    without = without_phrase(module, json.loads(FAULTS.read_text()))
    assert not without


@pytest.mark.parametrize("module", REPORTING, ids=lambda path: f"{path.parent.name}.{path.stem}")
def test_each_report_of_the_broker_has_a_phrase(module: Path) -> None:
    """English and Spanish are complete."""
    reports = json.loads(PHRASES.read_text()) | json.loads(FAULTS.read_text())
    assert not without_phrase(module, reports) - UNREPORTED


@pytest.mark.parametrize("module", REFUSING, ids=lambda path: path.name)
def test_each_refusal_has_a_phrase(module: Path) -> None:
    reports = json.loads(PHRASES.read_text()) | json.loads(FAULTS.read_text())
    assert not without_phrase(module, reports)


def without_phrase(module: Path, phrases: dict[str, str]) -> set[str]:
    """Give the sentences of a module that no phrase translates."""
    pieces = (re.split(r"\{\w+\}", phrase) for phrase in phrases)
    patterns = [re.compile(".+?".join(map(re.escape, one))) for one in pieces]
    examples = [re.sub(r"\{\w+\}", "7", phrase) for phrase in phrases]
    return {
        part
        for text in sentences_of(module)
        for part in text.split("; ")
        if not any(pattern.fullmatch(part) for pattern in patterns)
        and not any(part in example for example in examples)
    }


def test_a_phrase_that_no_program_reports_is_found(reported: str) -> None:
    wrong = {"interrupted by an event", "picture {number} cannot be obtained: {reason}"}
    assert unreported({*wrong, "aborted by an event"}, reported) == wrong
