"""The autopilots that a test of the broker flies, and the modes in which they show a mission."""

import dataclasses

import pytest

from mavlink_broker.autopilots.families import OWN_PRODUCT
from tests.support.broker_world import GENERIC
from tests.support.real_autopilots import COPTER_4_6, PX4_1_17
from tests.support.vehicle_script import (
    ARDUPILOT,
    COPTER_AUTO,
    COPTER_BRAKE,
    COPTER_LAND,
    PX4,
    PX4_HOLD,
    PX4_LAND,
    PX4_MISSION,
)

OWN = dataclasses.replace(PX4, product=OWN_PRODUCT)
OWN_IF_THOROUGH = pytest.param(OWN, id="own", marks=pytest.mark.thorough)
"""This project's autopilot beside PX4, whose modes it has."""
SLOW_PX4 = dataclasses.replace(PX4, item_time_s=10.0)
"""Gives a test time while it flies an item."""
PX4_AND_ARDUPILOT = pytest.mark.parametrize("script", [PX4, ARDUPILOT], ids=["px4", "ardupilot"])
REAL_AUTOPILOTS = pytest.mark.parametrize(
    "script",
    [
        pytest.param(PX4_1_17, id="px4 1.17"),
        OWN_IF_THOROUGH,
        pytest.param(COPTER_4_6, id="copter 4.6"),
    ],
)
SCRIPTS = {"px4": PX4, "own": OWN, "ardupilot": ARDUPILOT, "generic": GENERIC}
KNOWN_FAMILIES = pytest.mark.parametrize(
    "family", ["px4", pytest.param("own", marks=OWN_IF_THOROUGH.marks), "ardupilot"]
)
"""Those of `SCRIPTS` whose modes the broker knows."""
FLYING_MODES = {
    "px4": PX4_MISSION,
    "own": PX4_MISSION,
    "ardupilot": COPTER_AUTO,
    "generic": PX4_MISSION,
}
PAUSED_MODES = {"px4": PX4_HOLD, "own": PX4_HOLD, "ardupilot": COPTER_BRAKE, "generic": PX4_HOLD}
LANDING_MODES = {"px4": PX4_LAND, "own": PX4_LAND, "ardupilot": COPTER_LAND}
"""HEARTBEAT.custom_mode of each of `SCRIPTS` that has one: in its items, paused, landing."""
