"""A file in the person's stead."""

import pytest

from sim.tester.terminal.screens import Place
from sim.tester.terminal.script import Script, ScriptError


def test_lines_come_one_by_one_and_comments_do_not() -> None:
    script = Script(["# first", "1", "", "x"])
    assert [script.next_line(Place.MAIN, 0.0) for _ in range(3)] == ["1", "", "x"]
    assert script.is_over
    assert script.next_line(Place.MAIN, 0.0) is None


def test_a_wait_is_waited() -> None:
    script = Script(["1", "@wait 2", "@wait 0.5", "2"])
    assert script.next_line(Place.MAIN, 10.0) == "1"
    assert script.next_line(Place.MAIN, 10.0) is None
    assert script.next_line(Place.MAIN, 12.4) is None
    assert script.next_line(Place.MAIN, 12.5) == "2"


def test_behind_auto_commands_are_finished_and_an_interrupted_mission_lands() -> None:
    script = Script(["@auto 0.5"])
    assert script.next_line(Place.MAIN, 0.0) is None
    assert script.next_line(Place.MAIN, 0.5) == "1"
    assert script.next_line(Place.MAIN, 0.5) is None
    assert script.next_line(Place.MAIN, 1.0) == "1"
    assert script.next_line(Place.LANDING, 1.1) is None
    assert script.next_line(Place.LANDING, 1.6) == "0"
    assert not script.is_over


@pytest.mark.parametrize("line", ["@", "@wait", "@wait soon", "@auto -1", "@auto nan", "@loop 1"])
def test_a_line_that_cannot_be_read_is_named(line: str) -> None:
    with pytest.raises(ScriptError, match="line 2"):
        Script(["1", line])
