"""Missions as the navigator flies them, and the messages between commander and navigator."""

import math
from collections.abc import Generator
from enum import IntEnum
from typing import NamedTuple, TypeAlias

from uav_firmware.msg.guidance import (
    FollowOrder,
    HeadingRequest,
    OrbitTarget,
    RegionOfInterest,
)
from uav_firmware.msg.status import NavigationState


class MissionCommand(IntEnum):
    """MAVLink's MAV_CMD of the items that the navigator flies."""

    NAV_WAYPOINT = 16
    NAV_LOITER_UNLIM = 17
    NAV_LOITER_TURNS = 18
    NAV_LOITER_TIME = 19
    NAV_RETURN_TO_LAUNCH = 20
    NAV_LAND = 21
    NAV_TAKEOFF = 22
    NAV_LOITER_TO_ALT = 31
    NAV_SPLINE_WAYPOINT = 82
    NAV_DELAY = 93
    CONDITION_DELAY = 112
    CONDITION_DISTANCE = 114
    CONDITION_YAW = 115
    DO_JUMP = 177
    DO_CHANGE_SPEED = 178
    DO_SET_HOME = 179
    DO_LAND_START = 189
    DO_SET_ROI_LOCATION = 195
    DO_SET_ROI_NONE = 197
    DO_SET_ROI = 201
    DO_DIGICAM_CONTROL = 203
    DO_MOUNT_CONFIGURE = 204
    DO_MOUNT_CONTROL = 205
    DO_SET_CAM_TRIGG_DIST = 206
    DO_FENCE_ENABLE = 207
    SET_CAMERA_MODE = 530
    DO_GIMBAL_MANAGER_PITCHYAW = 1000
    DO_GIMBAL_MANAGER_CONFIGURE = 1001
    IMAGE_START_CAPTURE = 2000
    IMAGE_STOP_CAPTURE = 2001
    VIDEO_START_CAPTURE = 2500
    VIDEO_STOP_CAPTURE = 2501


class MissionResult(IntEnum):
    """MAVLink's MAV_MISSION_RESULT, as far as a check of the items gives it."""

    UNSUPPORTED_FRAME = 2
    UNSUPPORTED = 3
    INVALID = 5
    INVALID_PARAM1 = 6
    INVALID_PARAM2 = 7
    INVALID_PARAM3 = 8
    INVALID_PARAM4 = 9
    INVALID_PARAM5_X = 10
    INVALID_PARAM6_Y = 11
    INVALID_PARAM7 = 12
    INVALID_SEQUENCE = 13


class MissionState(IntEnum):
    """MAVLink's MISSION_STATE."""

    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


class MissionItem(NamedTuple):
    """One item in degrees and metres, with MAVLink's numbers for command and frame.

    Positional parameters hold NaN where the uploader left them unset.
    """

    seq: int  # [-] From 0, contiguous
    command: int  # [-] MAV_CMD
    frame: int  # [-] MAV_FRAME, one of 0 AMSL, 3 relative to home, 2 no position
    current: bool
    autocontinue: bool
    param1: float
    param2: float
    param3: float
    param4: float
    x: float  # [deg] Latitude in a global frame, else parameter 5
    y: float  # [deg] Longitude in a global frame, else parameter 6
    z: float  # [m] Altitude by frame, else parameter 7


class Mission(NamedTuple):
    """A complete, accepted mission; replaces the former one at once."""

    time_us: int  # [us] Of acceptance
    mission_id: int  # [-] CRC32 over the items, MAVLink opaque id; 0 when empty
    items: tuple[MissionItem, ...]


class MissionRejection(NamedTuple):
    """Why a mission cannot be flown: becomes MISSION_ACK and STATUSTEXT."""

    seq: int  # [-] Of the faulty item
    result: int  # [-] MAV_MISSION_RESULT
    reason: str


def about_item(seq: int, reason: str) -> str:
    """A reason that names its item, once: those of the mission's rules name it already."""
    name = f"item {seq}"
    return reason if reason.startswith((f"{name}:", f"{name} ")) else f"{name}: {reason}"


PlanReview: TypeAlias = Generator[int, None, MissionRejection | None]
"""A check in steps: yields the work done since the last one, in units of some 5 us."""


class PlanType(IntEnum):
    """MAVLink's MAV_MISSION_TYPE."""

    MISSION = 0
    FENCE = 1
    RALLY_POINTS = 2


