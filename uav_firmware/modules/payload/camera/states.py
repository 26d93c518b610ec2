"""State machine of the camera's shutter.

Video can be recorded in any of these states.
"""

from collections.abc import Mapping
from enum import Enum
from typing import Final


class CameraState(Enum):
    """Activity of the shutter."""

    IDLE = "idle"
    SINGLE = "single"  # Single pictures, until the last one is saved
    SERIES = "series"  # Pictures at an interval of time
    DISTANCE = "distance"  # Pictures at an interval of distance
    PANORAMA = "panorama"  # Pictures in several directions, the gimbal turns between


class CameraEvent(Enum):
    """Cause of a transition."""

    SHOOT = "take_picture"
    BEGIN_SERIES = "begin series"
    BEGIN_DISTANCE = "begin distance"
    BEGIN_PANORAMA = "begin panorama"
    SAVED = "saved"  # No picture is queued
    STOP = "stop"  # By command, by count, by a full storage, by the end of the flight


TRANSITIONS: Final[Mapping[tuple[CameraState, CameraEvent], CameraState]] = {
    (CameraState.IDLE, CameraEvent.SHOOT): CameraState.SINGLE,
    (CameraState.IDLE, CameraEvent.BEGIN_SERIES): CameraState.SERIES,
    (CameraState.IDLE, CameraEvent.BEGIN_DISTANCE): CameraState.DISTANCE,
    (CameraState.IDLE, CameraEvent.BEGIN_PANORAMA): CameraState.PANORAMA,
    (CameraState.SINGLE, CameraEvent.SHOOT): CameraState.SINGLE,
    (CameraState.SINGLE, CameraEvent.SAVED): CameraState.IDLE,
    (CameraState.SINGLE, CameraEvent.STOP): CameraState.IDLE,
    (CameraState.SERIES, CameraEvent.SHOOT): CameraState.SERIES,  # While it is paused
    (CameraState.SERIES, CameraEvent.STOP): CameraState.IDLE,
    (CameraState.DISTANCE, CameraEvent.SHOOT): CameraState.DISTANCE,
    (CameraState.DISTANCE, CameraEvent.BEGIN_DISTANCE): CameraState.DISTANCE,
    (CameraState.DISTANCE, CameraEvent.STOP): CameraState.IDLE,
    (CameraState.PANORAMA, CameraEvent.STOP): CameraState.IDLE,
}


class CameraBusyError(Exception):
    """An event has no transition; the state stays. Becomes TEMPORARILY_REJECTED."""


def after(state: CameraState, event: CameraEvent) -> CameraState:
    """Return the state after an event.

    Raises:
        CameraBusyError: if the table has no such transition.
    """
    try:
        return TRANSITIONS[state, event]
    except KeyError:
        raise CameraBusyError(f"the camera is busy ({state.value})") from None
