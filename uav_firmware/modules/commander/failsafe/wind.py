"""Wind estimate from the tilt that a vehicle needs against the drag.

The rotors push along the body's axis; the acceleration that this does not explain is drag:

    drag = a + (g - a_down) (b_north, b_east) / b_down        b: body down axis in NED
    wind = v + v_air(drag)

with the airspeed v_air of that drag by `uav_firmware/lib/drag.py` (EKF2_MCOEF, EKF2_BCOEF_X,
EKF2_BCOEF_Y), along the body's axes in the present heading; air density is that of the standard
atmosphere at the vehicle's altitude. Velocity and drag are low-passed, since the equations hold at
steady state; a tilt error of half a degree is 0.3 m/s of wind.
"""

from typing import Final, NamedTuple

from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.lib.rotation import rotate, rotate_by_yaw, yaw_of
from uav_firmware.msg.vectors import Quaternion, Vector3

TIME_CONSTANT_S: Final = 4.0
_SETTLED: Final = 3.0  # Time constants until the filter has settled
_UPRIGHT: Final = 0.3  # Cosine of the largest tilt that is used
_DOWN: Final[Vector3] = (0.0, 0.0, 1.0)


class DragSample(NamedTuple):
    """Drag on the vehicle and thrust against it."""

    drag: tuple[
        float, float
    ]  # [m/s^2] North and east: acceleration that the thrust does not explain
    thrust_ratio: float  # [-] Thrust over weight


def drag_sample(q_ned_frd: Quaternion, acceleration_ned: Vector3) -> DragSample:
    """Drag and thrust of an attitude and an acceleration [m/s^2]."""
    north, east, down = rotate(q_ned_frd, _DOWN)
    lift = (STANDARD_GRAVITY_M_S2 - acceleration_ned[2]) / max(down, _UPRIGHT)
    drag = (acceleration_ned[0] + north * lift, acceleration_ned[1] + east * lift)
    return DragSample(drag, lift / STANDARD_GRAVITY_M_S2)


def wind_of(
    sample: DragSample,
    velocity: tuple[float, float],
    model: DragModel,
    density: float,
    yaw_rad: float = 0.0,
) -> tuple[float, float]:
    """Wind [m/s, north and east: where the air goes to] of a steady drag and velocity."""
    drag_xy = rotate_by_yaw(*sample.drag, -yaw_rad)
    air_xy = model.airspeed_xy(drag_xy, density, sample.thrust_ratio)
    north, east = rotate_by_yaw(*air_xy, yaw_rad)
    return velocity[0] + north, velocity[1] + east


class WindEstimator:
    """Low-pass filter of drag and velocity in one flight."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Begin a flight."""
        # Drag north, east; thrust ratio; velocity north, east
        self._mean = (0.0, 0.0, 1.0, 0.0, 0.0)
        self._yaw_rad = 0.0  # Of the last sample
        self._age_s = 0.0

    def update(
        self, q_ned_frd: Quaternion, acceleration_ned: Vector3, velocity_ned: Vector3, dt: float
    ) -> None:
        """Add a sample of the flight."""
        sample = drag_sample(q_ned_frd, acceleration_ned)
        latest = (*sample.drag, sample.thrust_ratio, velocity_ned[0], velocity_ned[1])
        share = dt / (dt + min(self._age_s, TIME_CONSTANT_S)) if self._age_s > 0.0 else 1.0
        a, b, c, d, e = (
            old + share * (new - old) for old, new in zip(self._mean, latest, strict=True)
        )
        self._mean = (a, b, c, d, e)
        self._yaw_rad = yaw_of(q_ned_frd)
        self._age_s += dt

    def wind(self, model: DragModel, density: float) -> tuple[float, float] | None:
        """Wind [m/s, north and east]; None until the filter has settled, or of an unknown drag."""
        if not model.gives_airspeed or self._age_s < _SETTLED * TIME_CONSTANT_S:
            return None
        north, east, thrust_ratio, v_north, v_east = self._mean
        sample = DragSample((north, east), thrust_ratio)
        return wind_of(sample, (v_north, v_east), model, density, self._yaw_rad)
