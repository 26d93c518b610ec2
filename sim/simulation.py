"""One simulated vehicle: motor commands in, a control step of physics, readings out.

There is no clock here: time passes only in `Simulation.step`, and whoever calls it decides
how fast.
"""

from typing import Final

from sim.config import SimulationConfig
from sim.fault_schedule import LASTING, Fault, FaultSchedule, Kind
from sim.faults.effects import HEALTHY, FaultEffects
from sim.physics.noise import generators
from sim.physics.quadrotor import RATED_VOLTAGE_V, Quadrotor
from sim.physics.truth import Motors, Truth, Vector3
from sim.physics.truth_log import TruthLog
from sim.physics.wind import Wind
from sim.sensors import environment
from sim.sensors.battery import DRAW_RATE_HZ
from sim.sensors.environment import EnvironmentSensors
from sim.sensors.readings import Readings
from sim.sensors.suite import Schedule, SensorSuite
from sim.world.farm import Farm
from sim.world.plane import Plane
from sim.world.sun import day_shift_s

_STILL: Final[Vector3] = (0.0, 0.0, 0.0)


class Simulation:
    """A vehicle standing on the ground at time zero, its instruments already read once.

    The ESCs hold the commanded share of the rated voltage whatever the pack's voltage is; a
    weak pack lowers the ceiling, an empty one stops the motors.

    Raises:
        sim.physics.quadrotor.AirframeError: if JSBSim cannot load the airframe.
        OSError: if the truth log cannot be created.
    """

    def __init__(self, config: SimulationConfig) -> None:
        self.config = config
        self._substeps = config.physics_rate_hz // config.control_rate_hz
        self._step_us = config.step_us
        self._draw_schedule = Schedule(DRAW_RATE_HZ, first_us=1_000_000 // DRAW_RATE_HZ)
        self._quadrotor = Quadrotor(config)
        self._suite = SensorSuite(config)
        self._faults = FaultSchedule(config.faults)
        self._effects = FaultEffects()
        self._next_fault_us = 0
        self._motors_weak = False
        self._begun: list[Fault] = []
        self._wind = Wind(
            generators(config.seed)["wind"],
            speed_m_s=config.wind_speed_m_s,
            from_deg=config.wind_from_deg,
            gusts=config.gusts,
            step_s=1.0 / config.control_rate_hz,
        )
        self._update_faults(0)
        self._log = None if config.truth_log_path is None else TruthLog(config.truth_log_path)
        self.farm = _farm(config)
        plane, start_s = self.farm.plane, config.start_time_utc_us * 1e-6
        shift_s = day_shift_s(plane.latitude_deg, plane.longitude_deg, start_s)
        self._farm_start_s = start_s + shift_s
        self._environment = EnvironmentSensors(
            generators(config.seed)["environment"], self.farm, factor=config.sensor_noise_factor
        )
        self._environment_schedule = Schedule(environment.RATE_HZ, first_us=24_000)
        self.truth: Truth = self._quadrotor.truth(0)
        self.readings: Readings = self._observe()

    @property
    def time_us(self) -> int:
        """Simulated time [us] since the start."""
        return self.truth.time_us

    @property
    def farm_time_s(self) -> float:
        """Time on the farm [s since 1970]: UTC, or daylight (`sim/world/sun.py`)."""
        return self._farm_start_s + self.truth.time_us * 1e-6

    @property
    def wrecked(self) -> bool:
        """Whether the vehicle has hit the ground too hard or not with its feet."""
        return self._quadrotor.wrecked

    def step(self, motors: Motors) -> Readings:
        """Let one control step pass with these motor commands, 0 stopped to 1 full.

        Raises:
            sim.physics.quadrotor.MotorCommandError: when a command is no finite number; no time
                passes then.
            OSError: if the truth log cannot be written.
        """
        truth = self.truth
        time_us = truth.time_us
        if time_us >= self._next_fault_us:
            self._update_faults(time_us)
        motors = self._within_supply(motors)
        self._quadrotor.command(self._effects.motors(motors) if self._motors_weak else motors)
        self._quadrotor.set_rotor_effects(truth)
        if not self._wind.calm:
            self._set_wind(self._wind.step(truth.height_above_home_m, truth.airspeed_m_s))
        self._quadrotor.advance(self._substeps)
        time_us += self._step_us
        self.truth = self._quadrotor.truth(time_us)
        if self._draw_schedule.due(time_us):
            self._suite.battery.draw(self._quadrotor.motor_power_w(), 1.0 / DRAW_RATE_HZ)
        self.readings = self._observe()
        return self.readings

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Faults that act now."""
        return self._faults.active(self.truth.time_us)

    @property
    def battery_charge(self) -> float:
        """True charge of the pack, 0 empty to 1 full; no instrument reads it."""
        return self._suite.battery.charge

    @property
    def link_lost(self) -> bool:
        """Whether a fault cuts the vehicle off from its peers."""
        return self._effects.link_lost

    @property
    def camera_failed(self) -> bool:
        """Whether a fault keeps the camera from exposing."""
        return self._effects.camera_failed

    def add_fault(self, fault: Fault) -> None:
        """Let something break, now or later."""
        self._faults.add(fault)
        self._update_faults(self.truth.time_us)

    def clear_faults(
        self, kind: Kind | None = None, motor: int | None = None, instance: int | None = None
    ) -> None:
        """Mend what is broken, and what would break: of a kind, of a motor, an instance, or all."""
        self._faults.clear(self.truth.time_us, kind, motor, instance)
        self._update_faults(self.truth.time_us)

    def close(self) -> None:
        """Close the truth log; a second call does nothing."""
        if self._log is not None:
            self._log.close()

    def _within_supply(self, motors: Motors) -> Motors:
        ceiling = self._suite.battery.voltage_v / RATED_VOLTAGE_V
        if ceiling >= 1.0:
            return motors
        front_right, rear_left, front_left, rear_right = motors
        return (
            min(front_right, ceiling),
            min(rear_left, ceiling),
            min(front_left, ceiling),
            min(rear_right, ceiling),
        )

    def _observe(self) -> Readings:
        truth = self.truth
        if self._log is not None:
            self._log.record(truth)
        readings = self._suite.read(truth, self._quadrotor.motor_currents_a)
        if self._environment_schedule.due(truth.time_us):
            sample = self._environment.read(truth, self.farm_time_s)
            readings = readings.with_environment(sample)
        return self._effects.readings(readings) if self._effects.touches_readings else readings

    def _set_wind(self, wind_ned: Vector3) -> None:
        gust = self._effects.gust_ned
        self._quadrotor.set_wind(
            (wind_ned[0] + gust[0], wind_ned[1] + gust[1], wind_ned[2] + gust[2])
        )

    def _update_faults(self, now_us: int) -> None:
        """Let the faults of this instant act."""
        active = self._faults.active(now_us)
        self._next_fault_us = self._faults.next_change_us(now_us)
        self._effects.take(active)
        self._motors_weak = self._effects.efficiencies != HEALTHY
        if self._wind.calm:
            self._set_wind(_STILL)
        for fault in active:
            if fault.kind in LASTING and fault not in self._begun:
                self._begun.append(fault)
                self._strike_battery(fault)

    def _strike_battery(self, fault: Fault) -> None:
        if fault.kind is Kind.BATTERY_LOW:
            self._suite.battery.set_charge(fault.values["charge"])
        else:
            self._suite.battery.fail_cells(
                round(fault.values["cells"]), fault.values["charge_lost"]
            )


def _farm(config: SimulationConfig) -> Farm:
    home = (config.home_latitude_deg, config.home_longitude_deg, config.home_altitude_amsl_m)
    return Farm(config.farm_seed, Plane(*(config.farm_origin or home)))
