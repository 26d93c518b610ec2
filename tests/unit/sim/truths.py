"""True states for tests of single instruments."""

import math
from typing import Any

from sim.physics.truth import Truth, quaternion_from_euler
from tests.support.messages import changed


def truth(
    time_us: int = 0,
    *,
    roll_deg: float = 0.0,
    pitch_deg: float = 0.0,
    yaw_deg: float = 0.0,
    **changes: Any,
) -> Truth:
    """A vehicle at rest, level, at the default home, but for `changes`."""
    level = Truth(
        time_us=time_us,
        latitude_deg=40.4434,
        longitude_deg=-3.7382,
        altitude_amsl_m=650.0,
        height_above_home_m=0.0,
        velocity_ned=(0.0, 0.0, 0.0),
        q_ned_frd=quaternion_from_euler(
            math.radians(roll_deg), math.radians(pitch_deg), math.radians(yaw_deg)
        ),
        roll_deg=roll_deg,
        pitch_deg=pitch_deg,
        yaw_deg=yaw_deg,
        rate_frd=(0.0, 0.0, 0.0),
        inertial_rate_frd=(0.0, 0.0, 0.0),
        specific_force_frd=(0.0, 0.0, -9.8),
        rotor_rpm=(0.0, 0.0, 0.0, 0.0),
        airspeed_m_s=0.0,
        pressure_pa=93756.0,
        temperature_c=10.8,
    )
    return changed(level, **changes)
