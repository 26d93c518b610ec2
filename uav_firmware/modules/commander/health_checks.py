"""Arming checks: one pure function each, None or a sentence for the operator."""

import math
from collections.abc import Callable
from typing import Final

from uav_firmware.lib.rotation import tilt_of
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.modules.commander.vehicle_view import VehicleView

IMU_STALE_S: Final = 0.1
SENSOR_STALE_S: Final = 1.0
GPS_STALE_S: Final = 2.0
_FIX_3D: Final = 3
_TILT_MAX: Final = math.radians(45.0)

Check = Callable[[VehicleView, CommanderParams], str | None]


def imu_fresh(view: VehicleView, _params: CommanderParams) -> str | None:
    """The inertial sensor delivers."""
    return None if view.ages.imu < IMU_STALE_S else "Inertial sensor does not deliver"


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
    return None if view.gps.fix_type >= _FIX_3D else "GPS has no 3D fix"


def estimator_aligned(view: VehicleView, _params: CommanderParams) -> str | None:
    """Tilt and heading are known."""
    heading = view.position is not None and view.position.heading_valid
    return None if view.aligned and heading else "Attitude and heading not yet estimated"


def position_valid(view: VehicleView, _params: CommanderParams) -> str | None:
    """Position and velocity are known."""
    return None if view.position_valid else "Position not yet estimated"


def home_set(view: VehicleView, _params: CommanderParams) -> str | None:
    """Return has a goal."""
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


ARMING_CHECKS: Final[tuple[Check, ...]] = (
    imu_fresh,
    baro_fresh,
    mag_fresh,
    gps_fix,
    estimator_aligned,
    position_valid,
    home_set,
    battery_charged,
    upright,
)


def failures(view: VehicleView, params: CommanderParams) -> list[str]:
    """Sentences of all checks that fail, in the order of the table."""
    return [text for check in ARMING_CHECKS if (text := check(view, params)) is not None]


def mission_ready(view: VehicleView) -> str | None:
    """A mission is stored and can be flown from the present home."""
    if view.progress is None or view.progress.seq_total == 0:
        return "No mission stored"
    rejection = view.navigator.mission_rejection if view.navigator is not None else None
    return None if rejection is None else f"Mission not feasible: {rejection.reason}"
