"""Who has a vehicle: how somebody else's flight ends, and what a restarted broker knows of it."""

from collections.abc import Callable
from typing import Final

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.vehicle.armed_period import STAND_S, ArmedPeriod
from mavlink_broker.vehicle.control_authority import ObservedMode

MISSION: Final = ObservedMode("AUTO", ModeRole.MISSION, armed=True)
MANUAL: Final = ObservedMode("LOITER", ModeRole.OTHER, armed=True)
Change = Callable[[ArmedPeriod, float], None]
CHANGES: Final[dict[str, Change]] = {
    "armed in a mission": lambda period, now: period.update(MISSION, now),
    "armed by hand": lambda period, now: period.update(MANUAL, now),
    "disarmed": lambda period, now: period.update(MANUAL._replace(armed=False), now),
    "ordered to arm": lambda period, now: period.order_arming(now),
    "refused": lambda period, _: period.refuse_arming(),
    "others' mode": lambda period, _: period.note_mode(is_others=True),
    "own mode": lambda period, _: period.note_mode(is_others=False),
    "mission over": lambda period, _: period.end_mission(),
    "restarted": lambda period, _: period.forget_mode(),
    "claimed": lambda period, _: period.claim(),
    "lost": lambda period, _: period.lose(),
    "taken": lambda period, _: period.take_away(),
    "ended by others": lambda period, now: period.end_by_others(now),
}
"""What may happen to a vehicle, in any order."""
CLAIM, LOSE, TAKE_AWAY = CHANGES["claimed"], CHANGES["lost"], CHANGES["taken"]


def after(*changes: Change | ObservedMode, noted: str | None = None) -> ArmedPeriod:
    """Give the period of a vehicle to which this happens, a second apart, from 0 s on."""
    period = ArmedPeriod()
    period.recall(noted, -1.0)
    for now, change in enumerate(changes):
        if isinstance(change, ObservedMode):
            period.update(change, float(now))
        else:
            change(period, float(now))
    return period


def disarmed(seen: ObservedMode) -> ObservedMode:
    return seen._replace(armed=False)


def ordered(period: ArmedPeriod, now: float) -> None:
    period.order_arming(now)


def test_who_was_not_ordered_to_arm_was_armed_by_somebody_else() -> None:
    assert after(disarmed(MISSION), ordered, MISSION).obstacle(3.0) is None
    assert after(disarmed(MISSION), MISSION).obstacle(3.0) is not None


def test_a_flight_that_is_found_is_somebody_elses_until_it_is_recognised() -> None:
    assert after(MISSION).obstacle(1.0) is not None
    assert after(MISSION, CLAIM).obstacle(2.0) is None


def test_one_that_has_landed_before_it_was_recognised_needs_not_stand() -> None:
    assert after(MISSION, disarmed(MISSION)).obstacle(2.0) is not None
    assert after(MISSION, disarmed(MISSION), CLAIM).obstacle(3.0) is None


@pytest.mark.parametrize("loses", [LOSE, TAKE_AWAY])
def test_who_takes_a_vehicle_leaves_it_to_stand(loses: Change) -> None:
    period = after(disarmed(MISSION), ordered, MISSION, loses, MANUAL, disarmed(MANUAL))
    assert period.obstacle(5.0 + STAND_S - 0.1) is not None
    assert period.obstacle(5.0 + STAND_S) is None


def test_a_vehicle_that_was_taken_from_a_mission_stays_taken_until_it_is_disarmed() -> None:
    period = after(MISSION, TAKE_AWAY, CLAIM)
    assert period.is_taken
    period.update(disarmed(MISSION), 9.0)
    assert not period.is_taken


def test_of_a_flight_of_unknown_origin_the_note_of_the_earlier_run_stays() -> None:
    assert after(MANUAL, noted="LOITER").noted_mode == "LOITER"
    assert after(MANUAL).noted_mode is None
    assert after(MANUAL, CLAIM, noted="LOITER").noted_mode is None


def test_whoever_has_landed_a_vehicle_that_was_found_is_noted_until_its_mission_is_found() -> None:
    assert after(MANUAL, disarmed(MANUAL)).noted_mode == "LOITER"
    assert after(MANUAL, disarmed(MANUAL), CLAIM).noted_mode is None


def test_no_claim_behind_the_landing_is_of_a_flight_that_was_taken() -> None:
    period = after(MISSION, CLAIM, TAKE_AWAY, MANUAL, disarmed(MANUAL), CLAIM)
    assert period.stood_s(5.0) is not None


def test_a_record_that_is_read_again_does_not_begin_the_wait_anew() -> None:
    period = after(disarmed(MANUAL), noted="LOITER")
    period.recall("LOITER", 19.0)
    assert period.obstacle(STAND_S - 1.0 + 0.1) is None


def test_who_takes_a_vehicle_in_a_hover_that_was_found_is_noted() -> None:
    assert after(MISSION, CLAIM, LOSE, MANUAL).noted_mode == "LOITER"


HAPPENS: Final = st.lists(
    st.tuples(st.sampled_from(sorted(CHANGES)), st.floats(0.1, 40.0)), max_size=30
)
"""What happens, each after so many seconds."""


@example(is_found=True, happens=[("restarted", 1.0), ("disarmed", 1.0)])
@given(st.booleans(), HAPPENS)
def test_a_vehicle_that_stands_for_somebody_else_stands_for_a_restarted_broker_too(
    is_found: bool, happens: list[tuple[str, float]]
) -> None:
    begins = (MISSION,) if is_found else (disarmed(MISSION), ordered, MISSION)
    period, now = after(*begins), 3.0
    for name, passes_s in happens:
        now += passes_s
        CHANGES[name](period, now)
        again = ArmedPeriod()
        again.recall(period.noted_mode, now)
        again.update(MANUAL._replace(armed=period.is_armed), now)
        if not period.is_armed and period.stood_s(now) is not None:
            assert again.stood_s(now) == 0.0


@given(HAPPENS)
def test_whatever_happens_no_vehicle_stands_for_longer(happens: list[tuple[str, float]]) -> None:
    period, now = ArmedPeriod(), 0.0
    for name, passes_s in happens:
        now += passes_s
        CHANGES[name](period, now)
    period.update(disarmed(MANUAL), now)
    now += STAND_S + 0.1
    assert period.obstacle(now) is None
    period.update(disarmed(MANUAL), now)
    assert period.noted_mode is None or not period.is_others
