"""How serious a sentence to the operator is, and the ones that go with disarming."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

from uav_firmware.modules.commander.arming.arming_states import ArmingEvent


class Severity(IntEnum):
    """MAVLink's MAV_SEVERITY, as far as it is used here."""

    EMERGENCY = 0
    CRITICAL = 2
    WARNING = 4
    INFO = 6


DISARM_TEXTS: Final[Mapping[ArmingEvent, tuple[Severity, str]]] = {
    ArmingEvent.DISARM_ACCEPTED: (Severity.INFO, "Disarmed by command"),
    ArmingEvent.LANDED_TIMEOUT: (Severity.INFO, "Disarmed after landing"),
    ArmingEvent.PREFLIGHT_TIMEOUT: (Severity.INFO, "Disarmed: no take-off"),
    ArmingEvent.FAILSAFE: (Severity.EMERGENCY, "Disarmed by failsafe"),
    ArmingEvent.TERMINATED: (Severity.EMERGENCY, "Flight terminated"),
    ArmingEvent.CRASHED: (Severity.EMERGENCY, "Crash detected, motors stopped"),
    ArmingEvent.MOTOR_FAILED_ON_GROUND: (Severity.CRITICAL, "Disarmed: motor failure"),
}
