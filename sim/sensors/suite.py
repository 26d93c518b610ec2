"""All instruments of one vehicle, each read when it is due."""

from collections.abc import Callable
from typing import Final

from sim.config import SimulationConfig
from sim.gnss_receivers import GNSS_RECEIVERS
from sim.physics.magnetic_field import decimal_year, field_ned_gauss
from sim.physics.noise import generators
from sim.physics.truth import Motors, Truth, Vector3
from sim.sensors import baro, battery, esc, gps, magnetometer, rangefinder
from sim.sensors.baro import Barometer
from sim.sensors.battery import Battery
from sim.sensors.esc import EscTelemetry
from sim.sensors.gps import Gps
from sim.sensors.imu import Imu
from sim.sensors.magnetometer import Magnetometer
from sim.sensors.rangefinder import RangeFinder
from sim.sensors.readings import BaroReading, EscReading, ImuReading, MagReading, Readings

_MICROSECONDS_PER_SECOND: Final = 1_000_000


class Schedule:
    """Says when a periodic sample is due: at `first_us` and every period after it."""

    __slots__ = ("_period_us", "next_us")

    def __init__(self, rate_hz: int, *, first_us: int = 0) -> None:
        self._period_us = _MICROSECONDS_PER_SECOND // rate_hz
        self.next_us = first_us

    def due(self, time_us: int) -> bool:
        """Whether a sample is due at `time_us`; says so once per period."""
        if time_us < self.next_us:
            return False
        self.next_us += self._period_us
        return True


class SensorSuite:
    """Instruments on a common clock, with noise from one seed.

    Their first samples are some milliseconds apart, as instruments that are independent of each
    other would take them; that also keeps their work out of the same control step.
    """

    def __init__(self, config: SimulationConfig) -> None:
        streams = generators(config.seed)
        factor = config.sensor_noise_factor
        self.imus = tuple(
            Imu(streams[name], rate_hz=config.control_rate_hz, factor=factor)
            for name in _names("imu", config.imus)
        )
        self.baros = tuple(
            Barometer(streams[name], factor=factor) for name in _names("baro", config.barometers)
        )
        field = _field_at_home(config)
        self.magnetometers = tuple(
            Magnetometer(
                streams[name],
                factor=factor,
                field_ned_gauss=field,
                supply_current_a=lambda: self.battery.current_a,
            )
            for name in _names("magnetometer", config.compasses)
        )
        self._no_baros = (None,) * config.barometers
        self._no_mags = (None,) * config.compasses
        self.gps = Gps(
            streams["gps"],
            GNSS_RECEIVERS[config.gps],
            factor=factor,
            start_time_utc_us=config.start_time_utc_us,
        )
        self.battery = Battery(
            streams["battery"],
            capacity_ah=config.battery_capacity_ah,
            initial_charge=config.battery_initial_charge,
            factor=factor,
        )
        self._baro_schedule = Schedule(baro.RATE_HZ, first_us=4_000)
        self._mag_schedule = Schedule(magnetometer.RATE_HZ, first_us=8_000)
        self._gps_schedule = Schedule(gps.RATE_HZ, first_us=12_000)
        self._battery_schedule = Schedule(battery.RATE_HZ, first_us=16_000)
        self.esc = EscTelemetry(streams["esc"], factor=factor)
        self._esc_schedule = Schedule(esc.RATE_HZ)
        self.rangefinder = RangeFinder(streams["rangefinder"], factor=factor)
        self._range_schedule = Schedule(rangefinder.RATE_HZ, first_us=20_000)
        self._next_us = 0

    def read(self, truth: Truth, motor_currents_a: Callable[[], Motors]) -> Readings:
        """Every reading that is due at the instant of the truth.

        `motor_currents_a` gives what each motor draws from the pack; asked for when needed.
        """
        time_us = truth.time_us
        if time_us < self._next_us:  # The inertial units, and every other time the controllers
            esc = self._esc(truth, motor_currents_a)
            imus, no_baros, no_mags = self._imus(truth), self._no_baros, self._no_mags
            return Readings(imus, no_baros, no_mags, None, None, esc, None, None, only_fast=True)
        if self._gps_schedule.due(time_us):
            self.gps.measure(truth)
        readings = Readings(
            self._imus(truth),
            self._baros(truth) if self._baro_schedule.due(time_us) else self._no_baros,
            self._mags(truth) if self._mag_schedule.due(time_us) else self._no_mags,
            self.gps.deliver(time_us),
            self.battery.read(time_us) if self._battery_schedule.due(time_us) else None,
            self._esc(truth, motor_currents_a),
            self.rangefinder.read(truth) if self._range_schedule.due(time_us) else None,
        )
        self._next_us = self._soonest_us()
        return readings

    def _imus(self, truth: Truth) -> tuple[ImuReading, ...]:
        rate_sigma, force_sigma = self.imus[0].sigmas(truth)
        return tuple([imu.sample(truth, rate_sigma, force_sigma) for imu in self.imus])

    def _baros(self, truth: Truth) -> tuple[BaroReading, ...]:
        return tuple([baro.read(truth) for baro in self.baros])

    def _mags(self, truth: Truth) -> tuple[MagReading, ...]:
        return tuple([magnetometer.read(truth) for magnetometer in self.magnetometers])

    def _esc(self, truth: Truth, motor_currents_a: Callable[[], Motors]) -> EscReading | None:
        due = self._esc_schedule.due(truth.time_us)
        return self.esc.read(truth, motor_currents_a()) if due else None

    def _soonest_us(self) -> int:
        """When one of the slow instruments has something to say next [us]."""
        return min(
            self._baro_schedule.next_us,
            self._mag_schedule.next_us,
            self._gps_schedule.next_us,
            self._battery_schedule.next_us,
            self._range_schedule.next_us,
            self.gps.delivery_us,
        )


def _names(stream: str, count: int) -> list[str]:
    """Random streams of the instances of an instrument; the first has the plain name."""
    return [stream, *(f"{stream}_{instance}" for instance in range(1, count))]


def _field_at_home(config: SimulationConfig) -> Vector3:
    return field_ned_gauss(
        config.home_latitude_deg,
        config.home_longitude_deg,
        config.home_altitude_amsl_m,
        decimal_year(config.start_time_utc_us),
    )
