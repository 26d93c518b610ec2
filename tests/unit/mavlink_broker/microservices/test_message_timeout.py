"""Timeouts of periodic messages, on good and on lossy links."""

import random

import pytest

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.link_state import (
    MAX_TIMEOUT_S,
    MIN_TIMEOUT_S,
    FrameLoss,
    PeriodicSource,
)


def received_over(loss: float, frames: int = 4000, seed: int = 1) -> FrameLoss:
    encoder, decoder, chance = Encoder(1, 1), Decoder(), random.Random(seed)
    link = FrameLoss()
    for _ in range(frames):
        frame = encoder.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
        if chance.random() >= loss:
            for message in decoder.decode(frame):
                link.take(message)
    return link


@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2, 0.5])
def test_the_share_of_lost_frames_is_found(loss: float) -> None:
    assert received_over(loss).ratio == pytest.approx(loss, abs=0.06)


def test_repeated_and_late_frames_are_not_lost() -> None:
    encoder, link = Encoder(1, 1), FrameLoss()
    frames = [encoder.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)) for _ in "12345"]
    for number in (0, 1, 1, 2, 3, 2, 4):
        (message,) = Decoder().decode(frames[number])
        link.take(message)
    assert link.ratio == 0.0


def regular_source(times: int, every_s: float) -> PeriodicSource:
    periodic = PeriodicSource(0.0)
    for number in range(1, times):
        periodic.received(number * every_s)
    return periodic


def silent_after(periodic: PeriodicSource, loss: float = 0.0) -> float:
    """How long it must have been silent."""
    return next(
        tenth / 10
        for tenth in range(2000)
        if periodic.is_silent(periodic.received_at + tenth / 10, loss)
    )


def test_five_seconds_are_silence_where_nothing_is_lost() -> None:
    assert silent_after(regular_source(10, 1.0)) == MIN_TIMEOUT_S


def test_the_more_is_lost_the_longer_it_takes_but_not_for_ever() -> None:
    patience = [silent_after(regular_source(10, 1.0), loss) for loss in (0.05, 0.2, 0.4, 0.8)]
    assert patience == sorted(patience)
    assert 8.0 < patience[1] < 10.0
    assert patience[-1] == MAX_TIMEOUT_S


def test_a_longer_interval_has_a_longer_timeout() -> None:
    assert silent_after(regular_source(5, 10.0)) == pytest.approx(30.0)


def test_two_messages_do_not_make_a_periodic_source() -> None:
    assert not regular_source(2, 1.0).is_silent(1000.0, 0.0)


def test_a_timeout_lasts_until_the_next_message_also_if_the_loss_grows() -> None:
    periodic = regular_source(10, 1.0)
    now = periodic.received_at + MIN_TIMEOUT_S
    assert periodic.is_silent(now, 0.0)
    assert periodic.is_silent(now, 0.8)
    periodic.received(now)
    assert not periodic.is_silent(now, 0.0)
