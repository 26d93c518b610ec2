"""Whose picture it is: by its time, and by what a command still lacks."""

import dataclasses
import math

from mavlink_broker.pictures.attribution import MAX_INTERVALS, Area, Attribution, PictureCommand
from tests.unit.mavlink_broker.pictures.attributed import FIRST, SECOND, commands_of, taker


def flown(*takers: PictureCommand | None) -> Attribution:
    """Commands of ten seconds each, from 100 s on."""
    attribution = Attribution()
    for number, one in enumerate(takers):
        attribution.update(one, 100.0 + 10.0 * number)
    return attribution


def test_a_picture_belongs_to_the_command_that_was_running() -> None:
    attribution = flown(taker(0), taker(1), None)
    assert commands_of(attribution, 99.0, 100.0, 109.9, 110.0, 119.9, 120.1) == [
        None,
        0,
        0,
        1,
        1,
        None,
    ]


def test_an_incomplete_command_gets_pictures_from_shortly_before_its_interval() -> None:
    attribution = flown(taker(0), taker(1, expected=2), taker(2))
    assert commands_of(attribution, 108.0, 108.5) == [1, 1]


def test_what_was_taken_before_the_vehicle_showed_its_progress_is_of_what_ran_meanwhile() -> None:
    """An earlier run knew the first command; the link was lost until the second had ended."""
    attribution = Attribution()
    for time_s in (100.0, 140.0):
        attribution.update(taker(0), time_s, seen_s=-math.inf, resumed_since_s=90.0)
    attribution.update(taker(1, expected=2), 141.0, seen_s=141.0)
    attribution.update(None, 141.0)
    assert commands_of(attribution, 105.0, 120.0, 121.0) == [1, 1, 0]


def test_commands_that_were_flown_unseen_share_their_pictures_in_order() -> None:
    """The first one was seen last at 104 s; the vehicle has restarted by 140 s."""
    attribution = flown(taker(0, expected=2))
    attribution.update(taker(0, expected=2), 104.0)
    attribution.attribute(103.0, FIRST)
    attribution.add_unseen([taker(1, expected=2), taker(3, expected=1)], 140.0)
    assert attribution.current == taker(0, expected=2)
    attribution.update(None, 2000.0)
    assert commands_of(attribution, 106.0, 110.0, 112.0, 139.0) == [0, 1, 1, 3]
    assert commands_of(attribution, 2001.0) == [None]
    assert all(interval.command == taker(0, expected=2) for interval in attribution.incomplete())


def test_what_was_flown_while_no_broker_ran_may_be_of_any_later_command() -> None:
    """An earlier run has seen the first one begin at 104 s; this one is connected at 200 s."""
    attribution = Attribution()
    for time_s in (200.0, 203.0):
        attribution.update(taker(0, expected=2), time_s, resumed_since_s=104.0)
    attribution.add_unseen([taker(1, expected=2), taker(3, expected=1)], 210.0)
    attribution.update(None, 210.0)
    assert commands_of(attribution, 105.0, 106.0, 110.0, 112.0, 139.0) == [0, 0, 1, 1, 3]


def test_nothing_is_flown_unseen_before_the_first_command() -> None:
    attribution = Attribution()
    attribution.add_unseen([taker(1, expected=1)], 140.0)
    assert commands_of(attribution, 120.0) == [None]


def test_a_complete_command_gets_no_late_picture() -> None:
    attribution = flown(taker(0), taker(1, expected=1), taker(2))
    assert commands_of(attribution, 112.0, 108.0, 122.0) == [1, 0, 2]


def test_an_incomplete_command_gets_a_late_picture() -> None:
    attribution = flown(taker(0), taker(1, expected=3), taker(2))
    assert commands_of(attribution, 112.0, 121.0, 129.0, 129.5) == [1, 1, 1, 2]


def test_two_bursts_in_a_row_share_their_pictures_in_order() -> None:
    attribution = flown(taker(0, expected=2), taker(1, expected=2), None)
    assert commands_of(attribution, 108.0, 109.8, 110.5, 119.0) == [0, 0, 1, 1]


