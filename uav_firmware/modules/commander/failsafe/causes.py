"""Causes of failsafes: one table of conditions, delays and actions.

A cause is present once its condition has held for its delay, and clears when the condition
does not hold any more, or has not held for a time; a condition may be stricter about clearing
(hysteresis). Pure.
"""

import math
from collections.abc import Callable, Mapping
from enum import Enum, auto
from typing import Final, NamedTuple

from uav_firmware.modules.commander import mode_requirements
from uav_firmware.modules.commander.failsafe.params import FailsafeParams
from uav_firmware.modules.commander.failsafe.return_time import (
    ReturnSpeeds,
    battery_time_s,
    return_time_s,
)
from uav_firmware.modules.commander.failsafe_actions import (
    FENCE_ACTIONS,
    LINK_ACTIONS,
    MOTOR_ACTIONS,
    OFFBOARD_ACTIONS,
    PILOTED,
    Action,
)
from uav_firmware.modules.commander.health_checks import (
    SENSOR_STALE_S,
    storage_full,
    without_fix,
)
from uav_firmware.modules.commander.mode_requirements import Need
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.estimate import AidSource
from uav_firmware.msg.geofence import FenceBreach
from uav_firmware.msg.status import NavigationState

_BATTERY_UNKNOWN_S: Final = 3.0  # A monitor that is restarted sends again within that
_BATTERY_HYSTERESIS: Final = 0.02  # Of a full battery, against a voltage that sags
_TIME_HYSTERESIS: Final = 1.3  # Of the time needed, against a current that falls
_CURRENT_SETTLES_S: Final = 3.0  # [s] A climb or gust draws more current for a moment
_WIND_HYSTERESIS: Final = 0.85  # Of the threshold, below which the cause clears
BREAKER_FLIGHTTERM: Final = 121212
"""Value of CBRK_FLIGHTTERM that keeps a lost attitude from terminating the flight."""

_JUMP_REPORTED_US: Final = 10_000_000  # After that a bias, or heading, is known as before
_EXCEPT_BITS: Final[Mapping[NavigationState, int]] = {
    NavigationState.AUTO_MISSION: 1,
    NavigationState.AUTO_LOITER: 2,
    NavigationState.OFFBOARD: 4,
}


class Cause(Enum):
    """Cause of a failsafe."""

    LINK_LOST = auto()
    STICKS_LOST = auto()
    OFFBOARD_LOST = auto()
    BATTERY_LOW = auto()
    BATTERY_CRITICAL = auto()
    BATTERY_EMERGENCY = auto()
    BATTERY_UNKNOWN = auto()
    GPS_LOST = auto()
    GPS_POSITION_STOPPED = auto()
    GPS_VELOCITY_STOPPED = auto()
    GPS_HEIGHT_STOPPED = auto()
    COMPASS_LOST = auto()
    COMPASS_WRONG = auto()
    BAROMETER_LOST = auto()
    BAROMETER_STOPPED = auto()
    POSITION_LOST = auto()
    ALTITUDE_LOST = auto()
    ATTITUDE_LOST = auto()
    ATTITUDE_EXCEEDED = auto()
    GYRO_JUMPED = auto()
    GYRO_BROKEN = auto()
    ACCEL_BROKEN = auto()
    GYRO_LOST = auto()
    ACCEL_LOST = auto()
    MOTOR_FAILED = auto()
    FENCE_BREACHED = auto()
    WIND_STRONG = auto()
    WIND_TOO_STRONG = auto()
    FLIGHT_TIME_OVER = auto()
    BATTERY_TIME_SHORT = auto()
    STORAGE_FULL = auto()


class Conditions(NamedTuple):
    """State by which the causes are evaluated."""

    view: VehicleView
    params: FailsafeParams
    intended: NavigationState  # The mode that the operator has chosen, whatever is flown now
    flown: NavigationState  # The mode that is flown now: of a failsafe, or the intended one
    airborne_s: float  # [s] Time in the air
    return_speeds: ReturnSpeeds = ReturnSpeeds()


class Row(NamedTuple):
    """One cause."""

    text: str  # Text for the operator
    holds: Callable[[Conditions, bool], bool]  # Second argument: whether it is present
    action: Callable[[Conditions], Action]
    delay_s: Callable[[FailsafeParams], float] = lambda _params: 0.0
    clears_s: Callable[[FailsafeParams], float] = lambda _params: 0.0  # Without the condition
    urgent: bool = False  # No time to wait for the operator
    latched: bool = False  # Forbids the next arming until it is acknowledged
    advice: str = ""  # What the operator can do about a hold, which the cause does not end


