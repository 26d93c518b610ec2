"""When the motors stop by themselves: pure but for the memory of one flight."""

from uav_firmware.modules.commander.arming.arming_states import ArmingEvent
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.msg.mission import MissionState


class DisarmTimer:
    """Watches the ground from arming on."""

    def __init__(self) -> None:
        self._flown = False
        self._grounded_since_us = 0
        self._mission_since_us = 0  # Began on the ground, or has flown

    def start(self, now_us: int) -> None:
        """The vehicle has just been armed."""
        self._flown = False
        self._grounded_since_us = self._mission_since_us = now_us

    def due(
        self, now_us: int, *, landed: bool, mission_state: int, params: CommanderParams
    ) -> ArmingEvent | None:
        """Event that disarms now, if any.

        A mission that goes on after a landing, or waits before its take-off, keeps the motors
        running; one that never takes off, for COM_DISARM_MIS.
        """
        if not landed:
            self._flown = True
        in_mission = mission_state == MissionState.ACTIVE
        if self._flown or not in_mission:
            self._mission_since_us = now_us
        waited_s = (now_us - self._mission_since_us) * 1e-6
        if waited_s > 0.0 and 0.0 <= params.disarm_mission_s <= waited_s:
            return ArmingEvent.PREFLIGHT_TIMEOUT
        if not landed or in_mission:
            self._grounded_since_us = now_us
            return None
        grounded_s = (now_us - self._grounded_since_us) * 1e-6
        if self._flown:
            over = 0.0 <= params.disarm_landed_s <= grounded_s
            return ArmingEvent.LANDED_TIMEOUT if over else None
        over = 0.0 <= params.disarm_preflight_s <= grounded_s
        return ArmingEvent.PREFLIGHT_TIMEOUT if over else None
