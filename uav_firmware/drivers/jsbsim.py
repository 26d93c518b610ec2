"""The simulated F450 as a vehicle of the component abstraction layer.

The only file of the firmware that knows the simulator. Frames and units are the same on both
sides (NED, FRD, SI); what changes here is the type.
"""

from dataclasses import replace
from pathlib import Path

from sim.config import SimulationConfig, start_east_m
from sim.sensors.readings import Readings
from sim.simulation import Simulation
from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorBattery,
    SensorGps,
    SensorImu,
    SensorMag,
    SensorTruth,
)
from uav_firmware.msg.vectors import Motors

_STOPPED: Motors = (0.0, 0.0, 0.0, 0.0)


class JsbsimVehicle:
    """Implements `uav_firmware.cal.vehicle.Vehicle`."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._motors = _STOPPED
        self._readings: Readings = simulation.readings

    @property
    def time_us(self) -> int:
        """Simulated time since boot [us]."""
        return self._simulation.time_us

    @property
    def step_us(self) -> int:
        """Length of a control step [us]."""
        return self._simulation.config.step_us

    def write_motors(self, control: Motors) -> None:
        """Command the motors from the next step on, 0 stopped to 1 full."""
        self._motors = control

    def advance(self) -> None:
        """Let one control step pass.

        Raises:
            ValueError: when a motor command is no finite number; no time passes then.
        """
        self._readings = self._simulation.step(self._motors)

    def read_imu(self) -> SensorImu:
        """Inertial sample of this step."""
        imu = self._readings.imu
        return SensorImu(imu.time_us, imu.rate_frd, imu.specific_force_frd)

    def read_baro(self) -> SensorBaro | None:
        """Barometer sample if one is due."""
        baro = self._readings.baro
        if baro is None:
            return None
        return SensorBaro(baro.time_us, baro.pressure_pa, baro.temperature_c)

    def read_mag(self) -> SensorMag | None:
        """Magnetometer sample if one is due."""
        mag = self._readings.mag
        return None if mag is None else SensorMag(mag.time_us, mag.field_frd_gauss)

    def read_gps(self) -> SensorGps | None:
        """GNSS solution if one has arrived."""
        gps = self._readings.gps
        if gps is None:
            return None
        return SensorGps(
            time_us=gps.time_us,
            time_utc_us=gps.time_utc_us,
            latitude_deg=gps.latitude_deg,
            longitude_deg=gps.longitude_deg,
            altitude_amsl_m=gps.altitude_amsl_m,
            velocity_ned=gps.velocity_ned,
            horizontal_accuracy_m=gps.horizontal_accuracy_m,
            vertical_accuracy_m=gps.vertical_accuracy_m,
            speed_accuracy_m_s=gps.speed_accuracy_m_s,
            fix_type=gps.fix_type,
            satellites_used=gps.satellites_used,
            hdop=gps.hdop,
            vdop=gps.vdop,
        )

    def read_battery(self) -> SensorBattery | None:
        """Battery sample if one is due."""
        battery = self._readings.battery
        if battery is None:
            return None
        return SensorBattery(
            time_us=battery.time_us,
            voltage_v=battery.voltage_v,
            current_a=battery.current_a,
            consumed_ah=battery.consumed_ah,
            capacity_ah=battery.capacity_ah,
            remaining=battery.remaining,
        )

    def read_truth(self) -> SensorTruth:
        """True state, for display and never for control."""
        truth = self._simulation.truth
        return SensorTruth(
            time_us=truth.time_us,
            latitude_deg=truth.latitude_deg,
            longitude_deg=truth.longitude_deg,
            altitude_amsl_m=truth.altitude_amsl_m,
            velocity_ned=truth.velocity_ned,
            q_ned_frd=truth.q_ned_frd,
            rate_frd=truth.rate_frd,
            acceleration_frd=truth.specific_force_frd,
            airspeed_m_s=truth.airspeed_m_s,
        )

    def close(self) -> None:
        """Close the truth log."""
        self._simulation.close()


def simulated_vehicle(
    *,
    number: int,
    seed: int,
    home: tuple[float, float, float, float] | None,
    wind_m_s: float,
    wind_from_deg: float,
    noise_factor: float,
    start_time_utc_us: int,
    truth_path: Path | None,
) -> JsbsimVehicle:
    """Make vehicle 1, 2, 3, ... of a farm.

    `home` is latitude [deg], longitude [deg], altitude above mean sea level [m] and heading
    [deg]; None is the simulation's home, where the vehicles stand side by side. The GNSS receiver
    tells `start_time_utc_us` [us since 1970] at time zero.

    Raises:
        ValueError: if a value is out of range.
        OSError: if the truth log cannot be created.
    """
    config = SimulationConfig(
        seed=seed,
        wind_speed_m_s=wind_m_s,
        wind_from_deg=wind_from_deg,
        sensor_noise_factor=noise_factor,
        start_time_utc_us=start_time_utc_us,
        truth_log_path=truth_path,
    )
    if home is None:
        config = replace(config, start_east_m=start_east_m(number))
    else:
        latitude, longitude, altitude, heading = home
        config = replace(
            config,
            home_latitude_deg=latitude,
            home_longitude_deg=longitude,
            home_altitude_amsl_m=altitude,
            heading_deg=heading,
        )
    return JsbsimVehicle(Simulation(config))