def test_an_ended_command_without_all_pictures_is_incomplete() -> None:
    attribution = flown(taker(0, expected=2), taker(1))
    (span,) = attribution.incomplete()
    assert span.missing == 2
    attribution.attribute(105.0, FIRST)
    attribution.attribute(106.0, FIRST)
    assert list(attribution.incomplete()) == []


def test_a_command_whose_beginning_was_not_observed_is_never_incomplete() -> None:
    attribution = Attribution()
    attribution.update(None, 90.0)
    attribution.update(taker(3, expected=4), 100.0, resumed_since_s=100.0)
    attribution.update(taker(4, expected=1), 110.0, resumed_since_s=100.0)
    attribution.update(None, 120.0)
    assert [span.command for span in attribution.incomplete()] == [taker(4, expected=1)]


def test_pictures_of_a_second_camera_do_not_stand_for_those_of_the_first() -> None:
    """Each takes two: those that are late belong to the command too, and none is counted twice."""
    attribution = flown(taker(0, expected=2), taker(1))
    assert commands_of(attribution, 105.0, camera=FIRST) == [0]
    assert commands_of(attribution, 105.0, camera=SECOND) == [0]
    (span,) = attribution.incomplete()
    assert span.missing == 1
    assert commands_of(attribution, 111.0, 112.0, camera=SECOND) == [0, 1]
    assert commands_of(attribution, 111.0, 112.0, camera=FIRST) == [0, 1]
    assert list(attribution.incomplete()) == []


def test_a_camera_that_takes_no_part_is_not_waited_for() -> None:
    attribution = flown(taker(0, expected=1), taker(1))
    assert commands_of(attribution, 105.0, camera=SECOND) == [0]
    assert list(attribution.incomplete()) == []


def test_a_command_that_was_seen_late_gets_its_pictures() -> None:
    """The broker stood still, or the link was away, while its predecessor ended."""
    attribution = flown(taker(0), taker(1))
    attribution.update(taker(1), 111.0)
    attribution.update(taker(2, expected=3), 123.0)
    assert commands_of(attribution, 107.0, 115.0, 116.0, 117.0, 118.0) == [0, 2, 2, 2, 1]


def test_commands_that_were_not_seen_to_run_share_their_pictures_in_order() -> None:
    attribution = flown(taker(0))
    attribution.update(taker(0), 101.0)
    for one in (taker(1, expected=2), taker(2), taker(3, expected=1)):
        attribution.update(one, 130.0)
    assert commands_of(attribution, 105.0, 107.0, 120.0) == [1, 1, 3]


NEAR, FAR = Area(40.0, -3.0), Area(40.0005, -3.0)
"""Places 56 m apart."""
CIRCLE = Area(40.001, -3.0, radius_m=20.0)


def at(area: Area, command: int, expected: int) -> PictureCommand:
    return PictureCommand("1/01PLAN", 7, command, command + 1, expected, area)


def test_a_picture_belongs_to_the_command_at_whose_place_it_was_taken() -> None:
    """The link was away meanwhile: which of the two ran when is not known."""
    attribution = flown(taker(0))
    attribution.update(taker(0), 101.0)
    for one in (at(NEAR, 1, expected=2), taker(2), at(FAR, 3, expected=2)):
        attribution.update(one, 130.0)
    later, earlier = (attribution.attribute(120.0, FIRST, place[:2]) for place in (FAR, NEAR))
    assert later is not None
    assert earlier is not None
    assert (later.command, earlier.command) == (3, 1)


def test_a_command_that_a_failed_mission_leaves_unflown_takes_no_later_picture() -> None:
    """The vehicle returns over its place, while the camera ends the series of the other one."""
    attribution = flown(at(NEAR, 0, expected=3))
    attribution.update(at(NEAR, 0, expected=3), 105.0)
    attribution.add_unseen([at(FAR, 1, expected=2)], 106.0)
    attribution.update(None, 106.0)
    found = [attribution.attribute(time_s, FIRST, FAR[:2]) for time_s in (105.5, 107.0)]
    assert [one and one.command for one in found] == [1, 0]


