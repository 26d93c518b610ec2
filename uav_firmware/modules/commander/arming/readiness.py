"""Whether the vehicle may be armed and what its sensors do, as ground stations are told."""

from typing import Final, NamedTuple

from uav_firmware.modules.commander.arming.health_checks import healthy_in_flight
from uav_firmware.modules.commander.arming.sensor_watch import (
    enabled_bits,
    healthy_bits,
    present_bits,
)
from uav_firmware.modules.commander.commands.dispatch import arming_refusal
from uav_firmware.modules.commander.commands.flight_commands import Situation
from uav_firmware.msg.status import NavigationState

EXAMINE_PERIOD_US: Final = 100_000
"""10 Hz [us]: failsafes and readiness need not be looked at in every step."""


class Health(NamedTuple):
    """Readiness and sensors, as they were last examined."""

    due_us: int  # [us] When to look again
    mode: NavigationState
    armed: bool
    ready: bool = False  # Arming would be accepted; in flight, the health that it asks for is there
    present: int = 0  # [-] MAV_SYS_STATUS_SENSOR bits
    enabled: int = 0  # [-]
    healthy: int = 0  # [-]


def examine(situation: Situation) -> Health:
    """Look at everything once."""
    view = situation.view
    if situation.armed:
        ready = healthy_in_flight(view, situation.params)
    else:
        ready = arming_refusal(situation) is None
    present = present_bits(view.ages)
    return Health(
        view.now_us + EXAMINE_PERIOD_US,
        situation.mode,
        situation.armed,
        ready,
        present,
        enabled_bits(view, present),
        healthy_bits(view, ready=ready),
    )
