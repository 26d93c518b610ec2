"""How a scripted vehicle behaves: PX4-like or ArduPilot-like, and what it does otherwise."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from tests.support.stored_items import Keeping
from tests.support.vehicle_wire import mavlink

HOME = (40.44340, -3.73820, 650.0)
"""Latitude, longitude [deg], altitude above mean sea level [m]."""
PX4_HOLD = 4 << 16 | 3 << 24
PX4_MISSION = 4 << 16 | 4 << 24
PX4_RETURN = 4 << 16 | 5 << 24
PX4_LAND = 4 << 16 | 6 << 24
PX4_POSITION = 3 << 16
PX4_STABILIZED = 7 << 16
PX4_ORBIT = 3 << 16 | 1 << 24
PX4_FOLLOW = 4 << 16 | 8 << 24
COPTER_STABILIZE = 0
COPTER_AUTO = 3
COPTER_GUIDED = 4
COPTER_LOITER = 5
COPTER_RETURN = 6
COPTER_LAND = 9
COPTER_BRAKE = 17
COPTER_FOLLOW = 23
"""HEARTBEAT.custom_mode."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Script:
    """How this vehicle differs from a well-behaved one."""

    autopilot: int = mavlink.MAV_AUTOPILOT_PX4
    vehicle_type: int = mavlink.MAV_TYPE_QUADROTOR
    gives_ids: bool = True
    home_is_item_0: bool = False
    float_requests: bool = False
    forgets_parameters: bool = False  # Keeps of a waypoint nothing but its hold time
    lost_acknowledgements: int = 0  # The first so many final MISSION_ACK are not sent
    busy_for_s: float = 0.0  # Answers MISSION_COUNT with MISSION_ERROR
    refused_item: int | None = None  # Answered by INVALID_PARAM3
    unknown_items: frozenset[int] = frozenset()  # Commands answered by UNSUPPORTED
    corrupts_item: int | None = None  # Stored at another altitude
    results: Mapping[int, int] = field(default_factory=dict)  # MAV_RESULT per command
    ready_to_arm_after_s: float = 0.0
    complaint: str = ""  # STATUSTEXT that goes with a refusal
    item_time_s: float = 2.0
    landing_s: float = 8.0  # From the order to land or to return, to the ground
    sends_item_reached: bool = True
    has_home: bool = True
    has_timesync: bool = True  # It answers TIMESYNC
    battery_capacity_mah: float | None = 4200.0
    settings: Mapping[str, float] = field(default_factory=dict)  # Parameters that can be set
    ignores_start: bool = False
    keeps: Keeping | None = None  # What becomes of an item in its storage
    is_atomic: bool = True  # Else items are overwritten as they come
    shows_legs_only: bool = False  # MISSION_CURRENT counts only what is navigated to
    mission_every_s: float = 0.2
    sends_current_on_request: bool = True
    sends_mission_state: bool = True
    counts_home: bool = True  # In MISSION_CURRENT.total
    no_mission_total: int = 0
    sends_total: bool = True
    loses_current: bool = False  # After an upload it sends 65535 until one is set
    version: int = 0  # AUTOPILOT_VERSION.flight_sw_version
    has_checks: bool = True  # Else SYS_STATUS reports the checks as passed, but not as present
    most_items: float = math.inf  # Of a mission; more are answered by NO_SPACE
    goes_to_places: bool = True  # Else it never arrives where it was sent
    speed_m_s: float = 10.0  # Over ground, while it flies to a position
    circle_after_s: float = 0.0  # How long it takes to get to a circle, by its centre
    climb_rate_m_s: float = 3.0
    fence_m: float = math.inf  # From home; what leads out is accepted, and not done
    streams_unasked: bool = True
    knows_intervals: bool = True
    is_infeasible: bool = False  # Found after the upload was accepted
    arms_in: frozenset[int] | None = None  # Custom modes; None: in any
    arming_refusal: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    arming_complaint: str = ""
    fault: str = ""  # STATUSTEXT when prearm checks are requested and it is not ready
    link_loss_action: int | None = 0  # NAV_DLL_ACT: above 0 it flies only attended by a station
    needs_station_for_texts: bool = False  # STATUSTEXT only while a GCS sends heartbeats
    readiness_by_mode: bool = False  # "Ready to arm" means: in the mode that it is in
    navigates_after_s: float = 0.0  # Refuses until then the modes that want a position
    checks_are_off: bool = False  # There, but not enabled, and never well
    wants_takeoff_first: bool = False  # Refuses to begin on the ground with anything else
    in_progress: frozenset[int] = frozenset()  # Commands that it works on for 2 s first
    disarms_after_s: float = 0.0  # Once it stands
    disarms_unstarted_s: float = math.inf  # Armed, and not taken off
    sends_landed_state: bool = True
    heartbeats_at_once: bool = True  # Else a change shows with the next one, a second at most
    begins_anew_when_disarmed: bool = False  # It stays in the mission mode, at its first item
    current_goes_to_0_at_the_end: bool = False
    return_changes_mode: bool = False  # The item of a return is done by leaving the mission
    stops_elsewhere: bool = False  # Out of its mission mode a mission counts as not started
    reset_resumes: bool = False  # To set the current item with a reset begins the mission at once
    flies_without_items: bool = True  # Else it refuses its mission mode while it holds no mission
    product: tuple[int, int] = (0, 0)  # Vendor and product in AUTOPILOT_VERSION
    accepts_modes_early: bool = False  # It accepts every mode first, and judges it afterwards
    repeats_pictures: bool = False  # A mission with pictures is resumed at the place before
    manages_gimbal: bool = False  # As PX4 does: only who is in control points it
    is_bare: bool = False  # No camera and no gimbal, and answers as PX4 for them
    refuses_for_others: bool = False  # Bare, it answers for components that are not there: FAILED

    @property
    def is_px4(self) -> bool:
        """Whether it behaves as PX4."""
        return bool(self.autopilot == mavlink.MAV_AUTOPILOT_PX4)

    @property
    def is_copter(self) -> bool:
        """Whether it behaves as ArduCopter."""
        return bool(self.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)

    @property
    def mission_mode(self) -> int:
        """The mode that flies the mission."""
        return COPTER_AUTO if self.is_copter else PX4_MISSION


PX4 = Script(
    settings={
        "FLW_TGT_ALT_M": 2.0,
        "FLW_TGT_HT": 12.0,
        "FLW_TGT_DST": 5.0,
        "FLW_TGT_FA": 0.0,
        "FLW_TGT_MAX_VEL": 5.0,
        "COM_OF_LOSS_T": 1.0,
    }
)
ARDUPILOT = Script(
    autopilot=mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
    gives_ids=False,
    home_is_item_0=True,
    float_requests=True,
    forgets_parameters=True,
    stops_elsewhere=True,
    settings={
        "MIS_RESTART": 0.0,
        "CIRCLE_RATE": 20.0,
        "CIRCLE_OPTIONS": 1.0,
        "WPNAV_RADIUS": 200.0,
        "FOLL_ENABLE": 0.0,
        "FOLL_SYSID": 0.0,
        "FOLL_DIST_MAX": 100.0,
        "FOLL_OFS_TYPE": 1.0,
        "FOLL_OFS_X": 0.0,
        "FOLL_OFS_Y": 5.0,
        "FOLL_OFS_Z": 1.0,
        "FOLL_YAW_BEHAVE": 0.0,
        "FOLL_ALT_TYPE": 1.0,
    },
)
