"""The camera's table: every pair of state and event does what it says or changes nothing."""

import itertools

import pytest

from uav_firmware.modules.payload.camera.camera import Camera
from uav_firmware.modules.payload.camera.states import (
    TRANSITIONS,
    CameraBusyError,
    CameraEvent,
    CameraState,
    after,
)

PAIRS = list(itertools.product(CameraState, CameraEvent))


@pytest.mark.parametrize(("state", "event"), PAIRS)
def test_a_pair_leads_where_the_table_says_or_is_refused(
    state: CameraState, event: CameraEvent
) -> None:
    if (state, event) in TRANSITIONS:
        assert after(state, event) is TRANSITIONS[state, event]
    else:
        with pytest.raises(CameraBusyError, match=state.value):
            after(state, event)


def test_every_state_is_reached_and_left_by_a_stop() -> None:
    assert set(TRANSITIONS.values()) == set(CameraState)
    for state in set(CameraState) - {CameraState.IDLE}:
        assert after(state, CameraEvent.STOP) is CameraState.IDLE


def test_a_refused_order_changes_nothing() -> None:
    camera = Camera()
    camera.begin_series(1.0, 0, 0, from_mission=False)
    for order in (
        camera.shoot,
        camera.begin_panorama,
        lambda: camera.begin_series(2.0, 0, 0, from_mission=False),
        lambda: camera.begin_distance(5.0, at_once=True, from_mission=False),
    ):
        with pytest.raises(CameraBusyError):
            order()
    assert camera.state is CameraState.SERIES
    assert camera.interval_s == 1.0
