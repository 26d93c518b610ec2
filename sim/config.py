"""What one simulated vehicle and its world are made of: frozen, checked once."""

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final

from sim.fault_schedule import MOST_INSTANCES, Fault
from sim.gnss_receivers import GNSS_RECEIVERS

VEHICLE_SPACING_M: Final = 3.0
"""Distance [m] to the east between one vehicle's place and the next one's."""

_LARGEST_SEED: Final = 2**63 - 1


class SimulationConfigError(ValueError):
    """A field of the configuration is out of its range; the message names it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationConfig:
    """Seed, place, rates, weather, instruments, battery and the truth log of one vehicle.

    Raises:
        SimulationConfigError: on a number that is not finite or out of range, or a receiver that
            there is not.
    """

    seed: int = 1  # [-] Every random number of the flight follows from it
    home_latitude_deg: float = 40.44340  # [deg] WGS-84
    home_longitude_deg: float = -3.73820  # [deg] WGS-84
    home_altitude_amsl_m: float = 650.0  # [m] Of the ground at home
    heading_deg: float = 0.0  # [deg] Of the nose at the start, clockwise from true north
    start_east_m: float = 0.0  # [m] Where the vehicle stands, east of home
    farm_seed: int = 1  # [-] Of the farm's maps: the same for all vehicles that share a farm
    farm_origin: tuple[float, float, float] | None = None  # [deg, deg, m AMSL] None: home
    physics_rate_hz: int = 500  # [Hz] JSBSim's step
    control_rate_hz: int = 250  # [Hz] Divides physics_rate_hz
    wind_speed_m_s: float = 0.0  # [m/s] Mean, 6 m (20 ft) above ground
    wind_from_deg: float = 270.0  # [deg] Where it comes from, clockwise from true north
    gusts: bool = True  # Dryden turbulence in proportion to the mean wind
    sensor_noise_factor: float = 1.0  # [-] 1 honest, 0 ideal: on top of what instruments they are
    gps: str = "m9n"  # Satellite receiver, a name of GNSS_RECEIVERS
    imus: int = 3  # [-] Inertial sensors, each with errors of its own, as on a Pixhawk 4 to 6
    barometers: int = 2  # [-]
    compasses: int = 2  # [-]
    battery_capacity_ah: float = 5.2  # [Ah] Of a four-cell lithium polymer pack
    battery_initial_charge: float = 1.0  # [-] 0 empty to 1 full
    start_time_utc_us: int = 1_780_300_800_000_000  # [us] UTC at time zero: 2026-06-01 08:00
    ground_effect: bool = False  # More thrust near the ground, after Cheeseman and Bennett
    faults: tuple[Fault, ...] = ()  # What breaks, and when
    truth_log_path: Path | None = None  # CSV of the true state, none when None

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float) and not math.isfinite(value):
                raise SimulationConfigError(f"{field.name} must be finite, not {value}")
        self._check_range("seed", 0, _LARGEST_SEED)
        self._check_range("home_latitude_deg", -85.0, 85.0)
        self._check_range("home_longitude_deg", -180.0, 180.0)
        self._check_range("home_altitude_amsl_m", -500.0, 6000.0)
        self._check_range("farm_seed", 0, _LARGEST_SEED)
        self._check_range("start_east_m", -10_000.0, 10_000.0)
        self._check_range("physics_rate_hz", 500, 10_000)
        self._check_range("control_rate_hz", 50, 10_000)
        self._check_range("wind_speed_m_s", 0.0, 30.0)
        self._check_range("sensor_noise_factor", 0.0, 100.0)
        if self.gps not in GNSS_RECEIVERS:
            known = ", ".join(GNSS_RECEIVERS)
            raise SimulationConfigError(f"gps must be one of {known}, not {self.gps!r}")
        self._check_range("imus", 1, MOST_INSTANCES)
        self._check_range("barometers", 1, MOST_INSTANCES)
        self._check_range("compasses", 1, MOST_INSTANCES)
        self._check_range("battery_capacity_ah", 0.01, 1000.0)
        self._check_range("battery_initial_charge", 0.0, 1.0)
        self._check_range("start_time_utc_us", 0, 4_102_444_800_000_000)
        if self.physics_rate_hz % self.control_rate_hz:
            raise SimulationConfigError(
                f"control_rate_hz {self.control_rate_hz} does not divide "
                f"physics_rate_hz {self.physics_rate_hz}"
            )
        if 1_000_000 % self.control_rate_hz:
            raise SimulationConfigError(
                f"control_rate_hz {self.control_rate_hz} is no whole number of microseconds"
            )

    def _check_range(self, name: str, minimum: float, maximum: float) -> None:
        value = getattr(self, name)
        if not minimum <= value <= maximum:
            raise SimulationConfigError(f"{name} must be {minimum} to {maximum}, not {value}")

    @property
    def step_us(self) -> int:
        """Length of a control step [us]."""
        return 1_000_000 // self.control_rate_hz


def start_east_m(vehicle_number: int) -> float:
    """Where vehicle 1, 2, 3, ... stands [m east of home]: side by side, three metres apart.

    Raises:
        SimulationConfigError: for a number below one.
    """
    if vehicle_number < 1:
        raise SimulationConfigError(f"vehicle_number must be 1 or more, not {vehicle_number}")
    return VEHICLE_SPACING_M * (vehicle_number - 1)
