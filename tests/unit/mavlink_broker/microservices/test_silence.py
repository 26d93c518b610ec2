"""Silence that means something, and silence that a bad link explains."""

import random

import pytest

from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.silence import LONGEST_S, SILENT_S, LinkLoss, Voice


def heard_over(loss: float, frames: int = 4000, seed: int = 1) -> LinkLoss:
    encoder, decoder, chance = Encoder(1, 1), Decoder(), random.Random(seed)
    link = LinkLoss()
    for _ in range(frames):
        frame = encoder.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
        if chance.random() >= loss:
            for message in decoder.decode(frame):
                link.take(message)
    return link


@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2, 0.5])
def test_the_share_of_lost_frames_is_found(loss: float) -> None:
    assert heard_over(loss).share == pytest.approx(loss, abs=0.06)


def test_frames_that_come_twice_or_late_are_no_loss() -> None:
    encoder, link = Encoder(1, 1), LinkLoss()
    frames = [encoder.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)) for _ in "12345"]
    for number in (0, 1, 1, 2, 3, 2, 4):
        (message,) = Decoder().decode(frames[number])
        link.take(message)
    assert link.share == 0.0


def speaking(times: int, every_s: float) -> Voice:
    voice = Voice(0.0)
    for number in range(1, times):
        voice.heard(number * every_s)
    return voice


def silent_after(voice: Voice, loss: float = 0.0) -> float:
    """How long it must have been silent."""
    return next(
        tenth / 10 for tenth in range(2000) if voice.is_silent(voice.heard_at + tenth / 10, loss)
    )


def test_five_seconds_are_silence_where_nothing_is_lost() -> None:
    assert silent_after(speaking(10, 1.0)) == SILENT_S


def test_the_more_is_lost_the_longer_it_takes_but_not_for_ever() -> None:
    patience = [silent_after(speaking(10, 1.0), loss) for loss in (0.05, 0.2, 0.4, 0.8)]
    assert patience == sorted(patience)
    assert 8.0 < patience[1] < 10.0
    assert patience[-1] == LONGEST_S


def test_who_speaks_rarely_may_be_silent_for_longer() -> None:
    assert silent_after(speaking(5, 10.0)) == pytest.approx(30.0)


def test_who_has_spoken_twice_is_not_missed() -> None:
    assert not speaking(2, 1.0).is_silent(1000.0, 0.0)


def test_who_has_fallen_silent_is_so_until_heard_again_also_on_a_link_that_gets_worse() -> None:
    voice = speaking(10, 1.0)
    now = voice.heard_at + SILENT_S
    assert voice.is_silent(now, 0.0)
    assert voice.is_silent(now, 0.8)
    voice.heard(now)
    assert not voice.is_silent(now, 0.0)
