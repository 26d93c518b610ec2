"""Arming checks: one pure function each, which returns None or a text for the operator."""

import math
from collections.abc import Callable
from typing import Final

from uav_firmware.lib.rotation import tilt_of
from uav_firmware.modules.commander.failsafe_actions import PILOTED
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.control_mode import ManualControlSetpoint
from uav_firmware.msg.geofence import FenceAction
from uav_firmware.msg.sensors import FIX_3D
from uav_firmware.msg.status import NavigationState, StorageStatus

IMU_STALE_S: Final = 0.1
SENSOR_STALE_S: Final = 1.0
GPS_STALE_S: Final = 2.0
SATELLITES_MIN: Final = 6
STORAGE_MIN_BYTES: Final = 20_000_000  # [bytes] With less no log is begun
STORAGE_ENFORCED: Final = 2  # COM_ARM_SDCARD
_BYTES_PER_MB: Final = 1_000_000
_TILT_MAX: Final = math.radians(45.0)
_TURN_MAX: Final = math.radians(30.0)  # [rad/s]
_SPEED_MAX: Final = 1.0  # [m/s] More than the estimate drifts at rest
_ACKNOWLEDGE: Final = "repair, then restart or set COM_FAIL_ACK to 1"
_WIND_MAX_AGE_US: Final = 60_000_000

_THROTTLE_CENTRED: Final = 0.1  # [-] Throttle above the centre by more than this lifts off
_THROTTLE_LOW: Final = -0.9  # [-] Throttle at and below it is down
_BY_THRUST: Final = frozenset({NavigationState.MANUAL, NavigationState.STAB, NavigationState.ACRO})

Check = Callable[[VehicleView, CommanderParams], str | None]


def imu_fresh(view: VehicleView, _params: CommanderParams) -> str | None:
    """The inertial sensor delivers."""
    return None if view.ages.imu < IMU_STALE_S else "Inertial sensor does not deliver"


def gyro_sound(view: VehicleView, _params: CommanderParams) -> str | None:
    """The bias of the gyroscope is within its limit."""
    return "Gyroscope bias beyond its limit" if view.gyro_broken else None


def accel_sound(view: VehicleView, _params: CommanderParams) -> str | None:
    """The bias of the accelerometer has been within its limit."""
    return "Accelerometer bias beyond its limit" if view.accel_broken else None


def instances_sound(view: VehicleView, _params: CommanderParams) -> str | None:
    """No instance of a sensor has failed since the start, and none disagree."""
    sensors = view.sensors
    if sensors is None:
        return None
    for name, failed, bit in (
        ("Gyroscope", sensors.failed_gyros, 1),
        ("Accelerometer", sensors.failed_accels, 2),
        ("Barometer", sensors.failed_baros, 4),
        ("Compass", sensors.failed_mags, 8),
    ):
        if failed:
            return f"{name} {(failed & -failed).bit_length()} failed: restart once it is mended"
        if sensors.disputed & bit:
            return f"{name} readings disagree"
    return None


def baro_fresh(view: VehicleView, _params: CommanderParams) -> str | None:
    """The barometer delivers."""
    return None if view.ages.baro < SENSOR_STALE_S else "Barometer does not deliver"


def mag_fresh(view: VehicleView, _params: CommanderParams) -> str | None:
    """The magnetometer delivers."""
    return None if view.ages.mag < SENSOR_STALE_S else "Magnetometer does not deliver"


def gps_fix(view: VehicleView, _params: CommanderParams) -> str | None:
    """The receiver has a 3D fix."""
    if view.gps is None or view.ages.gps > GPS_STALE_S:
        return "GPS does not deliver"
    return None if view.gps.fix_type >= FIX_3D else "GPS has no 3D fix"


def without_fix(view: VehicleView) -> bool:
    """Whether the position is not measured: the receiver has no fix, or no fix is used."""
    no_fix = view.gps is None or view.ages.gps > GPS_STALE_S or view.gps.fix_type < FIX_3D
    return no_fix or view.dead_reckoning


