"""One simulated vehicle: motor commands in, a control step of physics, readings out.

There is no clock here: time passes only in `Simulation.step`, and whoever calls it decides
how fast.
"""

from sim.config import SimulationConfig
from sim.quadrotor import RATED_VOLTAGE_V, Quadrotor
from sim.sensors.battery import DRAW_RATE_HZ
from sim.sensors.noise import generators
from sim.sensors.readings import Readings
from sim.sensors.suite import Schedule, SensorSuite
from sim.truth import Motors, Truth
from sim.truth_log import TruthLog
from sim.wind import Wind


class Simulation:
    """A vehicle standing on the ground at time zero, its instruments already read once.

    The ESCs hold the commanded share of the rated voltage whatever the pack's voltage is; a
    weak pack lowers the ceiling, an empty one stops the motors.

    Raises:
        sim.quadrotor.AirframeError: if JSBSim cannot load the airframe.
        OSError: if the truth log cannot be created.
    """

    def __init__(self, config: SimulationConfig) -> None:
        self.config = config
        self._substeps = config.physics_rate_hz // config.control_rate_hz
        self._draw_schedule = Schedule(DRAW_RATE_HZ, first_us=1_000_000 // DRAW_RATE_HZ)
        self._quadrotor = Quadrotor(config)
        self._suite = SensorSuite(config)
        self._wind = Wind(
            generators(config.seed)["wind"],
            speed_m_s=config.wind_speed_m_s,
            from_deg=config.wind_from_deg,
            gusts=config.gusts,
            step_s=1.0 / config.control_rate_hz,
        )
        self._quadrotor.set_wind(self._wind.mean_ned)
        self._log = None if config.truth_log_path is None else TruthLog(config.truth_log_path)
        self.truth: Truth = self._quadrotor.truth(0)
        self.readings: Readings = self._observe()

    @property
    def time_us(self) -> int:
        """Simulated time [us] since the start."""
        return self.truth.time_us

    @property
    def wrecked(self) -> bool:
        """Whether the vehicle has hit the ground too hard or not with its feet."""
        return self._quadrotor.wrecked

    def step(self, motors: Motors) -> Readings:
        """Let one control step pass with these motor commands, 0 stopped to 1 full.

        Raises:
            sim.quadrotor.MotorCommandError: when a command is no finite number; no time
                passes then.
            OSError: if the truth log cannot be written.
        """
        self._quadrotor.command(self._within_supply(motors))
        if not self._wind.steady:
            self._quadrotor.set_wind(
                self._wind.step(self.truth.height_above_home_m, self.truth.airspeed_m_s)
            )
        self._quadrotor.advance(self._substeps)
        self.truth = self._quadrotor.truth(self.truth.time_us + self.config.step_us)
        if self._draw_schedule.due(self.truth.time_us):
            self._suite.battery.draw(self._quadrotor.motor_power_w(), 1.0 / DRAW_RATE_HZ)
        self.readings = self._observe()
        return self.readings

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
        if self._log is not None:
            self._log.record(self.truth)
        return self._suite.read(self.truth)
