"""PX4 and ArduCopter as their sources make them behave, one named setting per difference.

PX4: `mavlink_mission.cpp`, `mission_base.cpp`, `FeasibilityChecker.cpp`, `Commander.cpp`,
`SYS_STATUS.hpp`, `STATUSTEXT.hpp`, `HEARTBEAT.hpp`, `failsafe.cpp`, `mavlink_receiver.cpp`,
`gimbal/input_mavlink.cpp`.
ArduPilot: `MissionItemProtocol.cpp`, `AP_Mission.cpp`, `GCS_Common.cpp`, `mode_auto.cpp`,
`GCS_MAVLink_Copter.cpp`.
"""

import math
from dataclasses import replace
from typing import Final

from tests.support.stored_items import as_ardupilot_keeps, as_px4_keeps
from tests.support.vehicle_script import Script
from tests.support.vehicle_wire import mavlink

PX4_MODES_TO_ARM_IN: Final = frozenset({4 << 16 | 2 << 24, 4 << 16 | 3 << 24, 4 << 16 | 4 << 24})
"""Take-off, hold, mission: what flies without a remote control."""
COPTER_MODES_TO_ARM_IN: Final = frozenset({0, 2, 4, 5, 16})

_NO_CAMERAS: Final = frozenset({2000, 2001, 2500, 2501})
PX4_1_17: Final = Script(
    keeps=as_px4_keeps,
    mission_every_s=1.0,
    sends_current_on_request=False,
    results={mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: mavlink.MAV_RESULT_UNSUPPORTED},
    no_mission_total=65535,
    arms_in=PX4_MODES_TO_ARM_IN,
    readiness_by_mode=True,
    version=0x011100FF,
    has_checks=False,
    loses_current=True,
    needs_station_for_texts=True,
    disarms_after_s=2.0,
    return_changes_mode=True,
    accepts_modes_early=True,
    heartbeats_at_once=False,
    flies_without_items=False,
    manages_gimbal=True,
    repeats_pictures=True,
)
PX4_1_16: Final = replace(PX4_1_17, sends_mission_state=False, version=0x011001FF)
"""Without mission state in its messages."""
PX4_1_15: Final = replace(PX4_1_16, accepts_modes_early=False, version=0x010F04FF)
"""It judges a mode before it answers."""
PX4_1_14: Final = replace(PX4_1_15, gives_ids=False, version=0x010E03FF)
"""Without mission ids too."""
PX4_1_13: Final = replace(
    PX4_1_14,
    sends_total=False,
    readiness_by_mode=False,
    arms_in=None,
    version=0x010D03FF,
    has_checks=True,
)
"""Without the total in MISSION_CURRENT; its readiness is for one mode."""
PX4_BARE: Final = replace(PX4_1_17, is_bare=True, manages_gimbal=False)
"""As its simulations `gz_x500` and `sihsim_quadx` are: nothing hangs below it."""
PX4_BARE_1_14: Final = replace(
    PX4_1_14, is_bare=True, manages_gimbal=False, refuses_for_others=True
)

COPTER_4_6: Final = Script(
    autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    gives_ids=False,
    home_is_item_0=True,
    float_requests=True,
    keeps=as_ardupilot_keeps,
    is_atomic=False,
    shows_legs_only=True,
    streams_unasked=False,
    counts_home=False,
    arms_in=COPTER_MODES_TO_ARM_IN,
    arming_refusal=mavlink.MAV_RESULT_FAILED,
    arming_complaint="Arm: AUTO mode not armable",
    wants_takeoff_first=True,
    results={mavlink.MAV_CMD_DO_ORBIT: mavlink.MAV_RESULT_UNSUPPORTED},
    disarms_after_s=0.5,
    heartbeats_at_once=False,
    begins_anew_when_disarmed=True,
    stops_elsewhere=True,
    reset_resumes=True,
    flies_without_items=False,
    settings={"MIS_RESTART": 0.0},
)
COPTER_4_1: Final = replace(
    COPTER_4_6,
    unknown_items=_NO_CAMERAS | {195, 197, 1000, 1001},
    results={**COPTER_4_6.results, **dict.fromkeys(_NO_CAMERAS, mavlink.MAV_RESULT_UNSUPPORTED)},
    sends_mission_state=False,
    reset_resumes=False,
)
"""Before missions knew gimbals, cameras and films, but for a shutter."""
ROVER: Final = replace(
    COPTER_4_6,
    vehicle_type=mavlink.MAV_TYPE_GROUND_ROVER,
    arms_in=None,
    wants_takeoff_first=False,
    begins_anew_when_disarmed=False,
    disarms_after_s=math.inf,
    sends_landed_state=False,
)
COPTER_3_6: Final = replace(COPTER_4_1, knows_intervals=False)
"""Before SET_MESSAGE_INTERVAL: streams by groups."""
