"""Builders of messages about mission, setpoints, orbit, fence and wind."""

import math
from typing import Final

from uav_firmware.lib.geo import LocalFrame
from uav_firmware.lib.vector import subtract
from uav_firmware.modules.mavlink.telemetry.context import (
    NAN,
    UINT16_MAX,
    Context,
    boot_ms,
    degrees_e7,
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

    A new mission is "not started" until the navigator has loaded it.
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
        last = len(mission.items) - 1  # A completed mission stays at its last item
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
    """NAV_CONTROLLER_OUTPUT: bearing and distance of the waypoint or setpoint; height error.

    Distance and height error are 0 without a position or height setpoint. `nav_bearing` and
    `alt_error` are those of the setpoint. The rest is NaN.
    """
    target = context.topics.trajectory_setpoint.value
    local = context.topics.vehicle_local_position.value
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
    """ORBIT_EXECUTION_STATUS of the orbit being flown; None without one."""
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
    """FENCE_STATUS; None until the navigator has checked the fence."""
    status = context.topics.geofence_status.value
    if status is None:
        return None
    return mavlink.MAVLink_fence_status_message(
        breach_status=int(status.breach is not FenceBreach.NONE),
        breach_count=min(status.breach_count, UINT16_MAX),
        breach_type=int(status.breach),
        breach_time=boot_ms(status.breach_time_us),
    )


def _unset_bits(values: tuple[float, ...], first_bit: int) -> int:
    """POSITION_TARGET_TYPEMASK bits of the values that are not set."""
    return sum(1 << first_bit + i for i, value in enumerate(values) if math.isnan(value))


def _zero_if_unset(value: float) -> float:
    return 0.0 if math.isnan(value) else value


def position_target_local_ned(context: Context) -> Message | None:
    """POSITION_TARGET_LOCAL_NED: the trajectory setpoint; the mask marks unset values."""
    target = context.topics.trajectory_setpoint.value
    if target is None:
        return None
    numbers = (*target.position_ned, *target.velocity_ned, *target.acceleration_ned)
    mask = _unset_bits(numbers, 0) | _unset_bits((target.yaw, target.yaw_rate), 10)
    x, y, z, vx, vy, vz, afx, afy, afz = (_zero_if_unset(number) for number in numbers)
    return mavlink.MAVLink_position_target_local_ned_message(
        time_boot_ms=boot_ms(target.time_us),
        coordinate_frame=mavlink.MAV_FRAME_LOCAL_NED,
        type_mask=mask,
        x=x,
        y=y,
        z=z,
        vx=vx,
        vy=vy,
        vz=vz,
        afx=afx,
        afy=afy,
        afz=afz,
        yaw=_zero_if_unset(target.yaw),
        yaw_rate=_zero_if_unset(target.yaw_rate),
    )


def position_target_global_int(context: Context) -> Message | None:
    """POSITION_TARGET_GLOBAL_INT: the same setpoint in global coordinates."""
    target, local = (
        context.topics.trajectory_setpoint.value,
        context.topics.vehicle_local_position.value,
    )
    if target is None or local is None:
        return None
    origin = local.origin
    if not all(map(math.isfinite, origin)):
        return None
    numbers = (*target.position_ned, *target.velocity_ned, *target.acceleration_ned)
    mask = _unset_bits(numbers, 0) | _unset_bits((target.yaw, target.yaw_rate), 10)
    north, east, down, vx, vy, vz, afx, afy, afz = map(_zero_if_unset, numbers)
    latitude, longitude, altitude = LocalFrame(*origin).to_geodetic((north, east, down))
    return mavlink.MAVLink_position_target_global_int_message(
        time_boot_ms=boot_ms(target.time_us),
        coordinate_frame=mavlink.MAV_FRAME_GLOBAL_INT,
        type_mask=mask,
        lat_int=degrees_e7(latitude),
        lon_int=degrees_e7(longitude),
        alt=altitude,
        vx=vx,
        vy=vy,
        vz=vz,
        afx=afx,
        afy=afy,
        afz=afz,
        yaw=_zero_if_unset(target.yaw),
        yaw_rate=_zero_if_unset(target.yaw_rate),
    )


def attitude_target(context: Context) -> Message | None:
    """ATTITUDE_TARGET: the newest attitude and rate setpoints.

    In acro mode and with streamed rates the attitude is outdated, and masked out.
    """
    attitude, rates = (
        context.topics.vehicle_attitude_setpoint.value,
        context.topics.vehicle_rates_setpoint.value,
    )
    if rates is None:
        return None
    is_recent = attitude is not None and rates.time_us - attitude.time_us < 1_000_000
    roll, pitch, yaw = rates.rate_frd
    return mavlink.MAVLink_attitude_target_message(
        time_boot_ms=boot_ms(rates.time_us),
        type_mask=0 if is_recent else mavlink.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE,
        q=list(attitude.q_ned_frd) if attitude is not None else [1.0, 0.0, 0.0, 0.0],
        body_roll_rate=roll,
        body_pitch_rate=pitch,
        body_yaw_rate=yaw,
        thrust=rates.thrust,
    )


def wind_cov(context: Context) -> Message | None:
    """WIND_COV: the wind estimated from the tilt, with its accuracy."""
    wind, local = context.topics.wind.value, context.topics.vehicle_local_position.value
    if wind is None:
        return None
    north, east = wind.velocity_north_m_s, wind.velocity_east_m_s
    return mavlink.MAVLink_wind_cov_message(
        time_usec=wind.time_us,
        wind_x=north,
        wind_y=east,
        wind_z=0.0,
        var_horiz=wind.accuracy_m_s**2,
        var_vert=NAN,
        wind_alt=NAN if local is None else local.origin_altitude_amsl_m - local.position_ned[2],
        horiz_accuracy=wind.accuracy_m_s,
        vert_accuracy=NAN,
    )
