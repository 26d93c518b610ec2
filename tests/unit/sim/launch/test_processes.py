"""Which programs a system is made of, and their arguments."""

from pathlib import Path

from sim.launch.processes import Program, programs
from sim.launch.settings import from_environment


def started(**given: str) -> dict[str, Program]:
    return {program.name: program for program in programs(from_environment(given))}


def unsigned(program: Program) -> str | None:
    words = program.arguments
    flag = "--unsigned-systems"
    return words[words.index(flag) + 1] if flag in words else None


def test_every_system_of_a_plain_start_signs() -> None:
    assert unsigned(started()["broker"]) is None


def test_the_broker_is_told_who_cannot_sign() -> None:
    assert unsigned(started(TESTERS="2")["broker"]) == "2,3"
    given = {"TESTERS": "1", "UNSIGNED_SYSTEMS": "40"}
    assert unsigned(started(**given)["broker"]) == "40,2"
    assert unsigned(started(UNSIGNED_SYSTEMS="40")["broker"]) == "40"


def test_a_person_is_not_started_and_a_script_is(tmp_path: Path) -> None:
    script = tmp_path / "script"
    script.touch()
    assert set(started(TESTERS="1")) == {"cloud", "edge", "broker", "vehicle-1"}
    scripted = started(VEHICLES="0", TESTERS="1", TESTER_SCRIPT=str(script))
    assert set(scripted) == {"cloud", "edge", "broker", "tester-1"}
    assert str(script) in scripted["tester-1"].arguments
