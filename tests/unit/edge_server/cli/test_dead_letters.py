"""Dead letters on the terminal."""

import json
from pathlib import Path

import pytest

from edge_server.__main__ import main
from edge_server.process.exit_codes import FAILED, OK, WRONG_SETUP
from tests.unit.edge_server.api.routes.reports.test_dead_letters import REASON, due, rejected
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import telemetry


def run(edge: Edge, *words: str) -> int:
    return main(["--state-dir", str(edge.config.state_dir), "dead-letters", *words])


def test_dead_letters_are_listed_with_the_reason(
    edge: Edge, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = rejected(edge), rejected(edge, "battery", 2)
    assert run(edge, "list") == OK
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [str(first["id"]), str(second["id"])]
    assert all(REASON in line for line in lines)
    assert "battery" in lines[1]


def test_dead_letters_are_retried_or_discarded(edge: Edge) -> None:
    first, second = rejected(edge), rejected(edge)
    assert run(edge, "retry", str(first["id"])) == OK
    assert run(edge, "discard", str(second["id"])) == OK
    assert due(edge) == [first["id"]]
    assert edge.get("/dead_letters/") == []


def test_a_missing_one_is_reported_and_the_rest_goes_on(
    edge: Edge, capsys: pytest.CaptureFixture[str]
) -> None:
    letter = rejected(edge)
    assert run(edge, "retry", "999", str(letter["id"])) == FAILED
    assert "no dead letter 999" in capsys.readouterr().err
    assert due(edge) == [letter["id"]]


def test_without_a_database_it_fails_with_a_message(
    tmp_path: object, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--state-dir", str(tmp_path), "dead-letters", "list"]) == WRONG_SETUP
    assert "no database" in capsys.readouterr().err


def test_all_are_retried(edge: Edge, capsys: pytest.CaptureFixture[str]) -> None:
    letters = [rejected(edge)["id"] for _ in range(3)]
    assert run(edge, "retry-all") == OK
    assert "3 done" in capsys.readouterr().out
    assert due(edge) == letters


def test_the_export_is_complete(edge: Edge, capsys: pytest.CaptureFixture[str]) -> None:
    picture = rejected(edge, "image")
    assert run(edge, "export") == OK
    (line,) = capsys.readouterr().out.splitlines()
    assert json.loads(line)["report"]["message_id"] == picture["message_id"]
    assert "frame" in json.loads(line)["report"]


def test_a_dead_letter_is_corrected_from_a_file(edge: Edge, tmp_path: Path) -> None:
    letter = rejected(edge)
    file = tmp_path / "pose.json"
    file.write_text(json.dumps({"pose": telemetry("pose") | {"yaw": 12.5}}), encoding="utf-8")
    assert run(edge, "edit", str(letter["id"]), str(file)) == OK
    assert due(edge) == [letter["id"]]
    assert edge.get(f"/pose/{letter['id']}")["yaw"] == 12.5


@pytest.mark.first_case
@pytest.mark.parametrize("content", ["{", "[]", '{"battery": {}}', '{"pose": {"vehicle_id": 1}}'])
def test_a_correction_that_cannot_be_used_is_named(
    edge: Edge, tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str
) -> None:
    letter = rejected(edge)
    file = tmp_path / "pose.json"
    file.write_text(content, encoding="utf-8")
    assert run(edge, "edit", str(letter["id"]), str(file)) == FAILED
    assert "pose.json" in capsys.readouterr().err
    assert due(edge) == []
