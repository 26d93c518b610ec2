"""State machine of the camera: every pair of state and event."""

import itertools

import pytest

from tests.support.cases import failures
from uav_firmware.modules.payload.camera.camera import Camera
from uav_firmware.modules.payload.camera.states import (
    TRANSITIONS,
    CameraBusyError,
    CameraEvent,
    CameraState,
    after,
)

PAIRS = list(itertools.product(CameraState, CameraEvent))


def check_pair(state: CameraState, event: CameraEvent) -> None:
    if (state, event) in TRANSITIONS:
        assert after(state, event) is TRANSITIONS[state, event]
    else:
        with pytest.raises(CameraBusyError, match=state.value):
            after(state, event)


def test_transitions_follow_the_table() -> None:
    assert failures(check_pair, PAIRS) == []


def test_every_state_is_reachable_and_stop_leaves_it() -> None:
    assert set(TRANSITIONS.values()) == set(CameraState)
    for state in set(CameraState) - {CameraState.IDLE}:
        assert after(state, CameraEvent.STOP) is CameraState.IDLE


def test_a_rejected_order_changes_nothing() -> None:
    camera = Camera()
    camera.begin_series(1.0, 0, 0, from_mission=False)
    for order in (
        camera.take_picture,
        camera.begin_panorama,
        lambda: camera.begin_series(2.0, 0, 0, from_mission=False),
        lambda: camera.begin_distance(5.0, at_once=True, from_mission=False),
    ):
        with pytest.raises(CameraBusyError):
            order()
    assert camera.state is CameraState.SERIES
    assert camera.interval_s == 1.0
