"""What ends with a flight: pictures by time or distance, and at last the video."""

from typing import Final

from uav_firmware.modules.payload.parts import Parts
from uav_firmware.modules.payload.situation import Situation
from uav_firmware.msg.status import NavigationState

_GOING_DOWN: Final = frozenset(
    {
        NavigationState.AUTO_RTL,
        NavigationState.AUTO_LAND,
        NavigationState.AUTO_PRECLAND,
        NavigationState.TERMINATION,
    }
)


class FlightEnd:
    """Watches for the end of the work: the way home, a landing, disarming."""

    def __init__(self) -> None:
        self._state: NavigationState | None = None
        self._armed = False

    def update(self, parts: Parts, situation: Situation) -> str | None:
        """Stop what has to stop; a sentence about it, or None."""
        goes_down = (
            situation.armed
            and situation.state in _GOING_DOWN
            and situation.state is not self._state
        )
        disarms = self._armed and not situation.armed
        self._state, self._armed = situation.state, situation.armed
        if not (goes_down or disarms):
            return None
        parts.mission_orders.clear()
        pictures = parts.camera.stop_series()
        video = disarms and parts.camera.recording_since_us >= 0
        if video:
            parts.camera.stop_video()
        if not (pictures or video):
            return None
        what = " and ".join(n for n, ends in (("Pictures", pictures), ("Video", video)) if ends)
        return f"{what} stopped: {'disarmed' if disarms else situation.state.name}"