class PlanCheckRequest(NamedTuple):
    """Whether an uploaded plan can be flown. Written by mavlink; read by navigator.

    A newer request for the same type replaces one that has not been answered.
    """

    request_id: int  # [-] Repeated in the result
    plan_type: PlanType
    items: tuple[MissionItem, ...]


class PlanCheckResult(NamedTuple):
    """Answer to a PlanCheckRequest. Written by navigator; read by mavlink."""

    request_id: int  # [-] Of the request
    plan_type: PlanType
    rejection: MissionRejection | None  # None: it can be flown


class MissionProgress(NamedTuple):
    """Where the mission is. Written by navigator on change; read by mavlink, commander."""

    time_us: int  # [us]
    mission_id: int  # [-] Of the mission meant
    seq_current: int  # [-] Item being flown or next to fly
    seq_total: int  # [-] Number of items
    seq_reached: int  # [-] Last item reached, -1 for none
    reached_count: int  # [-] Grows at each item reached
    state: int  # [-] MISSION_STATE: 1 none, 2 not started, 3 active, 4 paused, 5 complete
    mission_time_us: int = 0  # [us] When the mission meant was accepted
    selection_count: int = 0  # [-] Grows at each order of which item to fly next
    latest_reached: tuple[int, ...] = ()  # [-] The last items reached, newest last

    def is_of(self, mission: Mission) -> bool:
        """Whether the navigator has taken this very mission over, not an equal former one."""
        return (self.mission_id, self.mission_time_us) == (mission.mission_id, mission.time_us)


class NavigatorTarget(NamedTuple):
    """Where a commanded mode shall fly. Written by commander just before it changes the mode.

    NaN keeps the present value. A target whose mode is not entered next is forgotten.
    """

    time_us: int  # [us]
    navigation_state: NavigationState  # Mode that the target belongs to
    latitude_deg: float  # [deg] NaN: present position
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m] NaN: present altitude, or the mode's own
    yaw: float  # [rad] NaN: keep
    speed_m_s: float  # [m/s] Horizontal; NaN: cruise speed
    abort_height_m: float = math.nan  # [m] Above a landing point, to climb back to; NaN: none


class SpeedRequest(NamedTuple):
    """A change of speed until the next mode or mission. Written by commander."""

    time_us: int  # [us]
    speed_type: int  # [-] MAVLink SPEED_TYPE: 1 ground, 2 climb, 3 descent
    speed_m_s: float  # [m/s] NaN: back to the parameter's value


class MissionCurrentRequest(NamedTuple):
    """Which item to fly next. Written by commander."""

    time_us: int  # [us]
    seq: int  # [-] -1 keeps the current item
    reset: bool  # Clear completion and jump counters


class FenceSwitch(NamedTuple):
    """Whether the geofence is held to, until the vehicle is disarmed. Written by commander."""

    time_us: int  # [us]
    enabled: bool


class ReturnOrder(NamedTuple):
    """A return in too strong a wind, which stays low. Written by commander with a failsafe."""

    time_us: int  # [us]
    navigation_state: NavigationState  # Mode that the order belongs to: AUTO_RTL


ModeTarget: TypeAlias = NavigatorTarget | OrbitTarget | FollowOrder | ReturnOrder
"""An order that belongs to one mode and comes just before it."""


class TargetCheckRequest(NamedTuple):
    """Whether the geofence allows a target. Written by commander; read by navigator.

    The navigator answers in the same step.
    """

    request_id: int  # [-] Repeated in the result
    target: ModeTarget


class TargetCheckResult(NamedTuple):
    """Answer to a TargetCheckRequest. Written by navigator; read by commander."""

    request_id: int  # [-] Of the request
    refusal: str  # Why the geofence forbids the target; empty when it allows it


NavigatorRequest: TypeAlias = (
    ModeTarget
    | SpeedRequest
    | MissionCurrentRequest
    | RegionOfInterest
    | HeadingRequest
    | FenceSwitch
)
"""What the navigator's request queue carries."""


class NavigatorStatus(NamedTuple):
    """What the navigator makes of its orders. Written by navigator on change; read by commander."""

    time_us: int  # [us]
    navigation_state: NavigationState  # Mode that the navigator flies
    finished: bool  # That mode has done its work and now holds, or sits on the ground
    mission_rejection: MissionRejection | None  # Why the stored mission cannot be flown now
