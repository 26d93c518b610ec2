"""Statuses only grow, and every mission and command ends once."""

from hypothesis import given
from hypothesis import strategies as st

from afarcloud.enumerations import Status
from afarcloud.state import CommandReport
from edge_server.services.fleet.progress import abort_the_rest, advance_commands, advances
from edge_server.services.planning.plan_view import overall
from edge_server.store.rows.work import CommandProgress

STATUSES = st.sampled_from(Status)
REPORTS = st.lists(
    st.builds(
        CommandReport,
        command_id=st.integers(1, 4),
        command_status_id=STATUSES,
        message=st.sampled_from([None, "why", "because"]),
    ),
    max_size=12,
)


def fresh() -> dict[int, CommandProgress]:
    return {number: CommandProgress(number, 1, None) for number in (1, 2, 3)}


@given(current=STATUSES, reported=STATUSES)
def test_a_status_only_grows_and_an_end_is_for_good(current: Status, reported: Status) -> None:
    if advances(current, reported):
        assert reported > current
        assert not current.is_terminal


@given(reports=REPORTS)
def test_whatever_is_reported_no_command_goes_back(reports: list[CommandReport]) -> None:
    state = fresh()
    for report in reports:
        before = dict(state)
        state |= advance_commands(state, [report])
        assert state.keys() == before.keys()
        for number, old in before.items():
            assert state[number].status_id >= old.status_id
            if Status(old.status_id).is_terminal:
                assert state[number].status_id == old.status_id


@given(reports=REPORTS)
def test_a_repeated_report_changes_nothing(reports: list[CommandReport]) -> None:
    state = fresh()
    for report in reports:
        state |= advance_commands(state, [report])
        assert advance_commands(state, [report]).keys() <= {report.command_id}
        again = state | advance_commands(state, [report])
        assert {n: p.status_id for n, p in again.items()} == {
            n: p.status_id for n, p in state.items()
        }


@given(reports=REPORTS)
def test_after_the_end_every_command_has_ended(reports: list[CommandReport]) -> None:
    state = fresh()
    for report in reports:
        state |= advance_commands(state, [report])
    ended = state | abort_the_rest(state, "over")
    for number, progress in ended.items():
        assert Status(progress.status_id).is_terminal
        if Status(state[number].status_id).is_terminal:
            assert progress == state[number]
        else:
            assert progress.status_id == Status.ABORTED


@given(statuses=st.lists(STATUSES, min_size=1, max_size=5))
def test_a_plan_ends_when_its_last_mission_ends(statuses: list[Status]) -> None:
    whole = overall(statuses)
    assert whole.is_terminal == all(status.is_terminal for status in statuses)
    assert (whole is Status.FINISHED) == (set(statuses) == {Status.FINISHED})
    assert (whole is Status.NOT_STARTED) == (set(statuses) == {Status.NOT_STARTED})
    if whole.is_terminal:
        assert whole in statuses
