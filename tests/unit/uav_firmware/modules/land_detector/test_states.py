import itertools

import pytest

from uav_firmware.modules.land_detector.states import TRANSITIONS, LandEvent, next_state
from uav_firmware.msg.status import LandedState


def test_a_flight_goes_round_the_table() -> None:
    state = LandedState.ON_GROUND
    visited = []
    for event in (
        LandEvent.LIFT_OFF,
        LandEvent.CLEAR,
        LandEvent.DESCEND,
        LandEvent.CLIMB,
        LandEvent.DESCEND,
        LandEvent.TOUCH_DOWN,
    ):
        state = next_state(state, event)
        visited.append(state)
    assert visited == [
        LandedState.TAKEOFF,
        LandedState.IN_AIR,
        LandedState.LANDING,
        LandedState.IN_AIR,
        LandedState.LANDING,
        LandedState.ON_GROUND,
    ]


@pytest.mark.parametrize(
    ("state", "event"),
    [pair for pair in itertools.product(LandedState, LandEvent) if pair not in TRANSITIONS],
)
def test_every_other_event_changes_nothing(state: LandedState, event: LandEvent) -> None:
    assert next_state(state, event) is state


def test_stopped_motors_are_the_ground_from_everywhere() -> None:
    for state in (LandedState.TAKEOFF, LandedState.IN_AIR, LandedState.LANDING):
        assert next_state(state, LandEvent.DISARM) is LandedState.ON_GROUND