def estimator_aligned(view: VehicleView, _params: CommanderParams) -> str | None:
    """Tilt and heading are known."""
    heading = view.position is not None and view.position.heading_valid
    return None if view.aligned and heading else "Attitude and heading not yet estimated"


def position_valid(view: VehicleView, _params: CommanderParams) -> str | None:
    """Position and velocity are known."""
    return None if view.position_valid else "Position not yet estimated"


def home_set(view: VehicleView, _params: CommanderParams) -> str | None:
    """The home position is known."""
    return None if view.home is not None else "Home position not set"


def battery_charged(view: VehicleView, params: CommanderParams) -> str | None:
    """The battery holds enough to arm."""
    if view.battery is None or view.ages.battery > SENSOR_STALE_S:
        return "Battery monitor does not deliver"
    if view.battery.remaining >= params.arm_battery_min:
        return None
    return f"Battery at {view.battery.remaining:.0%}, below {params.arm_battery_min:.0%}"


def upright(view: VehicleView, _params: CommanderParams) -> str | None:
    """The vehicle is not lying on its side."""
    if view.attitude is None:
        return "Attitude not yet estimated"
    tilt = tilt_of(view.attitude.q_ned_frd)
    return None if tilt < _TILT_MAX else f"Tilted by {math.degrees(tilt):.0f} degrees"


def estimate_consistent(view: VehicleView, _params: CommanderParams) -> str | None:
    """Sensors agree with the estimate: no innovation is beyond its gate."""
    status = view.estimator
    if status is None:
        return "Attitude and heading not yet estimated"
    if status.stopped:
        names = ", ".join(str(source.name).replace("_", " ") for source in status.stopped)
        return f"Not used since it disagrees: {names}"
    for name, ratio in (
        ("GPS velocity", status.velocity_ratio),
        ("GPS position", status.horizontal_position_ratio),
        ("height", status.vertical_position_ratio),
        ("compass", status.mag_ratio),
    ):
        if ratio >= 1.0:
            return f"Estimate and {name} disagree"
    return None


def gps_good(view: VehicleView, params: CommanderParams) -> str | None:
    """Enough satellites, and a position that is accurate enough."""
    if view.gps is not None and view.gps.satellites_used < SATELLITES_MIN:
        return f"GPS uses only {view.gps.satellites_used} satellites"
    accuracy = view.position.horizontal_accuracy_m if view.position is not None else math.nan
    limit = params.position_accuracy_max
    return None if not accuracy > limit else f"Position accurate to {accuracy:.0f} m only"


def at_rest(view: VehicleView, _params: CommanderParams) -> str | None:
    """The vehicle neither moves nor turns."""
    estimate, attitude = view.position, view.attitude
    if estimate is not None and estimate.velocity_valid:
        speed = math.hypot(*estimate.velocity_ned)
        if speed > _SPEED_MAX:
            return f"Vehicle moves at {speed:.1f} m/s"
    if attitude is not None and math.hypot(*attitude.rate_frd) > _TURN_MAX:
        return "Vehicle turns"
    return None


def inside_fence(view: VehicleView, _params: CommanderParams) -> str | None:
    """The vehicle is within the geofence."""
    fence = view.fence
    outside = fence is not None and fence.action is not FenceAction.NONE and fence.margin_m < 0.0
    return "Outside the geofence" if outside else None


def calm_enough(view: VehicleView, _params: CommanderParams) -> str | None:
    """The wind of a flight that has just ended was not too strong; older values are ignored."""
    wind = view.wind
    if wind is None or view.now_us - wind.time_us > _WIND_MAX_AGE_US:
        return None
    speed = math.hypot(wind.velocity_north_m_s, wind.velocity_east_m_s)
    limit = view.wind_limit_m_s
    return None if limit < 0.0 or speed <= limit else f"Wind {speed:.0f} m/s, above {limit:.0f}"


