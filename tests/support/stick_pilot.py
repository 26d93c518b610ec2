"""A pilot at the sticks of a simulated vehicle: MANUAL_CONTROL at 50 Hz of vehicle time."""

from typing import Final

from pymavlink.dialects.v20 import common

from tests.support.autopilot_tester import SYSTEM_ID, AutopilotTester

_PERIOD_STEPS: Final = 5  # 50 Hz


class StickPilot:
    """Holds the sticks from the start on, centred until `move`."""

    def __init__(self, tester: AutopilotTester) -> None:
        self._tester = tester
        self._steps = 0
        self.sending = True
        self.move()
        tester.watch(self._send)

    def move(
        self, *, forward: float = 0.0, right: float = 0.0, up: float = 0.0, yaw: float = 0.0
    ) -> None:
        """Hold the sticks like this, each -1..1; those not named are centred."""
        self._message = common.MAVLink_manual_control_message(
            SYSTEM_ID,
            round(1000 * forward),
            round(1000 * right),
            round(500 + 500 * up),
            round(1000 * yaw),
            0,
        )

    def _send(self) -> None:
        self._steps += 1
        if self.sending and self._steps % _PERIOD_STEPS == 0:
            self._tester.ground_station.send(self._message)


def change_mode(tester: AutopilotTester, main: int, sub: int = 0) -> None:
    """Ask for one of PX4's modes; the vehicle must accept."""
    tester.send_command(common.MAV_CMD_DO_SET_MODE, 1.0, float(main), float(sub))