def test_a_command_that_may_have_run_at_any_time_takes_pictures_at_its_place_only() -> None:
    """An earlier run has ordered it, nobody knows when: others are of flights before."""
    attribution = Attribution()
    for time_s in (200.0, 203.0):
        attribution.update(at(NEAR, 1, expected=2), time_s, resumed_since_s=-math.inf)
    assert attribution.attribute(50.0, FIRST, (FAR.latitude_deg, FAR.longitude_deg)) is None
    near = attribution.attribute(60.0, FIRST, (NEAR.latitude_deg, NEAR.longitude_deg))
    assert near is not None
    assert near.command == 1


def test_a_picture_on_a_circle_belongs_to_the_command_behind_it() -> None:
    attribution = flown(taker(0))
    for one in (at(NEAR, 1, expected=1), at(CIRCLE, 2, expected=1)):
        attribution.update(one, 110.0)
    on_circle = 40.001 + 20.0 / 111_320.0, -3.0
    found = attribution.attribute(112.0, FIRST, on_circle)
    assert found is not None
    assert found.command == 2


def test_without_a_place_of_their_own_pictures_are_shared_in_order() -> None:
    attribution = flown(at(NEAR, 0, expected=1), at(NEAR, 1, expected=1), None)
    found = [attribution.attribute(time_s, FIRST, NEAR[:2]) for time_s in (108.0, 109.0)]
    assert [one and one.command for one in found] == [0, 1]


def test_one_picture_too_many_belongs_to_the_command_that_ran() -> None:
    """An order for pictures whose answer was lost is repeated, and obeyed twice."""
    attribution = flown(at(NEAR, 0, expected=1), at(NEAR, 1, expected=1), None)
    times_s = (101.0, 111.0, 113.0)
    found = [attribution.attribute(time_s, FIRST, NEAR[:2]) for time_s in times_s]
    assert [one and one.command for one in found] == [0, 1, 1]


def test_a_picture_far_from_all_commands_goes_by_its_time() -> None:
    attribution = flown(at(NEAR, 0, expected=1), at(NEAR, 1, expected=1), None)
    found = attribution.attribute(105.0, FIRST, (41.0, -3.0))
    assert found is not None
    assert found.command == 0


def test_a_picture_that_no_command_lacks_there_may_be_of_a_later_one() -> None:
    attribution = flown(taker(0), at(NEAR, 1, expected=1))
    assert attribution.may_be_of_later(115.0, FIRST, FAR[:2])
    assert not attribution.may_be_of_later(115.0, FIRST, NEAR[:2])
    assert not attribution.may_be_of_later(115.0, FIRST, None)
    attribution.attribute(115.0, FIRST, NEAR[:2])
    assert attribution.may_be_of_later(116.0, FIRST, NEAR[:2])


def test_a_command_that_was_resumed_takes_no_picture_behind_its_end() -> None:
    """Its own ones may have been announced before this run of the broker."""
    attribution = Attribution()
    attribution.update(taker(1, expected=2), 100.0, resumed_since_s=100.0)
    attribution.update(taker(2, expected=2), 104.0)
    assert commands_of(attribution, 105.0) == [2]


def test_a_command_of_which_nobody_knows_when_it_was_ordered_has_the_pictures_of_its_place() -> (
    None
):
    """Somebody else has taken one elsewhere in the same flight."""
    here, elsewhere = (58.4, 15.6), (58.401, 15.6)
    command = dataclasses.replace(taker(2, expected=2), area=Area(*here))
    attribution = Attribution()
    attribution.update(taker(4), 570.0, resumed_since_s=560.0)
    attribution.add_earlier(command, 500.0, is_undated=True)
    assert attribution.attribute(530.0, FIRST, elsewhere) is None
    assert attribution.attribute(531.0, FIRST, here) == command


def test_times_of_another_clock_are_shifted() -> None:
    attribution = flown(taker(0), taker(1, expected=1), taker(2))
    attribution.shift(-60.0)
    assert commands_of(attribution, 45.0, 55.0, 65.0) == [0, 1, 2]


def test_earlier_commands_beyond_the_bound_leave_the_newest_of_them() -> None:
    attribution = Attribution()
    attribution.update(taker(5000), 100.0, resumed_since_s=90.0)
    for number in range(2 * MAX_INTERVALS):
        attribution.add_earlier(taker(number, expected=1), 90.0)
    assert commands_of(attribution, 95.0) == [MAX_INTERVALS + 1]
    assert commands_of(attribution, 101.0) == [5000]