def _always(action: Action) -> Callable[[Conditions], Action]:
    return lambda _moment: action


def _relied_on(
    moment: Conditions,
    present: bool,  # noqa: FBT001  # one signature for all
    relies: Callable[[NavigationState], bool],
) -> bool:
    """Whether the mode that is flown, or the intended one, relies on what is lost.

    A cause that is present stays while a failsafe flies: the mode that the failsafe has chosen
    for this cause does not rely on it, and the cause would clear by its own action.
    """
    if moment.flown is moment.intended:
        return relies(moment.flown)
    return present or relies(moment.flown) or relies(moment.intended)


def _link_lost(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature for all
    params = moment.params
    silent = params.link_loss_s < moment.view.ages.link < math.inf  # Received at least once
    return params.link_loss_action > 0 and silent


def _sticks_lost(moment: Conditions, present: bool) -> bool:  # noqa: FBT001  # one signature for all
    params, view = moment.params, moment.view
    received = view.ages.sticks < math.inf
    if params.sticks_loss_action <= 0 or view.sticks_fresh or not received:
        return False
    return _relied_on(moment, present, lambda mode: _relies_on_sticks(mode, params))


def _relies_on_sticks(mode: NavigationState, params: FailsafeParams) -> bool:
    excepted = _EXCEPT_BITS.get(mode, 7)
    return mode in PILOTED or excepted & ~params.sticks_excepted & 7 == excepted


def _offboard_lost(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature
    late = moment.view.ages.offboard > moment.params.offboard_loss_s
    return moment.intended is NavigationState.OFFBOARD and late


def _battery_below(
    threshold: Callable[[FailsafeParams], float],
) -> Callable[[Conditions, bool], bool]:
    def holds(moment: Conditions, present: bool) -> bool:  # noqa: FBT001  # one signature for all
        battery = moment.view.battery
        margin = _BATTERY_HYSTERESIS if present else 0.0
        return battery is not None and battery.remaining < threshold(moment.params) + margin

    return holds


def _gps_lost(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature for all
    return without_fix(moment.view)


def _gps_loss_action(moment: Conditions) -> Action:
    """Brake at once, wait in hold for the fix, then land.

    A landing continues; during its transit it brakes and lands there (by the navigator).
    """
    mode = moment.flown
    if mode is NavigationState.AUTO_LAND:
        return Action.LAND
    needed = Need.POSITION in mode_requirements.needs_of(mode, moment.view)
    return Action.LAND if needed and mode not in PILOTED else Action.WARN


def _stopped(source: AidSource) -> Callable[[Conditions, bool], bool]:
    return lambda moment, _present: source in moment.view.stopped


def _needed(moment: Conditions, present: bool, need: Need) -> bool:  # noqa: FBT001  # as the rows
    needs_of, view = mode_requirements.needs_of, moment.view
    return _relied_on(moment, present, lambda mode: need in needs_of(mode, view))


def _position_lost(moment: Conditions, present: bool) -> bool:  # noqa: FBT001  # one signature
    estimate = moment.view.position
    known = estimate is not None and estimate.position_valid and estimate.velocity_valid
    return not known and _needed(moment, present, Need.POSITION)


def _altitude_lost(moment: Conditions, present: bool) -> bool:  # noqa: FBT001  # one signature
    estimate = moment.view.position
    known = estimate is not None and estimate.altitude_valid
    return not known and _needed(moment, present, Need.ALTITUDE)


def _wind_above(threshold: Callable[[FailsafeParams], float]) -> Callable[[Conditions, bool], bool]:
    def holds(moment: Conditions, present: bool) -> bool:  # noqa: FBT001  # one signature for all
        wind, limit = moment.view.wind, threshold(moment.params)
        if wind is None or limit < 0.0:
            return False
        speed = math.hypot(wind.velocity_north_m_s, wind.velocity_east_m_s)
        return speed > limit * (_WIND_HYSTERESIS if present else 1.0)

    return holds


def _motor_failed(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature
    failure = moment.view.failure
    return failure is not None and failure.failed_motors != 0


def _attitude_exceeded(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature
    failure = moment.view.failure
    return failure is not None and (failure.roll_exceeded or failure.pitch_exceeded)


def _gyro_jumped(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature
    view = moment.view
    jump_us = None if view.estimator is None else view.estimator.gyro_jump_us
    return jump_us is not None and view.now_us - jump_us < _JUMP_REPORTED_US


def _compass_wrong(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature
    view = moment.view
    set_us = None if view.estimator is None else view.estimator.heading_set_us
    return set_us is not None and view.now_us - set_us < _JUMP_REPORTED_US


def _fence_breached(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature
    fence = moment.view.fence
    if fence is None or FENCE_ACTIONS[fence.action] is Action.NONE:
        return False
    return fence.breach is not FenceBreach.NONE or fence.predicted is not FenceBreach.NONE


def _fence_action(moment: Conditions) -> Action:
    fence = moment.view.fence
    return Action.NONE if fence is None else FENCE_ACTIONS[fence.action]


def _flight_time_over(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature
    return 0 <= moment.params.flight_time_max_s < moment.airborne_s


def _battery_time_short(moment: Conditions, present: bool) -> bool:  # noqa: FBT001  # one signature
    params, view = moment.params, moment.view
    needed_s = return_time_s(view, moment.return_speeds) + params.return_margin_s
    more = _TIME_HYSTERESIS if present else 1.0
    return params.remaining_time_action > 0 and battery_time_s(view) <= more * needed_s


def _storage_full(moment: Conditions, _present: bool) -> bool:  # noqa: FBT001  # one signature
    return moment.params.storage_check > 0 and storage_full(moment.view.storage)


def _offboard_action(moment: Conditions) -> Action:
    """Change to the pilot's mode, if the sticks are received."""
    action = OFFBOARD_ACTIONS[moment.params.offboard_loss_action]
    return action if action >= Action.HOLD or moment.view.sticks_fresh else Action.HOLD


def _without_position(moment: Conditions) -> Action:
    return Action.ALTITUDE if _pilot_flies(moment) else Action.DESCEND


def _without_altitude(moment: Conditions) -> Action:
    return Action.STABILIZED if _pilot_flies(moment) else Action.DESCEND


def _pilot_flies(moment: Conditions) -> bool:
    return moment.flown in PILOTED and moment.view.sticks_fresh


def _attitude_action(moment: Conditions) -> Action:
    """Just after the take-off the motors stop; later only where flight termination is enabled."""
    params = moment.params
    if moment.airborne_s < params.lockdown_takeoff_s:
        return Action.DISARM
    return Action.WARN if params.termination_breaker == BREAKER_FLIGHTTERM else Action.TERMINATE


def _critical_action(moment: Conditions) -> Action:
    return (Action.WARN, Action.WARN, Action.LAND, Action.RETURN)[moment.params.battery_action]


def _emergency_action(moment: Conditions) -> Action:
    return Action.LAND if moment.params.battery_action >= 2 else Action.WARN


ROWS: Final[Mapping[Cause, Row]] = {
    Cause.LINK_LOST: Row(
        "Ground station link lost",
        _link_lost,
        lambda moment: LINK_ACTIONS[moment.params.link_loss_action],
    ),
    Cause.STICKS_LOST: Row(
        "Manual control lost",
        _sticks_lost,
        lambda moment: LINK_ACTIONS[moment.params.sticks_loss_action],
    ),
    Cause.OFFBOARD_LOST: Row(
        "Offboard setpoints lost",
        _offboard_lost,
        _offboard_action,
        clears_s=lambda params: 2.0 * params.offboard_loss_s,  # One setpoint is no stream
    ),
    Cause.BATTERY_LOW: Row(
        "Battery low", _battery_below(lambda params: params.battery_low), _always(Action.WARN)
    ),
    Cause.BATTERY_CRITICAL: Row(
        "Battery critical",
        _battery_below(lambda params: params.battery_critical),
        _critical_action,
    ),
    Cause.BATTERY_EMERGENCY: Row(
        "Battery emergency",
        _battery_below(lambda params: params.battery_emergency),
        _emergency_action,
        urgent=True,
    ),
    Cause.BATTERY_UNKNOWN: Row(
        "Battery monitor lost, charge unknown",
        lambda moment, _present: SENSOR_STALE_S < moment.view.ages.battery < math.inf,
        _critical_action,
        lambda _params: _BATTERY_UNKNOWN_S,
    ),
    Cause.GPS_LOST: Row("GPS lost, flying by dead reckoning", _gps_lost, _gps_loss_action),
    Cause.GPS_POSITION_STOPPED: Row(
        "GPS position disagrees, not used", _stopped(AidSource.GPS_POSITION), _always(Action.WARN)
    ),
    Cause.GPS_VELOCITY_STOPPED: Row(
        "GPS velocity disagrees, not used", _stopped(AidSource.GPS_VELOCITY), _always(Action.WARN)
    ),
    Cause.GPS_HEIGHT_STOPPED: Row(
        "GPS height disagrees, not used", _stopped(AidSource.GPS_HEIGHT), _always(Action.WARN)
    ),
    Cause.COMPASS_LOST: Row(
        "Compass lost",
        lambda moment, _present: moment.view.ages.mag > SENSOR_STALE_S,
        _always(Action.WARN),
    ),
    Cause.COMPASS_WRONG: Row(
        "Compass wrong, heading set by the GPS course", _compass_wrong, _always(Action.WARN)
    ),
    Cause.BAROMETER_LOST: Row(
        "Barometer lost",
        lambda moment, _present: moment.view.ages.baro > SENSOR_STALE_S,
        _always(Action.WARN),
    ),
    Cause.BAROMETER_STOPPED: Row(
        "Barometer disagrees or repeats itself, not used",
        _stopped(AidSource.BAROMETER),
        _always(Action.WARN),
    ),
    Cause.POSITION_LOST: Row(
        "Position lost",
        _position_lost,
        _without_position,
        lambda params: params.position_loss_s,
    ),
    Cause.ALTITUDE_LOST: Row(
        "Altitude lost",
        _altitude_lost,
        _without_altitude,
        lambda params: params.position_loss_s,
    ),
    Cause.ATTITUDE_LOST: Row(
        "Attitude lost",
        lambda moment, _present: not moment.view.aligned,
        _always(Action.DESCEND),
        latched=True,
    ),
    Cause.ATTITUDE_EXCEEDED: Row(
        "Attitude beyond limits", _attitude_exceeded, _attitude_action, urgent=True
    ),
    Cause.GYRO_JUMPED: Row(
        "Gyroscope bias has jumped, following it", _gyro_jumped, _always(Action.WARN)
    ),
    Cause.GYRO_BROKEN: Row(
        "Gyroscope bias beyond its limit",
        lambda moment, _present: moment.view.gyro_broken,
        _always(Action.LAND),
        latched=True,
    ),
    Cause.ACCEL_BROKEN: Row(
        "Accelerometer bias beyond its limit",
        lambda moment, _present: moment.view.accel_broken,
        _always(Action.LAND),
    ),
    Cause.GYRO_LOST: Row(
        "Gyroscope lost, no attitude",
        lambda moment, _present: moment.view.gyro_lost,
        _always(Action.TERMINATE),  # As PX4, whose descent needs an angular velocity
        urgent=True,
    ),
    Cause.ACCEL_LOST: Row(
        "Accelerometer lost, flying without it",
        lambda moment, _present: moment.view.accel_lost,
        _always(Action.LAND),
    ),
    Cause.MOTOR_FAILED: Row(
        "Motor failed",
        _motor_failed,
        lambda moment: MOTOR_ACTIONS[moment.params.motor_failure_action],
        urgent=True,
    ),
    Cause.FENCE_BREACHED: Row(
        "Geofence breached",
        _fence_breached,
        _fence_action,
        urgent=True,
        advice="Held at the geofence: land here, or change the fence, then choose a mode",
    ),
    Cause.WIND_STRONG: Row(
        "Strong wind", _wind_above(lambda params: params.wind_warning_m_s), _always(Action.WARN)
    ),
    Cause.WIND_TOO_STRONG: Row(
        "Wind too strong",
        _wind_above(lambda params: params.wind_max_m_s),
        lambda moment: FENCE_ACTIONS[moment.params.wind_action],
    ),
    Cause.FLIGHT_TIME_OVER: Row(
        "Flight time limit reached", _flight_time_over, _always(Action.RETURN)
    ),
    Cause.BATTERY_TIME_SHORT: Row(
        "Battery lasts no longer than the return",
        _battery_time_short,
        lambda moment: Action.RETURN if moment.params.remaining_time_action == 3 else Action.WARN,
        lambda _params: _CURRENT_SETTLES_S,
    ),
    Cause.STORAGE_FULL: Row(
        "Storage full, flying on without a log", _storage_full, _always(Action.WARN)
    ),
}
"""The whole table; docs/reference/failsafes.md shows it."""
