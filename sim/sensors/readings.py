"""What the instruments read; a reading that is not due is None in `Readings`."""

import math
from typing import NamedTuple

from sim.physics.truth import Motors, Vector3


class ImuReading(NamedTuple):
    """Gyroscope and accelerometer, one in every control step."""

    time_us: int  # [us]
    rate_frd: Vector3  # [rad/s] Of the body against inertial space
    specific_force_frd: Vector3  # [m/s^2] About (0, 0, -9.8) at rest


class BaroReading(NamedTuple):
    """Barometer."""

    time_us: int  # [us]
    pressure_pa: float  # [Pa] Static
    temperature_c: float  # [deg C] Of the sensor


class MagReading(NamedTuple):
    """Magnetometer."""

    time_us: int  # [us]
    field_frd_gauss: Vector3  # [gauss]


class GpsReading(NamedTuple):
    """A receiver's solution, handed over some time after the instant it is valid for."""

    time_us: int  # [us] Time of validity
    time_utc_us: int  # [us] The same instant since 1970
    latitude_deg: float  # [deg] WGS-84
    longitude_deg: float  # [deg] WGS-84
    altitude_amsl_m: float  # [m]
    velocity_ned: Vector3  # [m/s]
    horizontal_accuracy_m: float  # [m] One sigma, radial
    vertical_accuracy_m: float  # [m] One sigma
    speed_accuracy_m_s: float  # [m/s] One sigma, of the vector's length
    fix_type: int  # [-] As MAVLink's GPS_FIX_TYPE: 1 no fix, 3 three-dimensional
    satellites_used: int  # [-]
    hdop: float  # [-]
    vdop: float  # [-]
    geoid_height_m: float = math.nan  # [m] Of mean sea level above the WGS-84 ellipsoid


class BatteryReading(NamedTuple):
    """Battery monitor."""

    time_us: int  # [us]
    voltage_v: float  # [V] At the pack's terminals, under load
    current_a: float  # [A] Drawn


class EscReading(NamedTuple):
    """Telemetry of the four speed controllers."""

    time_us: int  # [us]
    rotor_rpm: Motors  # [1/min] Never negative, whatever the sense of rotation
    current_a: Motors  # [A] Drawn from the pack by each


class RangeReading(NamedTuple):
    """Range finder that looks down."""

    time_us: int  # [us]
    distance_m: float  # [m] Along the body's down axis; NaN when nothing comes back


class EnvironmentReading(NamedTuple):
    """Air and soil at the vehicle's place."""

    time_us: int  # [us]
    air_temperature_c: float  # [deg C]
    relative_humidity_percent: float  # [%] NaN: the instrument responds but does not measure
    soil_moisture: float  # [m^3/m^3] Water in the upper soil
    soil_temperature_c: float  # [deg C]
    illuminance_lx: float  # [lx]
    hygrometer_speaks: bool = True  # Else temperature and humidity of the air have not come


class Readings(NamedTuple):
    """All that the instruments say after one control step, of some one entry per instance."""

    imus: tuple[ImuReading, ...]
    baros: tuple[BaroReading | None, ...]
    mags: tuple[MagReading | None, ...]
    gps: GpsReading | None
    battery: BatteryReading | None
    esc: EscReading | None
    range: RangeReading | None = None
    environment: EnvironmentReading | None = None
    only_fast: bool = False  # Of inertial units and speed controllers: every other reading is None

    @property
    def imu(self) -> ImuReading:
        """The first inertial sensor."""
        return self.imus[0]

    @property
    def baro(self) -> BaroReading | None:
        """The first barometer."""
        return self.baros[0]

    @property
    def mag(self) -> MagReading | None:
        """The first compass."""
        return self.mags[0]
