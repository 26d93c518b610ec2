import pytest

from uav_firmware.modules.mavlink.files.log_pace import (
    BURST,
    FEW_LOST,
    FIRST_PER_S,
    LEAST_PER_S,
    MOST_PER_S,
    SETTLING_US,
    UNPACED,
    LogPace,
)

MANY = 10_000


def asked_again(pace: LogPace, now_us: int, again: int = FEW_LOST + 1) -> int:
    pace.request(now_us, pending=MANY, again=again, follows=False)
    return pace.per_s


def asked_on(pace: LogPace, pending: int = MANY) -> int:
    pace.request(0, pending=pending, again=0, follows=True)
    return pace.per_s


def sent(pace: LogPace, now_us: int) -> int:
    pace.refill(now_us)
    count = 0
    while pace.ready and count < MANY:
        pace.spend()
        count += 1
    return count


def test_what_fits_into_a_buffer_is_sent_at_once() -> None:
    pace = LogPace()
    pace.request(0, pending=UNPACED, again=0, follows=False)
    assert sent(pace, 0) == MANY
    pace.request(0, pending=UNPACED + 1, again=0, follows=False)
    assert sent(pace, 0) == BURST


def test_the_pace_is_kept_while_nothing_is_requested() -> None:
    pace = LogPace()
    pace.request(0, pending=MANY, again=0, follows=False)
    sent(pace, 0)
    count = sum(sent(pace, now_us) for now_us in range(8_000, 60_000_001, 8_000))
    assert count == pytest.approx(60 * FIRST_PER_S, rel=0.01)


def test_requests_for_what_follows_raise_the_pace_to_its_end() -> None:
    pace = LogPace()
    paces = [asked_on(pace) for _ in range(10)]
    assert paces[:2] == [625, 781]
    assert paces == sorted(paces)
    assert paces[-1] == MOST_PER_S


def test_many_pieces_asked_for_again_halve_the_pace_once_a_second() -> None:
    pace = LogPace()
    assert asked_again(pace, 0) == FIRST_PER_S // 2
    assert asked_again(pace, SETTLING_US - 1) == FIRST_PER_S // 2
    assert asked_again(pace, SETTLING_US) == FIRST_PER_S // 4
    assert [asked_again(pace, n * SETTLING_US) for n in range(2, 5)] == [LEAST_PER_S] * 3


def test_a_few_lost_pieces_are_no_sign_of_a_full_buffer() -> None:
    pace = LogPace()
    assert asked_again(pace, 0, FEW_LOST) == FIRST_PER_S
    assert asked_on(pace) == 625
    assert asked_again(pace, 1, FEW_LOST) == 625
    assert asked_again(pace, 2, 1) == 312


def test_a_few_lost_pieces_of_many_do_not_slow_down_a_whole_log() -> None:
    pace = LogPace()
    for _ in range(10_000):
        pace.spend()
    assert asked_again(pace, 0, 300) == FIRST_PER_S
    assert asked_again(pace, 1, 1) == FIRST_PER_S // 2


def test_a_pace_that_was_halved_comes_back_slowly_and_no_further() -> None:
    pace = LogPace()
    asked_again(pace, 0)
    paces = []
    for second in range(60):
        pace.refill(second * SETTLING_US)
        paces.append(pace.per_s)
    assert paces[:3] == [250, 260, 270]
    assert paces[-1] == FIRST_PER_S
