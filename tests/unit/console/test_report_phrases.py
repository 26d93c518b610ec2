"""The console translates reports by their English words: these have to be what programs report."""

import ast
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PHRASES = ROOT / "console" / "src" / "i18n" / "reports.es.json"
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


def test_a_phrase_that_no_program_reports_is_found(reported: str) -> None:
    wrong = {"interrupted by an event", "picture {number} cannot be obtained: {reason}"}
    assert unreported({*wrong, "aborted by an event"}, reported) == wrong
