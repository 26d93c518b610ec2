"""Dead letters at the shell."""

import pytest

from edge_server.__main__ import main
from edge_server.exit_codes import FAILED, OK, WRONG_SETUP
from tests.unit.edge_server.api.test_dead_letters import REASON, due, rejected
from tests.unit.edge_server.conftest import Edge


def run(edge: Edge, *words: str) -> int:
    return main(["--state-dir", str(edge.config.state_dir), "dead-letters", *words])


def test_they_are_listed_with_their_reason(edge: Edge, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = rejected(edge), rejected(edge, "battery", 2)
    assert run(edge, "list") == OK
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [str(first["id"]), str(second["id"])]
    assert all(REASON in line for line in lines)
    assert "battery" in lines[1]


def test_they_are_sent_once_more_or_given_up(edge: Edge) -> None:
    first, second = rejected(edge), rejected(edge)
    assert run(edge, "retry", str(first["id"])) == OK
    assert run(edge, "discard", str(second["id"])) == OK
    assert due(edge) == [first["id"]]
    assert edge.get("/dead_letters/") == []


def test_a_missing_one_is_told_and_the_rest_goes_on(
    edge: Edge, capsys: pytest.CaptureFixture[str]
) -> None:
    letter = rejected(edge)
    assert run(edge, "retry", "999", str(letter["id"])) == FAILED
    assert "no dead letter 999" in capsys.readouterr().err
    assert due(edge) == [letter["id"]]


def test_without_a_database_it_says_so(
    tmp_path: object, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--state-dir", str(tmp_path), "dead-letters", "list"]) == WRONG_SETUP
    assert "no database" in capsys.readouterr().err
