"""Statuses: each ends once."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.commands import Command, NavHome
from afarcloud.enumerations import CommandType, Status
from afarcloud.state import MissionReport
from mavlink_broker.vehicle.mission_ledger import LedgerError, MissionLedger


def commands(count: int) -> list[Command]:
    return [NavHome(command_id=10 + i, command_type_id=CommandType.NAV_HOME) for i in range(count)]


def ledger(count: int = 3) -> MissionLedger:
    return MissionLedger(1201, commands(count))


def test_a_failure_fails_the_unfinished_command_and_aborts_the_rest() -> None:
    book = ledger()
    book.set_command(0, Status.FINISHED)
    book.set_command(1, Status.RUNNING)
    book.fail("motor lost")
    assert book.commands == (Status.FINISHED, Status.FAILED, Status.ABORTED)
    assert book.status == Status.FAILED
    report = book.report(vehicle_id=1, sequence_number=4)
    assert report.message == "motor lost"
    assert [c.message for c in report.command_report_array] == [None, "motor lost", None]


def test_of_a_failed_mission_the_flown_commands_and_the_failed_one_have_begun() -> None:
    book = ledger(4)
    book.set_command(0, Status.FINISHED)
    assert (book.begun, book.finished) == (1, 1)
    book.fail("motor lost")
    assert (book.begun, book.finished) == (2, 4)


def test_what_is_flown_behind_a_skipped_command_has_begun() -> None:
    book = ledger(5)
    for index, status in enumerate((Status.FINISHED, Status.ABORTED, Status.FINISHED)):
        book.set_command(index, status)
    assert (book.begun, book.finished) == (3, 3)
    book.fail("motor lost")
    assert (book.begun, book.finished) == (4, 5)


def test_a_failure_may_name_its_command() -> None:
    book = ledger()
    book.fail("refused", 2)
    assert book.commands == (Status.ABORTED, Status.ABORTED, Status.FAILED)


def test_an_aborted_command_that_was_paused_says_why_it_ended() -> None:
    """Its last note would otherwise be the pause."""
    book = ledger()
    book.set_command(0, Status.RUNNING)
    book.note_open("paused by an event")
    book.abort("aborted by an event")
    report = book.report(vehicle_id=1, sequence_number=4)
    texts = [command.message for command in report.command_report_array]
    assert texts == ["paused by an event; aborted by an event", None, None]


@given(st.integers(0, 3), st.none() | st.integers(0, 2))
def test_a_failure_leaves_nothing_open_and_changes_nothing_that_ended(
    finished: int, named: int | None
) -> None:
    book = ledger()
    for index in range(finished):
        book.set_command(index, Status.FINISHED)
    book.fail("x", named)
    assert all(status.is_terminal for status in book.commands)
    assert book.commands[:finished] == (Status.FINISHED,) * finished
    assert book.commands.count(Status.FAILED) == (finished < 3)


@pytest.mark.parametrize("ended", [Status.FINISHED, Status.FAILED, Status.ABORTED])
def test_what_has_ended_stays_as_it_is(ended: Status) -> None:
    book = ledger()
    book.set_command(0, ended)
    book.set_mission(ended)
    for other in set(Status) - {ended}:
        with pytest.raises(LedgerError):
            book.set_command(0, other)
        with pytest.raises(LedgerError):
            book.set_mission(other)
    assert book.commands[0] == ended
    assert book.status == ended


def test_the_same_status_again_is_no_change() -> None:
    book = ledger()
    assert book.set_command(0, Status.RUNNING)
    assert not book.set_command(0, Status.RUNNING)


def test_an_earlier_report_is_taken_up() -> None:
    book = ledger()
    earlier = MissionReport.model_validate(
        {
            "sequence_number": 3,
            "vehicle_id": 1,
            "mission_id": 1201,
            "mission_status_id": 2,
            "command_report_array": [
                {"command_id": 10, "command_status_id": 3, "message": "speed limited"},
                {"command_id": 11, "command_status_id": 2},
            ],
        }
    )
    book.restore(earlier)
    assert book.status == Status.RUNNING
    assert book.commands == (Status.FINISHED, Status.RUNNING, Status.NOT_STARTED)
    assert book.finished == 1


def test_long_reasons_are_cut_to_what_the_model_takes() -> None:
    book = ledger()
    book.fail("x" * 5000)
    assert len(book.report(vehicle_id=1, sequence_number=0).message or "") == 1000


def test_a_mission_of_up_to_a_hundred_commands_is_always_reported_as_a_whole() -> None:
    book = ledger(100)
    for number in range(3):
        book.set_command(number, Status.RUNNING)
        report = book.report(vehicle_id=1, sequence_number=number)
        assert len(report.command_report_array) == 100


@pytest.mark.thorough
@given(st.lists(st.integers(0, 3), min_size=1, max_size=40))
def test_a_longer_mission_is_reported_by_its_changes_which_add_up(steps: list[int]) -> None:
    """The newest status of each command in the reports is complete at any time."""
    book = ledger(700)
    known: dict[int, tuple[Status, str | None]] = {}
    place = 0
    for number, step in enumerate(steps):
        for _ in range(step):
            book.set_command(place, Status.FINISHED)
            place += 1
        book.set_command(place, Status.RUNNING)
        report = book.report(vehicle_id=1, sequence_number=number)
        assert len(report.command_report_array) == (700 if number == 0 else step + 1)
        known |= {
            c.command_id: (c.command_status_id, c.message) for c in report.command_report_array
        }
        assert [known[10 + i][0] for i in range(700)] == list(book.commands)
    book.abort("aborted by an event")
    last = book.report(vehicle_id=1, sequence_number=len(steps))
    assert len(last.command_report_array) == 700
