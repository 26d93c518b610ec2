"""The console translates reports by their English words: these have to be what programs report."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PHRASES = ROOT / "console" / "src" / "i18n" / "reports.es.json"
PROGRAMS = ("afarcloud", "edge_server", "mavlink_broker")
SHORTEST = 4
"""Shorter pieces between two values prove nothing."""
GAP = "\0"


def texts_of(path: Path) -> Iterator[str]:
    """Give the texts of a module; a value within one becomes a gap."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            yield "".join(
                str(part.value) if isinstance(part, ast.Constant) else GAP for part in node.values
            )


@pytest.fixture(scope="module")
def reported() -> str:
    """All texts of the programs, one a line."""
    modules = (path for name in PROGRAMS for path in sorted((ROOT / name).rglob("*.py")))
    return "\n".join(text for path in modules for text in texts_of(path))


def test_each_phrase_is_made_of_what_a_program_reports(reported: str) -> None:
    phrases = json.loads(PHRASES.read_text())
    assert phrases
    missing = {
        (phrase, piece)
        for phrase in phrases
        for piece in re.split(r"\{\w+\}", phrase)
        for part in re.split(r": |, |; ", piece)
        if len(part.strip()) >= SHORTEST and part.strip() not in reported
    }
    assert not missing


def test_a_phrase_that_no_program_reports_is_found(reported: str) -> None:
    assert "aborted by an event" in reported
    assert "interrupted by an event" not in reported
