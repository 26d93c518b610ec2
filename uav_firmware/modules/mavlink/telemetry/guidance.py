"""Where the vehicle wants to be: mission, orbit, fence."""

import math
from typing import Final

from uav_firmware.lib.vector import subtract
from uav_firmware.modules.mavlink.telemetry.context import Context
from uav_firmware.modules.mavlink.telemetry.conversion import (
    NAN,
    UINT16_MAX,
    boot_ms,
    int16,
    uint16,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.dialect_extensions import MissionCurrent
from uav_firmware.msg.geofence import FenceBreach
from uav_firmware.msg.status import NavigationState

_MISSION_MODE_ACTIVE: Final = 1
_MISSION_MODE_SUSPENDED: Final = 2


def mission_current(context: Context) -> Message:
    """MISSION_CURRENT with state, mode and the ids of all plans.

    Until the navigator has taken a new mission over, that mission is "not started".
    """
    mission = context.topics.mission.value
    fence, rally_points = context.topics.fence.value, context.topics.rally_points.value
    ids = {
        "fence_id": 0 if fence is None else fence.fence_id,
        "rally_points_id": 0 if rally_points is None else rally_points.rally_id,
    }
    if mission is None or not mission.items:
        none = mavlink.MISSION_STATE_NO_MISSION
        return MissionCurrent(seq=0, total=UINT16_MAX, mission_state=none, **ids)
    progress = context.topics.mission_progress.value
    status = context.topics.vehicle_status.value
    flown = status is not None and status.navigation_state is NavigationState.AUTO_MISSION
    seq, state = 0, mavlink.MISSION_STATE_NOT_STARTED
    if progress is not None and progress.is_of(mission):
        last = len(mission.items) - 1  # Where a complete mission stays
        seq, state = min(max(progress.seq_current, 0), last), progress.state
    return MissionCurrent(
        seq=seq,
        total=len(mission.items),
        mission_state=state,
        mission_mode=_MISSION_MODE_ACTIVE if flown else _MISSION_MODE_SUSPENDED,
        mission_id=mission.mission_id,
        **ids,
    )


def nav_controller_output(context: Context) -> Message | None:
    """NAV_CONTROLLER_OUTPUT: bearing and distance of the waypoint or set-point; height error.

    Where no place or height is asked for there is no error: distance and height are 0.
    `nav_bearing` and `alt_error` are those of the set-point. The rest is NaN.
    """
    target = context.topics.trajectory_setpoint.value
    local = context.topics.local_position.value
    if target is None or local is None:
        return None
    north, east, down = subtract(target.position_ned, local.position_ned)
    goal = target.position_ned if math.isnan(target.goal_ned[0]) else target.goal_ned
    ahead_north, ahead_east, _ = subtract(goal, local.position_ned)
    return mavlink.MAVLink_nav_controller_output_message(
        nav_roll=NAN,
        nav_pitch=NAN,
        nav_bearing=int16(math.degrees(math.atan2(east, north))),
        target_bearing=int16(math.degrees(math.atan2(ahead_east, ahead_north))),
        wp_dist=uint16(math.hypot(ahead_north, ahead_east), unknown=0),
        alt_error=0.0 if math.isnan(down) else -down,
        aspd_error=NAN,
        xtrack_error=NAN,
    )


def orbit_execution_status(context: Context) -> Message | None:
    """ORBIT_EXECUTION_STATUS of the circle being flown; None when there is none."""
    orbit = context.topics.orbit_status.value
    if orbit is None or not orbit.active or math.isnan(orbit.latitude_deg):
        return None
    return mavlink.MAVLink_orbit_execution_status_message(
        time_usec=orbit.time_us,
        radius=orbit.radius_m,
        frame=mavlink.MAV_FRAME_GLOBAL,
        x=round(orbit.latitude_deg * 1e7),
        y=round(orbit.longitude_deg * 1e7),
        z=orbit.altitude_amsl_m,
    )


def fence_status(context: Context) -> Message | None:
    """FENCE_STATUS; None until the navigator has judged for the first time."""
    status = context.topics.geofence_status.value
    if status is None:
        return None
    return mavlink.MAVLink_fence_status_message(
        breach_status=int(status.breach is not FenceBreach.NONE),
        breach_count=min(status.breach_count, UINT16_MAX),
        breach_type=int(status.breach),
        breach_time=boot_ms(status.breach_time_us),
    )
