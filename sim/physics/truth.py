"""The true state of the vehicle at one instant: NED about the vehicle, body FRD, SI."""

import math
from typing import Final, TypeAlias

from farm_flight_bridge.native import mypyc_attr

Vector3: TypeAlias = tuple[float, float, float]
"""Three components in the order of the frame that the field's name ends in."""

Quaternion: TypeAlias = tuple[float, float, float, float]
"""Hamilton, scalar first (w, x, y, z); `q_ned_frd` rotates a body vector into NED."""

Motors: TypeAlias = tuple[float, float, float, float]
"""One value per rotor: front right, rear left, front left, rear right."""

_STILL: Final[Vector3] = (0.0, 0.0, 0.0)


@mypyc_attr(acyclic=True, free_list_len=1)
class Truth:
    """The true state, which no instrument measures exactly, all at the same instant."""

    __slots__ = (
        "airspeed_m_s",
        "altitude_amsl_m",
        "height_above_home_m",
        "inertial_rate_frd",
        "latitude_deg",
        "longitude_deg",
        "pitch_deg",
        "pressure_pa",
        "q_ned_frd",
        "rate_frd",
        "roll_deg",
        "rotor_rpm",
        "specific_force_frd",
        "temperature_c",
        "time_us",
        "velocity_ned",
        "yaw_deg",
    )

    def __init__(
        self,
        time_us: int,  # [us] Since the start of the simulation
        latitude_deg: float,  # [deg] WGS-84 geodetic, of the centre of gravity
        longitude_deg: float,  # [deg] WGS-84
        altitude_amsl_m: float,  # [m] Above the WGS-84 ellipsoid, taken as mean sea level
        height_above_home_m: float,  # [m] Altitude less the ground's altitude at home
        velocity_ned: Vector3,  # [m/s] Over the ground
        q_ned_frd: Quaternion,  # [-] Scalar not negative
        roll_deg: float,  # [deg] -180 to 180, right side down is positive
        pitch_deg: float,  # [deg] -90 to 90, nose up is positive
        yaw_deg: float,  # [deg] 0 to 360, clockwise from true north
        rate_frd: Vector3,  # [rad/s] Of the body against the Earth
        inertial_rate_frd: Vector3,  # [rad/s] Of the body against inertial space: for a gyro
        specific_force_frd: Vector3,  # [m/s^2] At the centre of gravity: for an accelerometer
        rotor_rpm: Motors,  # [1/min] Never negative, whatever the sense of rotation
        airspeed_m_s: float,  # [m/s] True
        pressure_pa: float,  # [Pa] Static, of the air around the vehicle
        temperature_c: float,  # [deg C] Of the air around the vehicle
    ) -> None:
        self.time_us: Final = time_us
        self.latitude_deg: Final = latitude_deg
        self.longitude_deg: Final = longitude_deg
        self.altitude_amsl_m: Final = altitude_amsl_m
        self.height_above_home_m: Final = height_above_home_m
        self.velocity_ned: Final = velocity_ned
        self.q_ned_frd: Final = q_ned_frd
        self.roll_deg: Final = roll_deg
        self.pitch_deg: Final = pitch_deg
        self.yaw_deg: Final = yaw_deg
        self.rate_frd: Final = rate_frd
        self.inertial_rate_frd: Final = inertial_rate_frd
        self.specific_force_frd: Final = specific_force_frd
        self.rotor_rpm: Final = rotor_rpm
        self.airspeed_m_s: Final = airspeed_m_s
        self.pressure_pa: Final = pressure_pa
        self.temperature_c: Final = temperature_c

    def lying_still(self, time_us: int, specific_force_frd: Vector3) -> "Truth":
        """The same place and attitude at `time_us`, at rest with stopped rotors."""
        return Truth(
            time_us,
            self.latitude_deg,
            self.longitude_deg,
            self.altitude_amsl_m,
            self.height_above_home_m,
            _STILL,
            self.q_ned_frd,
            self.roll_deg,
            self.pitch_deg,
            self.yaw_deg,
            _STILL,
            _STILL,
            specific_force_frd,
            (0.0, 0.0, 0.0, 0.0),
            self.airspeed_m_s,
            self.pressure_pa,
            self.temperature_c,
        )


def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Rotation from body FRD to NED of aerospace Euler angles [rad], yaw first.

    Half-angle products of Diebel, "Representing Attitude" (2006), equation 290. The sign
    is chosen such that the scalar is not negative.
    """
    half_cos_roll, half_sin_roll = math.cos(0.5 * roll), math.sin(0.5 * roll)
    half_cos_pitch, half_sin_pitch = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    half_cos_yaw, half_sin_yaw = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    level, nose = half_cos_roll * half_cos_pitch, half_sin_roll * half_sin_pitch
    bank, climb = half_sin_roll * half_cos_pitch, half_cos_roll * half_sin_pitch
    w = level * half_cos_yaw + nose * half_sin_yaw
    x = bank * half_cos_yaw - climb * half_sin_yaw
    y = climb * half_cos_yaw + bank * half_sin_yaw
    z = level * half_sin_yaw - nose * half_cos_yaw
    return (w, x, y, z) if w >= 0.0 else (-w, -x, -y, -z)


def body_from_ned(q_ned_frd: Quaternion, vector_ned: Vector3) -> Vector3:
    """Components in the body frame of a vector given in NED: R(q) transposed times it."""
    w, x, y, z = q_ned_frd
    north, east, down = vector_ned
    return (
        (1 - 2 * (y * y + z * z)) * north + 2 * (x * y + w * z) * east + 2 * (x * z - w * y) * down,
        2 * (x * y - w * z) * north + (1 - 2 * (x * x + z * z)) * east + 2 * (y * z + w * x) * down,
        2 * (x * z + w * y) * north + 2 * (y * z - w * x) * east + (1 - 2 * (x * x + y * y)) * down,
    )
