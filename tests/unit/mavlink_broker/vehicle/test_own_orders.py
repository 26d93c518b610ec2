"""A descent or a pause that the broker has ordered, by the modes that the vehicle shows."""

import pytest

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.vehicle.control_authority import (
    ORDERED_MODE_WITHIN_S,
    ObservedMode,
    OwnDescent,
    OwnPause,
)

MISSION = ObservedMode("AUTO.MISSION", ModeRole.MISSION, armed=True)
RETURN = ObservedMode("AUTO.RTL", ModeRole.ENDING, armed=True)
LAND = ObservedMode("AUTO.LAND", ModeRole.ENDING, armed=True)


def is_flown(before: ObservedMode, accepted_in: ObservedMode, *shown: ObservedMode) -> bool:
    """Order a descent; whether it is still flown after heartbeats at 2 Hz."""
    descent = OwnDescent()
    descent.order(before.mode)
    descent.begin(accepted_in, None)
    for count, seen in enumerate(shown):
        descent.update(seen, is_down=False, now=0.5 * count)
    return descent.is_flown


@pytest.mark.parametrize("accepted_in", [MISSION, LAND])
def test_a_descent_is_flown_in_the_mode_that_it_begins_with(accepted_in: ObservedMode) -> None:
    assert is_flown(MISSION, accepted_in, LAND, LAND)
    assert not is_flown(MISSION, accepted_in, LAND, RETURN)


@pytest.mark.parametrize("accepted_in", [RETURN, LAND])
def test_the_mode_of_before_may_be_shown_for_a_moment(accepted_in: ObservedMode) -> None:
    """The mission's own return, or that of an older order."""
    assert is_flown(RETURN, accepted_in, LAND)
    assert is_flown(RETURN, RETURN, RETURN, LAND, LAND)
    assert not is_flown(RETURN, accepted_in, LAND, RETURN)


def test_a_pause_is_the_brokers_from_soon_after_its_order_until_its_mode_is_left() -> None:
    pause = OwnPause()
    pause.update("BRAKE", 0.0)
    assert not pause.holds_in("BRAKE")
    pause.order("BRAKE", 1.0)
    for now, mode, holds in (
        *((1.5, "AUTO", False), (2.0, "BRAKE", True), (60.0, "BRAKE", True)),
        *((61.0, "AUTO", False), (62.0, "BRAKE", False)),
    ):
        pause.update(mode, now)
        assert pause.holds_in("BRAKE") is holds


def test_a_mode_that_shows_long_after_the_order_is_somebody_elses() -> None:
    pause = OwnPause()
    pause.order("BRAKE", 0.0)
    pause.update("BRAKE", ORDERED_MODE_WITHIN_S + 0.1)
    assert not pause.holds_in("BRAKE")
