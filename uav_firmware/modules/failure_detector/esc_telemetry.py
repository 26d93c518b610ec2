"""Whether the telemetry of the speed controllers shows the rotors: pure, one look at a time.

    lost     it came, and none has come from each of them for half a second
    frozen   every speed the same to the last digit for a second, while a command moves

Nothing else sees a failed motor at once. A speed is known to some 0.5 % (DShot: 9 bits of mantissa)
and follows its command within tenths of a second, so that it cannot stay when the command moves by
a share of 0.02, 4 % of hover; steady commands prove nothing. Rotors that stand are no frozen ones.
"""

from typing import Final

from uav_firmware.msg.sensors import SensorEsc
from uav_firmware.msg.vectors import Motors

FROZEN_US: Final = 1_000_000
MOVED: Final = 0.02
"""[-] Share of full command."""
LOST: Final = "lost"
FROZEN: Final = "frozen"


class EscTelemetryCheck:
    """Follows the reports while the vehicle is armed; `fault` is empty while they are sound."""

    def __init__(self) -> None:
        self.fault = ""
        self._report: SensorEsc | None = None
        self._since_us = 0  # The speeds are the same since then
        self._least: Motors = (1.0, 1.0, 1.0, 1.0)  # [-] Commands since then
        self._most: Motors = (0.0, 0.0, 0.0, 0.0)

    def rest(self) -> None:
        """The motors stand: begin anew."""
        self.fault = ""
        self._report = None

    def update(
        self, report: SensorEsc | None, command: Motors, now_us: int, *, silent: bool
    ) -> bool:
        """Whether a fault has begun.

        Args:
            report: The newest one; None if there was none since the start.
            command: Of each motor, 0 to 1.
            now_us: Time since boot [us].
            silent: No complete report came for some time.
        """
        before = self.fault
        if report is None:
            return False
        if silent:
            self.fault, self._report = LOST, None
        elif self._is_frozen(report, command, now_us):
            self.fault = FROZEN
        else:
            self.fault = ""
        return self.fault not in ("", before)

    def _is_frozen(self, report: SensorEsc, command: Motors, now_us: int) -> bool:
        former = self._report
        if former is None or former.rotor_rpm != report.rotor_rpm:
            self._report, self._since_us = report, now_us
            self._least = self._most = command
            return False
        if self.fault == FROZEN:
            return True
        one, two, three, four = map(min, self._least, command)
        self._least = least = (one, two, three, four)
        one, two, three, four = map(max, self._most, command)
        self._most = most = (one, two, three, four)
        moved = max(high - low for low, high in zip(least, most, strict=True))
        turning = min(report.rotor_rpm) > 0.0
        return turning and moved >= MOVED and now_us - self._since_us >= FROZEN_US