def not_broken(view: VehicleView, _params: CommanderParams) -> str | None:
    """No motor is known to have failed."""
    if view.failure is None or not view.motor_failed:
        return None
    numbers = [str(n + 1) for n in range(4) if view.failure.failed_motors >> n & 1]
    return f"Motor {' and '.join(numbers)} failed; {_ACKNOWLEDGE}"


def not_crashed(view: VehicleView, _params: CommanderParams) -> str | None:
    """No crash was detected since the last acknowledgement."""
    return f"Crash detected; {_ACKNOWLEDGE}" if view.crashed else None


def former_flights_sound(view: VehicleView, _params: CommanderParams) -> str | None:
    """No failure of a former flight waits for its acknowledgement."""
    failures = view.latched_failures
    return f"{failures[0]} in flight; {_ACKNOWLEDGE}" if failures else None


def escs_report(view: VehicleView, params: CommanderParams) -> str | None:
    """Every speed controller reports, where COM_ARM_CHK_ESCS requires it."""
    silent = view.failure is not None and view.failure.escs_silent
    return "No telemetry of the speed controllers" if silent and params.check_escs else None


def storage_full(storage: StorageStatus | None) -> bool:
    """Whether the flight log has no room, or has been refused."""
    return storage is not None and (storage.refused or storage.free_bytes < STORAGE_MIN_BYTES)


def room_for_log(view: VehicleView, _params: CommanderParams) -> str | None:
    """The medium has room for a flight log, if COM_ARM_SDCARD requires it."""
    storage = view.storage
    if view.storage_check < STORAGE_ENFORCED or storage is None or not storage_full(storage):
        return None
    return f"Storage full: {storage.free_bytes // _BYTES_PER_MB} MB left for the flight log"


def modules_sound(view: VehicleView, _params: CommanderParams) -> str | None:
    """No module has raised an error since the start."""
    errors = view.internal_errors
    return None if errors is None else f"Internal error in {errors.modules[0]}: restart"


ARMING_CHECKS: Final[tuple[Check, ...]] = (
    modules_sound,
    imu_fresh,
    gyro_sound,
    accel_sound,
    instances_sound,
    baro_fresh,
    mag_fresh,
    estimator_aligned,
    estimate_consistent,
    battery_charged,
    upright,
    at_rest,
    not_broken,
    not_crashed,
    former_flights_sound,
    escs_report,
    calm_enough,
    room_for_log,
)
"""For all modes."""

POSITION_CHECKS: Final[tuple[Check, ...]] = (
    gps_fix,
    position_valid,
    gps_good,
    home_set,
    inside_fence,
)
"""For modes that need a position."""


STANDING_CHECKS: Final = frozenset({upright, at_rest})
"""For a vehicle on the ground: in the air they are no sign of its health."""


def failures(view: VehicleView, params: CommanderParams, *, positioned: bool) -> list[str]:
    """Texts of all checks that fail, in the order of the tables."""
    checks = ARMING_CHECKS + (POSITION_CHECKS if positioned else ())
    return [text for check in checks if (text := check(view, params)) is not None]


def healthy_in_flight(view: VehicleView, params: CommanderParams) -> bool:
    """Whether an armed vehicle passes all checks but `STANDING_CHECKS`."""
    checks = [check for check in ARMING_CHECKS + POSITION_CHECKS if check not in STANDING_CHECKS]
    return all(check(view, params) is None for check in checks)


def mission_ready(view: VehicleView) -> str | None:
    """A mission is stored and can be flown from the present home."""
    if view.progress is None or view.progress.seq_total == 0:
        return "No mission stored"
    rejection = view.navigator.mission_rejection if view.navigator is not None else None
    return None if rejection is None else f"Mission not feasible: {rejection.reason}"


def unsafe_throttle(mode: NavigationState, sticks: ManualControlSetpoint | None) -> str | None:
    """Why the vehicle would jump if armed with this throttle; None when it would not."""
    if mode not in PILOTED or sticks is None:
        return None
    if mode in _BY_THRUST:
        return None if sticks.up <= _THROTTLE_LOW else "Throttle is not down"
    return None if sticks.up <= _THROTTLE_CENTRED else "Throttle is above the centre"
