"""The current item: jumps, and every command that selects one."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.toy_vehicle import item, waypoint
from uav_firmware.modules.navigator.mission.cursor import MissionCursor
from uav_firmware.msg.mission import Mission, MissionCommand, MissionItem, MissionState


def jump(to: int, times: float) -> MissionItem:
    return item(0, MissionCommand.DO_JUMP, param1=float(to), param2=times)


def loaded(*items: MissionItem) -> MissionCursor:
    cursor = MissionCursor()
    numbered = tuple(one._replace(seq=seq) for seq, one in enumerate(items))
    cursor.load(Mission(7, 99, numbered))
    return cursor


def loop(times: float = 2.0) -> MissionCursor:
    """Two waypoints flown again and again, and one behind them."""
    return loaded(waypoint(0, 1, 0), waypoint(0, 2, 0), jump(0, times), waypoint(0, 3, 0))


def shown(cursor: MissionCursor) -> tuple[int, MissionState]:
    progress = cursor.progress(0, active=True)
    return progress.seq_current, MissionState(progress.state)


def flown(cursor: MissionCursor, limit: int = 50) -> list[int]:
    """Items shown as current until the mission is complete."""
    seqs: list[int] = []
    while not cursor.complete and len(seqs) < limit:
        seqs.append(shown(cursor)[0])
        cursor.reach()
        cursor.advance()
    return seqs


def test_a_jump_is_never_the_current_item() -> None:
    assert flown(loop()) == [0, 1, 0, 1, 0, 1, 3]


@pytest.mark.parametrize(("times", "rounds"), [(0.0, 1), (1.0, 2), (4.0, 5)])
def test_a_jump_is_taken_as_often_as_its_parameter(times: float, rounds: int) -> None:
    assert flown(loop(times)) == [0, 1] * rounds + [3]


def test_jumps_that_lead_only_to_jumps_end_the_mission() -> None:
    cursor = loaded(waypoint(0, 1, 0), jump(2, -1.0), jump(1, -1.0))
    assert flown(cursor) == [0]
    cursor.select(1, reset=False)
    assert cursor.item is None


@pytest.mark.parametrize("reset", [False, True])
def test_the_item_chosen_is_current_in_flight_and_after_the_end(reset: bool) -> None:
    cursor = loop()
    cursor.select(1, reset=reset)
    assert shown(cursor) == (1, MissionState.ACTIVE)
    flown(cursor)
    assert shown(cursor)[1] is MissionState.COMPLETE
    cursor.select(3, reset=reset)
    assert shown(cursor) == (3, MissionState.ACTIVE)


@pytest.mark.parametrize("reset", [False, True])
def test_a_jump_that_is_chosen_leads_to_its_target(reset: bool) -> None:
    cursor = loop()
    flown(cursor)  # its repetitions are used up
    cursor.select(2, reset=reset)
    assert shown(cursor) == (0, MissionState.ACTIVE)


def test_minus_one_keeps_the_item_and_everything_else() -> None:
    cursor = loop()
    cursor.advance()
    before = cursor.progress(0, active=True)
    cursor.select(-1, reset=False)
    after = cursor.progress(0, active=True)
    assert after == before._replace(selection_count=before.selection_count + 1)
    flown(cursor)
    cursor.select(-1, reset=False)
    assert shown(cursor)[1] is MissionState.COMPLETE


def test_minus_one_with_reset_keeps_the_item_and_leaves_completion() -> None:
    cursor = loop()
    flown(cursor)
    last = shown(cursor)[0]
    cursor.select(-1, reset=True)
    assert shown(cursor) == (last, MissionState.ACTIVE)


def test_only_a_reset_gives_jumps_their_repetitions_back() -> None:
    cursor = loop(1.0)
    flown(cursor)
    cursor.select(0, reset=False)
    assert flown(cursor) == [0, 1, 3]
    cursor.select(0, reset=True)
    assert flown(cursor) == [0, 1, 0, 1, 3]


def test_every_selection_and_every_reached_item_is_counted() -> None:
    cursor = loop()
    cursor.select(0, reset=False)
    cursor.select(0, reset=False)
    flown(cursor)
    progress = cursor.progress(0, active=True)
    assert progress.selection_count == 2
    assert progress.reached_count == 7
    assert progress.latest_reached == (0, 1, 0, 1, 0, 1, 3)


def test_another_mission_begins_at_its_first_item_even_if_it_is_equal() -> None:
    cursor = loop()
    flown(cursor)
    again = Mission(8, 99, cursor.items)
    assert not cursor.progress(0, active=True).is_of(again)
    cursor.load(again)
    assert cursor.progress(0, active=True).is_of(again)
    assert shown(cursor) == (0, MissionState.ACTIVE)
    assert flown(cursor) == [0, 1, 0, 1, 0, 1, 3]


plans = st.lists(
    st.one_of(
        st.just(waypoint(0, 1, 0)),
        st.builds(jump, st.integers(0, 5), st.sampled_from([-1.0, 0.0, 1.0, 3.0])),
    ),
    min_size=6,
    max_size=6,
)


@given(plans, st.lists(st.tuples(st.integers(-1, 5), st.booleans()), max_size=6))
def test_whatever_is_chosen_the_current_item_can_be_flown(
    items: list[MissionItem], choices: list[tuple[int, bool]]
) -> None:
    cursor = loaded(*items)
    for seq, reset in choices:
        cursor.select(seq, reset=reset)
        assert cursor.item is None or cursor.item.command == MissionCommand.NAV_WAYPOINT
        cursor.advance()
        assert cursor.item is None or cursor.item.command == MissionCommand.NAV_WAYPOINT
