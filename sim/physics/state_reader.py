"""JSBSim's properties read as a `Truth`: where feet, pounds and Rankine become SI.

Uses the property tree but not JSBSim itself: it is given a function that finds a property.
"""

import math
from collections.abc import Callable
from typing import Final, TypeAlias

from sim.physics import properties
from sim.physics.truth import Motors, Truth, Vector3, quaternion_from_euler
from sim.physics.units import (
    KILOGRAMS_M3_PER_SLUG_FT3,
    KILOGRAMS_PER_SLUG,
    METRES_PER_FOOT,
    NEWTONS_PER_POUND,
    PASCALS_PER_PSF,
    celsius_from_rankine,
)

Getter: TypeAlias = Callable[[], float]
"""Value of one property, in JSBSim's unit."""

_ENGINES = range(4)
_FEET_FREE_M: Final = 3.0  # Height of the centre of gravity at which no foot reaches the ground


class StateReader:
    """Reads the state after a step. `find` gives the getter of a property path.

    Every property is looked up once, here: a bound getter costs 40 ns, and there are some
    thirty of them in a step.
    """

    def __init__(self, find: Callable[[str], Getter], *, ground_amsl_m: float) -> None:
        self._ground_m = ground_amsl_m
        self._latitude_deg = find(properties.LATITUDE_GEODETIC_DEG)
        self._longitude_deg = find(properties.LONGITUDE_DEG)
        self._altitude_ft = find(properties.ALTITUDE_GEODETIC_FT)
        self._height_above_ground_ft = find(properties.HEIGHT_ABOVE_GROUND_FT)
        self._airspeed_fps = find(properties.TRUE_AIRSPEED_FPS)
        self._pressure_psf = find(properties.PRESSURE_PSF)
        self._temperature_r = find(properties.TEMPERATURE_R)
        self._density_slugs_ft3 = find(properties.DENSITY_SLUGS_FT3)
        self._air_velocity_fps = [find(path) for path in properties.AIR_VELOCITY_FRD_FPS]
        self._velocity_fps = [find(path) for path in properties.VELOCITY_NED_FPS]
        self._attitude = [find(path) for path in properties.ATTITUDE_RAD]
        self._rate = [find(path) for path in properties.RATE_FRD_RAD_S]
        self._inertial_rate = [find(path) for path in properties.INERTIAL_RATE_FRD_RAD_S]
        self._force_lbs = [
            find(path)
            for path in (
                *properties.AERODYNAMIC_FORCE_FRD_LBS,
                *properties.PROPULSIVE_FORCE_FRD_LBS,
                *properties.GEAR_FORCE_FRD_LBS,
                *properties.EXTERNAL_FORCE_FRD_LBS,
            )
        ]
        self._total_force_lbs = [find(path) for path in properties.TOTAL_FORCE_FRD_LBS]
        self._rpm = [find(properties.ROTOR_SPEED_RPM.format(engine)) for engine in _ENGINES]
        self._current = [find(properties.MOTOR_CURRENT_A.format(engine)) for engine in _ENGINES]
        mass_kg = find(properties.MASS_SLUGS)() * KILOGRAMS_PER_SLUG
        self._acceleration_per_pound = NEWTONS_PER_POUND / mass_kg

    def height_above_ground_m(self) -> float:
        """Height [m] of the centre of gravity above the ground."""
        return self._height_above_ground_ft() * METRES_PER_FOOT

    def sink_rate_m_s(self) -> float:
        """Velocity downwards [m/s]."""
        return self._velocity_fps[2]() * METRES_PER_FOOT

    def cosine_of_tilt(self) -> float:
        """Cosine of the angle between the body's down axis and the world's."""
        roll, pitch, _ = self._attitude
        return math.cos(roll()) * math.cos(pitch())

    def density_kg_m3(self) -> float:
        """Density [kg/m^3] of the air around the vehicle."""
        return self._density_slugs_ft3() * KILOGRAMS_M3_PER_SLUG_FT3

    def air_velocity_frd(self) -> Vector3:
        """Velocity [m/s, FRD] of the centre of gravity through the air, in the last step."""
        forward, right, down = self._air_velocity_fps
        return (forward() * METRES_PER_FOOT, right() * METRES_PER_FOOT, down() * METRES_PER_FOOT)

    def thrust_lbs(self) -> float:
        """Thrust of all rotors [lbf] along the body's up axis."""
        return -self._force_lbs[5]()

    def motor_currents_a(self) -> Motors:
        """Current [A] through the windings of each motor."""
        current_1, current_2, current_3, current_4 = self._current
        return (current_1(), current_2(), current_3(), current_4())

    def truth(self, time_us: int) -> Truth:
        """The state now, said to be at `time_us`."""
        get_roll, get_pitch, get_yaw = self._attitude
        roll, pitch, yaw = get_roll(), get_pitch(), get_yaw()
        north, east, down = self._velocity_fps
        p, q, r = self._rate
        pi, qi, ri = self._inertial_rate
        rotor_1, rotor_2, rotor_3, rotor_4 = self._rpm
        altitude_m = self._altitude_ft() * METRES_PER_FOOT
        height_m = altitude_m - self._ground_m
        return Truth(
            time_us,
            self._latitude_deg(),
            self._longitude_deg(),
            altitude_m,
            height_m,
            (north() * METRES_PER_FOOT, east() * METRES_PER_FOOT, down() * METRES_PER_FOOT),
            quaternion_from_euler(roll, pitch, yaw),
            math.degrees(roll),
            math.degrees(pitch),
            math.degrees(yaw),
            (p(), q(), r()),
            (pi(), qi(), ri()),
            self._specific_force(height_m),
            (rotor_1(), rotor_2(), rotor_3(), rotor_4()),
            self._airspeed_fps() * METRES_PER_FOOT,
            self._pressure_psf() * PASCALS_PER_PSF,
            celsius_from_rankine(self._temperature_r()),
        )

    def _specific_force(self, height_m: float) -> Vector3:
        """Everything but gravity that pushes the vehicle, over its mass [m/s^2, FRD].

        JSBSim's own accelerometer component lags this by one physics step, because it runs
        before the forces of its step are known. In the air its total is the sum of four parts,
        to the last digit; with friction on the ground it adds them up in another order.
        """
        scale = self._acceleration_per_pound
        if height_m > _FEET_FREE_M:
            x, y, z = self._total_force_lbs
            return (x() * scale, y() * scale, z() * scale)
        ax, ay, az, px, py, pz, gx, gy, gz, ex, ey, ez = self._force_lbs
        return (
            (ax() + px() + gx() + ex()) * scale,
            (ay() + py() + gy() + ey()) * scale,
            (az() + pz() + gz() + ez()) * scale,
        )
