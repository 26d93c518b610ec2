"""When a source of measurements is stopped, and when it is used again."""

from typing import cast

from uav_firmware.modules.estimator.kalman_filter.covariance import Measurement
from uav_firmware.modules.estimator.kalman_filter.ekf import ErrorStateEkf
from uav_firmware.modules.estimator.kalman_filter.gate import RESUME_AFTER_S, STOP_AFTER_S, Aid

SECOND_US = 1_000_000


class Filter:
    """A filter that expects a deviation of 1, and counts what is fused."""

    def __init__(self) -> None:
        self.fused = 0

    def deviation(self, _: Measurement) -> float:
        return 1.0

    def fuse(self, _: object) -> None:
        self.fused += 1


class Reading:
    """A measurement."""

    def __init__(self, innovation: float) -> None:
        self.innovation = innovation


def judged(aid: Aid, innovation: float, at_s: float) -> bool:
    """Whether a measurement at a time was fused."""
    group = [cast("Measurement", Reading(innovation))]
    return aid.fuse(cast("ErrorStateEkf", Filter()), group, round(at_s * SECOND_US))


def stopped() -> tuple[Aid, float]:
    """A source that has been rejected for long enough, and the time [s]."""
    aid, at_s = Aid(gate=3.0), 0.0
    while not aid.stopped:
        judged(aid, 9.0, at_s)
        at_s += 0.1
    return aid, at_s


def test_a_source_within_the_gate_is_fused_and_one_beyond_it_is_not() -> None:
    aid = Aid(gate=3.0)
    assert judged(aid, 2.9, 0.0)
    assert not judged(aid, 3.1, 0.1)
    assert judged(aid, -2.9, 0.2)


def test_a_source_that_disagrees_is_stopped_after_its_time() -> None:
    _, at_s = stopped()
    assert STOP_AFTER_S < at_s < STOP_AFTER_S + 0.5


def test_a_stopped_source_is_used_again_after_it_has_agreed_for_its_time() -> None:
    aid, at_s = stopped()
    began_s = at_s
    while not judged(aid, 0.0, at_s):
        at_s += 0.1
    assert RESUME_AFTER_S - 1e-6 <= at_s - began_s < RESUME_AFTER_S + 0.2
    assert not aid.stopped


def test_one_disagreement_begins_that_time_anew() -> None:
    aid, at_s = stopped()
    judged(aid, 0.0, at_s)
    judged(aid, 9.0, at_s + 1.5)
    assert not judged(aid, 0.0, at_s + 2.5)
    assert not judged(aid, 0.0, at_s + 3.5)
    assert judged(aid, 0.0, at_s + 4.6)


def test_one_that_is_doubted_is_used_until_it_disagrees_and_then_no_more() -> None:
    aid = Aid(gate=3.0)
    group = [cast("Measurement", Reading(1.0))]

    def fused(at_s: float, *, doubted: bool) -> bool:
        filter_ = cast("ErrorStateEkf", Filter())
        return aid.fuse(filter_, group, round(at_s * SECOND_US), doubted=doubted)

    assert fused(0.0, doubted=True)
    judged(aid, 9.0, 0.1)
    assert not fused(0.2, doubted=True)
    assert aid.ratio > 1.0
    assert fused(0.3, doubted=False)
