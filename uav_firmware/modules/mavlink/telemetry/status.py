"""Builders of messages about the vehicle's status: HEARTBEAT, battery, estimator, mode."""

import math
from typing import Final

from uav_firmware.modules.mavlink.commands.modes import MODES
from uav_firmware.modules.mavlink.telemetry.context import (
    INT16_MAX,
    NAN,
    UINT16_MAX,
    BatteryThresholds,
    Context,
    boot_ms,
    int8,
    int16,
    int32,
    uint16,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.status import NavigationState, VehicleStatus

_PREARM_CHECK: Final = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_CELLS_UNKNOWN: Final = [UINT16_MAX] * 9
_UNKNOWN_BATTERY: Final = BatteryStatus(0, NAN, NAN, NAN, NAN, NAN)
_BATTERY: Final = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY


def _system_status(status: VehicleStatus) -> int:
    """MAV_STATE: critical during a failsafe, else by arming."""
    if status.navigation_state is NavigationState.TERMINATION:
        return int(mavlink.MAV_STATE_FLIGHT_TERMINATION)
    if status.failsafe:
        return int(mavlink.MAV_STATE_CRITICAL)
    return int(mavlink.MAV_STATE_ACTIVE if status.armed else mavlink.MAV_STATE_STANDBY)


def heartbeat(context: Context) -> Message:
    """HEARTBEAT; state BOOT until the commander has published a status."""
    status = context.topics.vehicle_status.value
    base_mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    custom_mode, system_status = 0, mavlink.MAV_STATE_BOOT
    if status is not None:
        mode = MODES[status.navigation_state]
        base_mode |= mode.base_flags
        base_mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if status.armed else 0
        custom_mode, system_status = mode.custom_mode, _system_status(status)
    return mavlink.MAVLink_heartbeat_message(
        type=mavlink.MAV_TYPE_QUADROTOR,
        autopilot=mavlink.MAV_AUTOPILOT_PX4,
        base_mode=base_mode,
        custom_mode=custom_mode,
        system_status=system_status,
        mavlink_version=3,
    )


def flight_information(context: Context) -> Message | None:
    """FLIGHT_INFORMATION: times of this flight since boot, as in PX4; 0 when disarmed.

    The id of a flight is the UTC time of its arming.
    """
    status = context.topics.vehicle_status.value
    if status is None:
        return None
    armed_us = status.armed_since_us
    return mavlink.MAVLink_flight_information_message(
        time_boot_ms=boot_ms(context.now_us),
        arming_time_utc=armed_us,
        takeoff_time_utc=status.airborne_since_us,
        flight_uuid=context.boot_time_utc_us + armed_us if armed_us else 0,
    )


def sys_status(context: Context) -> Message | None:
    """SYS_STATUS; PREARM_CHECK is healthy when the preflight checks pass."""
    status = context.topics.vehicle_status.value
    if status is None:
        return None
    battery = _measured_battery(context)
    ready = _PREARM_CHECK if status.preflight_checks_pass else 0
    return mavlink.MAVLink_sys_status_message(
        onboard_control_sensors_present=status.sensors_present | _PREARM_CHECK,
        onboard_control_sensors_enabled=status.sensors_enabled | _PREARM_CHECK,
        onboard_control_sensors_health=(status.sensors_health & ~_PREARM_CHECK) | ready,
        load=0,
        voltage_battery=UINT16_MAX if battery is None else uint16(battery.voltage_v * 1e3),
        current_battery=-1 if battery is None else int16(battery.current_a * 1e2, unknown=-1),
        battery_remaining=-1 if battery is None else int8(battery.remaining * 1e2, unknown=-1),
        drop_rate_comm=0,
        errors_comm=0,
        errors_count1=0,
        errors_count2=0,
        errors_count3=0,
        errors_count4=0,
    )


def system_time(context: Context) -> Message:
    """SYSTEM_TIME: UTC and time since boot, both of the vehicle's clock."""
    known = context.boot_time_utc_us > 0
    return mavlink.MAVLink_system_time_message(
        time_unix_usec=context.boot_time_utc_us + context.now_us if known else 0,
        time_boot_ms=boot_ms(context.now_us),
    )


def extended_sys_state(context: Context) -> Message | None:
    """EXTENDED_SYS_STATE: on the ground, in the air, taking off or landing."""
    landed = context.topics.land_detected.value
    if landed is None:
        return None
    return mavlink.MAVLink_extended_sys_state_message(
        vtol_state=mavlink.MAV_VTOL_STATE_UNDEFINED, landed_state=int(landed.landed_state)
    )


def charge_state(remaining: float, thresholds: BatteryThresholds) -> int:
    """MAV_BATTERY_CHARGE_STATE of a remaining charge of 0 to 1; NaN is unknown."""
    if math.isnan(remaining):
        return int(mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED)
    if remaining <= thresholds.emergency:
        return int(mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY)
    if remaining <= thresholds.critical:
        return int(mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL)
    if remaining <= thresholds.low:
        return int(mavlink.MAV_BATTERY_CHARGE_STATE_LOW)
    return int(mavlink.MAV_BATTERY_CHARGE_STATE_OK)


def _time_remaining_s(battery: BatteryStatus) -> int:
    """Time until empty at the present current [s]; 0 when unknown."""
    if not battery.current_a > 0.1:
        return 0
    return int32(battery.remaining * battery.capacity_ah / battery.current_a * 3600.0)


def battery_status(context: Context) -> Message | None:
    """BATTERY_STATUS of the one pack; cell voltages are not measured.

    What nothing measures any more is unknown: an old charge would be taken for the present one.
    """
    if context.topics.battery_status.value is None:
        return None
    battery = _measured_battery(context) or _UNKNOWN_BATTERY
    return mavlink.MAVLink_battery_status_message(
        id=0,
        battery_function=mavlink.MAV_BATTERY_FUNCTION_ALL,
        type=mavlink.MAV_BATTERY_TYPE_LIPO,
        temperature=INT16_MAX,
        voltages=[uint16(battery.voltage_v * 1e3), *_CELLS_UNKNOWN],
        current_battery=int16(battery.current_a * 1e2, unknown=-1),
        current_consumed=int32(battery.consumed_ah * 1e3, unknown=-1),
        energy_consumed=-1,
        battery_remaining=int8(battery.remaining * 1e2, unknown=-1),
        time_remaining=_time_remaining_s(battery),
        charge_state=charge_state(battery.remaining, context.battery_thresholds),
    )


def _measured_battery(context: Context) -> BatteryStatus | None:
    """The newest state of the battery; None while the commander finds that nothing measures it."""
    status = context.topics.vehicle_status.value
    if status is not None and status.sensors_present & ~status.sensors_health & _BATTERY:
        return None
    return context.topics.battery_status.value


def estimator_status(context: Context) -> Message | None:
    """ESTIMATOR_STATUS; height above ground and airspeed are not estimated."""
    status = context.topics.estimator_status.value
    if status is None:
        return None
    return mavlink.MAVLink_estimator_status_message(
        time_usec=status.time_us,
        flags=status.flags,
        vel_ratio=status.velocity_ratio,
        pos_horiz_ratio=status.horizontal_position_ratio,
        pos_vert_ratio=status.vertical_position_ratio,
        mag_ratio=status.mag_ratio,
        hagl_ratio=NAN,
        tas_ratio=NAN,
        pos_horiz_accuracy=status.horizontal_accuracy_m,
        pos_vert_accuracy=status.vertical_accuracy_m,
    )


def current_mode(context: Context) -> Message | None:
    """CURRENT_MODE; the intended mode is the current one."""
    status = context.topics.vehicle_status.value
    if status is None:
        return None
    mode = MODES[status.navigation_state]
    return mavlink.MAVLink_current_mode_message(
        standard_mode=mode.standard,
        custom_mode=mode.custom_mode,
        intended_custom_mode=mode.custom_mode,
    )


def available_modes_monitor(_context: Context) -> Message:
    """AVAILABLE_MODES_MONITOR: the list of modes never changes."""
    return mavlink.MAVLink_available_modes_monitor_message(seq=0)
