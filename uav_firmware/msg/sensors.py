"""What the sensors measure. Written by the driver, voted by sensors, read by the estimator."""

import math
from typing import Final, NamedTuple

from farm_flight_bridge.native import mypyc_attr
from uav_firmware.msg.vectors import Motors, Vector3


@mypyc_attr(acyclic=True, free_list_len=1)
class SensorImu:
    """Inertial measurement, one per control step; read by estimator and rate_control."""

    __slots__ = ("rate_frd", "specific_force_frd", "time_us")

    def __init__(
        self,
        time_us: int,  # [us] Simulated time since boot
        rate_frd: Vector3,  # [rad/s] Angular rate of the body against inertial space
        specific_force_frd: Vector3,  # [m/s^2] Accelerometer: about (0, 0, -9.81) at rest
    ) -> None:
        self.time_us: Final = time_us
        self.rate_frd: Final = rate_frd
        self.specific_force_frd: Final = specific_force_frd


class ImuShift(NamedTuple):
    """Written by sensors when an inertial sensor is excluded; read by estimator, which follows.

    By how much the bias of the sample that is published has changed.
    """

    time_us: int  # [us]
    gyro_bias_frd: Vector3  # [rad/s]
    accel_bias_frd: Vector3  # [m/s^2]


class SensorsStatus(NamedTuple):
    """Which instances have failed, until a restart; written by sensors, on change and at 1 Hz."""

    time_us: int  # [us]
    failed_gyros: int  # [-] Bit 0 is the first instance
    failed_accels: int
    failed_baros: int
    failed_mags: int
    gyro_lost: bool = False  # None is left
    accel_lost: bool = False
    disputed: int = 0  # [-] Two disagree: 1 gyroscopes, 2 accelerometers, 4 barometers, 8 compasses
    gyros_agree: bool = False  # Two or more, none of which has failed or is disputed
    accels_agree: bool = False


class SensorBaro(NamedTuple):
    """Barometer at 25 Hz or more; read by estimator."""

    time_us: int  # [us] Time of the measurement
    pressure_pa: float  # [Pa] Static pressure
    temperature_c: float  # [deg C] Of the sensor


class SensorMag(NamedTuple):
    """Magnetometer at 25 Hz or more; read by estimator."""

    time_us: int  # [us] Time of the measurement
    field_frd: Vector3  # [gauss] Earth's field in the body frame


FIX_3D: Final = 3
"""MAVLink's GPS_FIX_TYPE from which on a receiver gives a place and an altitude."""


class SensorGps(NamedTuple):
    """GNSS receiver at 5 to 10 Hz, delivered late; read by estimator and mavlink."""

    time_us: int  # [us] Time of validity, not of delivery
    time_utc_us: int  # [us] Since 1970, 0 when unknown
    latitude_deg: float  # [deg] WGS-84
    longitude_deg: float  # [deg] WGS-84
    altitude_amsl_m: float  # [m] Above mean sea level
    velocity_ned: Vector3  # [m/s] Ground velocity
    horizontal_accuracy_m: float  # [m] One sigma
    vertical_accuracy_m: float  # [m] One sigma
    speed_accuracy_m_s: float  # [m/s] One sigma
    fix_type: int  # [-] MAVLink GPS_FIX_TYPE: 0 no GPS, 1 no fix, FIX_3D
    satellites_used: int  # [-]
    hdop: float  # [-]
    vdop: float  # [-]
    altitude_ellipsoid_m: float = math.nan  # [m] Above WGS-84; NaN without a geoid model


class SensorBattery(NamedTuple):
    """Battery as its monitor measures it, at 5 Hz or more; read by battery."""

    time_us: int  # [us]
    voltage_v: float  # [V] At the pack
    current_a: float  # [A] Drawn


@mypyc_attr(acyclic=True, free_list_len=1)
class SensorEsc:
    """Telemetry of the speed controllers at 50 Hz or more; read by failure_detector."""

    __slots__ = ("current_a", "rotor_rpm", "time_us")

    def __init__(
        self,
        time_us: int,  # [us]
        rotor_rpm: Motors,  # [1/min] Never negative
        current_a: Motors,  # [A] Drawn by each
    ) -> None:
        self.time_us: Final = time_us
        self.rotor_rpm: Final = rotor_rpm
        self.current_a: Final = current_a


class SensorRange(NamedTuple):
    """Range finder that looks down, at 10 Hz or more; read by land_detector, navigator, mavlink."""

    time_us: int  # [us]
    distance_m: float  # [m] Along the body's down axis; NaN when nothing answers
    minimum_m: float  # [m] Of what it can measure
    maximum_m: float  # [m]


class SensorHygrometer(NamedTuple):
    """Air at the vehicle, once a second; reported, not used for flight."""

    time_us: int  # [us]
    air_temperature_c: float  # [deg C]
    relative_humidity_percent: float  # [%] NaN when it is not measured


class SensorGround(NamedTuple):
    """Soil below and light above, once a second; reported, not used for flight."""

    time_us: int  # [us]
    soil_moisture: float  # [m^3/m^3] Water in the upper soil
    soil_temperature_c: float  # [deg C]
    illuminance_lx: float  # [lx] On level ground


class SensorTruth(NamedTuple):
    """Ground truth from a simulation, for HIL_STATE_QUATERNION only; no module flies by it."""

    time_us: int  # [us]
    latitude_deg: float  # [deg]
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    velocity_ned: Vector3  # [m/s]
    q_ned_frd: tuple[float, float, float, float]  # [-] Scalar first
    rate_frd: Vector3  # [rad/s]
    acceleration_frd: Vector3  # [m/s^2] Specific force
    airspeed_m_s: float  # [m/s] True airspeed
