"""Whose picture it is: by its time, and by what a command still lacks."""

from mavlink_broker.pictures.attribution import Attribution, Taker


def taker(command: int, expected: int = 0) -> Taker:
    return Taker("1/01PLAN", 7, command, command + 1, expected)


def commands_of(attribution: Attribution, *times_s: float) -> list[int | None]:
    takers = [attribution.attribute(time_s) for time_s in times_s]
    return [None if one is None else one.command for one in takers]


def flown(*takers: Taker | None) -> Attribution:
    """Commands of ten seconds each, from 100 s on."""
    attribution = Attribution()
    for number, one in enumerate(takers):
        attribution.watch(one, 100.0 + 10.0 * number)
    return attribution


def test_a_picture_is_of_the_command_that_was_running() -> None:
    attribution = flown(taker(0), taker(1), None)
    assert commands_of(attribution, 99.0, 100.0, 109.9, 110.0, 119.9, 120.1) == [
        None,
        0,
        0,
        1,
        1,
        None,
    ]


def test_a_command_that_takes_pictures_gets_those_from_shortly_before_news_of_it_came() -> None:
    attribution = flown(taker(0), taker(1, expected=2), taker(2))
    assert commands_of(attribution, 108.0, 108.5) == [1, 1]


def test_what_it_does_not_lack_is_not_its() -> None:
    attribution = flown(taker(0), taker(1, expected=1), taker(2))
    assert commands_of(attribution, 112.0, 108.0, 122.0) == [1, 0, 2]


def test_what_it_lacks_may_come_late() -> None:
    attribution = flown(taker(0), taker(1, expected=3), taker(2))
    assert commands_of(attribution, 112.0, 121.0, 129.0, 129.5) == [1, 1, 1, 2]


def test_two_bursts_in_a_row_share_their_pictures_in_order() -> None:
    attribution = flown(taker(0, expected=2), taker(1, expected=2), None)
    assert commands_of(attribution, 108.0, 109.8, 110.5, 119.0) == [0, 0, 1, 1]


def test_a_command_that_lacks_pictures_is_known_when_it_has_ended() -> None:
    attribution = flown(taker(0, expected=2), taker(1))
    (span,) = attribution.ended_and_lacking()
    assert span.lacks == 2
    attribution.attribute(105.0)
    attribution.attribute(106.0)
    assert list(attribution.ended_and_lacking()) == []


def test_of_a_command_whose_beginning_was_not_seen_nothing_is_missing() -> None:
    attribution = Attribution()
    attribution.watch(None, 90.0)
    attribution.watch(taker(3, expected=4), 100.0, is_resumed=True)
    attribution.watch(taker(4, expected=1), 110.0, is_resumed=True)
    attribution.watch(None, 120.0)
    assert [span.taker for span in attribution.ended_and_lacking()] == [taker(4, expected=1)]
