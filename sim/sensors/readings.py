"""What the instruments read; a reading that is not due is None in `Readings`."""

import math
from typing import Final, NamedTuple

from farm_flight_bridge.native import mypyc_attr
from sim.physics.truth import Motors, Vector3


@mypyc_attr(acyclic=True, free_list_len=1)
class ImuReading:
    """Gyroscope and accelerometer, one in every control step."""

    __slots__ = ("rate_frd", "specific_force_frd", "time_us")

    def __init__(
        self,
        time_us: int,  # [us]
        rate_frd: Vector3,  # [rad/s] Of the body against inertial space
        specific_force_frd: Vector3,  # [m/s^2] About (0, 0, -9.8) at rest
    ) -> None:
        self.time_us: Final = time_us
        self.rate_frd: Final = rate_frd
        self.specific_force_frd: Final = specific_force_frd


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


@mypyc_attr(acyclic=True, free_list_len=1)
class EscReading:
    """Telemetry of the four speed controllers."""

    __slots__ = ("current_a", "rotor_rpm", "time_us")

    def __init__(
        self,
        time_us: int,  # [us]
        rotor_rpm: Motors,  # [1/min] Never negative, whatever the sense of rotation
        current_a: Motors,  # [A] Drawn from the pack by each
    ) -> None:
        self.time_us: Final = time_us
        self.rotor_rpm: Final = rotor_rpm
        self.current_a: Final = current_a


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


@mypyc_attr(acyclic=True, free_list_len=1)
class Readings:
    """All that the instruments say after one control step, of some one entry per instance."""

    __slots__ = (
        "baros",
        "battery",
        "environment",
        "esc",
        "gps",
        "imus",
        "mags",
        "only_fast",
        "range",
    )

    def __init__(
        self,
        imus: tuple[ImuReading, ...],
        baros: tuple[BaroReading | None, ...],
        mags: tuple[MagReading | None, ...],
        gps: GpsReading | None,
        battery: BatteryReading | None,
        esc: EscReading | None,
        range: RangeReading | None = None,
        environment: EnvironmentReading | None = None,
        only_fast: bool = False,  # Every other reading than inertial units and ESCs is None
    ) -> None:
        self.imus: Final = imus
        self.baros: Final = baros
        self.mags: Final = mags
        self.gps: Final = gps
        self.battery: Final = battery
        self.esc: Final = esc
        self.range: Final = range
        self.environment: Final = environment
        self.only_fast: Final = only_fast

    def with_environment(self, sample: EnvironmentReading) -> "Readings":
        """The same with a sample of air and soil."""
        return Readings(
            self.imus,
            self.baros,
            self.mags,
            self.gps,
            self.battery,
            self.esc,
            self.range,
            sample,
        )

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
