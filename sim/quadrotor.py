"""JSBSim's bundled F450 quadrotor behind SI units; the only file that imports jsbsim.

The airframe comes out of the installed jsbsim package unchanged. What its files leave to be
wished is put right here by properties at run time:

* Its gear units are wheels (`BOGEY`) that roll with a coefficient of 0.02, so that a 6 m/s
  breeze pushes the vehicle away. A skid does not roll: rolling friction is set to the
  file's static friction, 0.8.
* There is no contact point but the three feet. A vehicle whose centre of gravity comes to
  the ground lies there for good (`Quadrotor.wrecked`) instead of sinking into it.

Errors:
    AirframeError(RuntimeError): JSBSim cannot load, initialise or run the airframe.
    MotorCommandError(ValueError): a motor command is no finite number.
"""

import math
from collections.abc import Callable
from typing import Final

import jsbsim

from sim import properties
from sim.config import SimulationConfig
from sim.earth import degrees_per_metre
from sim.truth import Motors, Quaternion, Truth, Vector3, body_from_ned, quaternion_from_euler
from sim.units import (
    KILOGRAMS_PER_SLUG,
    METRES_PER_FOOT,
    NEWTONS_PER_POUND,
    PASCALS_PER_PSF,
    celsius_from_rankine,
)

AIRFRAME: Final = "F450"
RATED_VOLTAGE_V: Final = 14.63
"""Voltage [V] at the motors at full command: `maxvolts` of the airframe's DJI E305."""

_STANDING_HEIGHT_M: Final = 0.1507  # Centre of gravity above ground, gear compressed
_SETTLING_TIME_S: Final = 2.0  # The contact springs come to rest within 1.5 s
_WRECK_HEIGHT_M: Final = 0.06  # Lower than any hard landing that the feet bear
_GRAVITY_M_S2: Final = 9.81  # For a wreck at rest only; flight uses JSBSim's gravity
_ALL_ENGINES: Final = -1.0


class AirframeError(RuntimeError):
    """JSBSim refused to load, initialise or run the airframe."""


class MotorCommandError(ValueError):
    """A motor command is no finite number."""


class _Silence(jsbsim.FGLogger):
    """Keeps JSBSim's banner and its remarks on the airframe file off the console.

    What matters comes back as a return value and is raised as `AirframeError`.
    """

    def set_level(self, level: jsbsim.LogLevel) -> None:
        """Ignore the level of a record."""

    def file_location(self, filename: str, line: int) -> None:
        """Ignore where a record comes from."""

    def message(self, message: str) -> None:
        """Drop a record."""

    def format(self, format: jsbsim.LogFormat) -> None:  # noqa: A002  JSBSim names it so
        """Ignore formatting."""

    def flush(self) -> None:
        """End a record."""


_SILENCE: Final = _Silence()  # JSBSim keeps no reference of its own

_Getter = Callable[[], float]
_Setter = Callable[[float], bool]


class Quadrotor:
    """One airframe standing on the ground, its motors stopped, ready for the first step.

    Raises:
        AirframeError: if the installed jsbsim does not hold a usable F450.
    """

    def __init__(self, config: SimulationConfig) -> None:
        self._ground_m = config.home_altitude_amsl_m
        self._step_s = 1.0 / config.physics_rate_hz
        self._fdm = _load_airframe(self._step_s)
        _initialise(self._fdm, config)
        self._bind_properties()
        self._mass_kg = self._getter(properties.MASS_SLUGS)() * KILOGRAMS_PER_SLUG
        self._wreck: Truth | None = None
        self._motors: Motors = (0.0, 0.0, 0.0, 0.0)
        self.advance(round(_SETTLING_TIME_S * config.physics_rate_hz))

    def command(self, motors: Motors) -> None:
        """Command the ESCs, 0 stopped to 1 rated voltage; beyond that they saturate.

        Raises:
            MotorCommandError: when a command is no finite number; nothing is changed.
        """
        if not math.isfinite(motors[0] + motors[1] + motors[2] + motors[3]):
            raise MotorCommandError(f"motor commands must be finite, not {motors}")
        self._motors = motors
        for setter, motor in zip(self._set_motors, motors, strict=True):
            setter(motor)  # JSBSim's actuators clip to 0 and 1

    def set_wind(self, wind_ned: Vector3) -> None:
        """Velocity [m/s, NED] of the air that the vehicle flies in."""
        for setter, component in zip(self._set_wind, wind_ned, strict=True):
            setter(component / METRES_PER_FOOT)

    def advance(self, steps: int) -> None:
        """Let `steps` physics steps pass.

        Raises:
            AirframeError: if JSBSim ends the simulation.
        """
        if self._wreck is not None:
            return
        for _ in range(steps):
            if not self._run():
                raise AirframeError("JSBSim ended the simulation")
        if self._height_above_ground_ft() * METRES_PER_FOOT < _WRECK_HEIGHT_M:
            self._wreck = self._lying_still()

    @property
    def wrecked(self) -> bool:
        """Whether the vehicle has hit the ground with anything but its feet."""
        return self._wreck is not None

    def truth(self, time_us: int) -> Truth:
        """The state now, said to be at `time_us`."""
        return (
            self._flying(time_us) if self._wreck is None else self._wreck._replace(time_us=time_us)
        )

    def motor_power_w(self) -> float:
        """Electrical power [W] that the four motors draw: each its voltage times its current."""
        if self._wreck is not None:
            return 0.0
        power = 0.0
        for motor, current in zip(self._motors, self._get_current, strict=True):
            power += min(max(motor, 0.0), 1.0) * RATED_VOLTAGE_V * current()
        return power

    def _getter(self, path: str) -> _Getter:
        return _node(self._fdm, path).get_double_value

    def _getters(self, paths: tuple[str, ...]) -> tuple[_Getter, ...]:
        return tuple(self._getter(path) for path in paths)

    def _setters(self, paths: tuple[str, ...]) -> tuple[_Setter, ...]:
        return tuple(_node(self._fdm, path).set_double_value for path in paths)

    def _bind_properties(self) -> None:
        """Look every property up once: a bound method costs 40 ns, a path lookup more."""
        engines = range(4)
        self._run = self._fdm.run
        self._set_motors = self._setters(properties.ESC_COMMANDS_NORM)
        self._set_wind = self._setters(properties.WIND_NED_FPS)
        self._latitude_deg = self._getter(properties.LATITUDE_GEODETIC_DEG)
        self._longitude_deg = self._getter(properties.LONGITUDE_DEG)
        self._altitude_ft = self._getter(properties.ALTITUDE_GEODETIC_FT)
        self._height_above_ground_ft = self._getter(properties.HEIGHT_ABOVE_GROUND_FT)
        self._airspeed_fps = self._getter(properties.TRUE_AIRSPEED_FPS)
        self._pressure_psf = self._getter(properties.PRESSURE_PSF)
        self._temperature_r = self._getter(properties.TEMPERATURE_R)
        self._get_velocity = self._getters(properties.VELOCITY_NED_FPS)
        self._get_attitude = self._getters(properties.ATTITUDE_RAD)
        self._get_rate = self._getters(properties.RATE_FRD_RAD_S)
        self._get_inertial_rate = self._getters(properties.INERTIAL_RATE_FRD_RAD_S)
        self._get_force = self._getters(
            properties.AERODYNAMIC_FORCE_FRD_LBS
            + properties.PROPULSIVE_FORCE_FRD_LBS
            + properties.GEAR_FORCE_FRD_LBS
        )
        self._get_rpm = self._getters(
            tuple(properties.ROTOR_SPEED_RPM.format(engine) for engine in engines)
        )
        self._get_current = self._getters(
            tuple(properties.MOTOR_CURRENT_A.format(engine) for engine in engines)
        )

    def _specific_force(self) -> Vector3:
        """Everything but gravity that pushes the vehicle, over its mass [m/s^2, FRD].

        JSBSim's own accelerometer component lags this by one physics step, because it runs
        before the forces of its step are known.
        """
        ax, ay, az, px, py, pz, gx, gy, gz = self._get_force
        scale = NEWTONS_PER_POUND / self._mass_kg
        return (
            (ax() + px() + gx()) * scale,
            (ay() + py() + gy()) * scale,
            (az() + pz() + gz()) * scale,
        )

    def _flying(self, time_us: int) -> Truth:
        get_roll, get_pitch, get_yaw = self._get_attitude
        roll, pitch, yaw = get_roll(), get_pitch(), get_yaw()
        north, east, down = self._get_velocity
        p, q, r = self._get_rate
        pi, qi, ri = self._get_inertial_rate
        rotor_1, rotor_2, rotor_3, rotor_4 = self._get_rpm
        altitude_m = self._altitude_ft() * METRES_PER_FOOT
        return Truth(
            time_us,
            self._latitude_deg(),
            self._longitude_deg(),
            altitude_m,
            altitude_m - self._ground_m,
            (north() * METRES_PER_FOOT, east() * METRES_PER_FOOT, down() * METRES_PER_FOOT),
            quaternion_from_euler(roll, pitch, yaw),
            math.degrees(roll),
            math.degrees(pitch),
            math.degrees(yaw),
            (p(), q(), r()),
            (pi(), qi(), ri()),
            self._specific_force(),
            (rotor_1(), rotor_2(), rotor_3(), rotor_4()),
            self._airspeed_fps() * METRES_PER_FOOT,
            self._pressure_psf() * PASCALS_PER_PSF,
            celsius_from_rankine(self._temperature_r()),
        )

    def _lying_still(self) -> Truth:
        """The state of a wreck: where and how it hit the ground, at rest, rotors stopped."""
        last = self._flying(0)
        still = (0.0, 0.0, 0.0)
        return last._replace(
            velocity_ned=still,
            rate_frd=still,
            inertial_rate_frd=still,
            specific_force_frd=_weight_on_ground(last.q_ned_frd),
            rotor_rpm=(0.0, 0.0, 0.0, 0.0),
        )


def _weight_on_ground(q_ned_frd: Quaternion) -> Vector3:
    return body_from_ned(q_ned_frd, (0.0, 0.0, -_GRAVITY_M_S2))


def _load_airframe(step_s: float) -> jsbsim.FGFDMExec:
    jsbsim.set_logger(_SILENCE)
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    fdm.set_debug_level(0)
    fdm.set_dt(step_s)
    if not fdm.load_model(AIRFRAME):
        raise AirframeError(f"the installed jsbsim {jsbsim.__version__} has no usable {AIRFRAME}")
    return fdm


def _initialise(fdm: jsbsim.FGFDMExec, config: SimulationConfig) -> None:
    """Stand on the ground at the start place, nose to the heading, engines able to run."""
    east_deg = degrees_per_metre(config.home_latitude_deg, config.home_altitude_amsl_m).east
    fdm[properties.IC_LATITUDE_GEODETIC_DEG] = config.home_latitude_deg
    fdm[properties.IC_LONGITUDE_DEG] = config.home_longitude_deg + config.start_east_m * east_deg
    fdm[properties.IC_TERRAIN_ELEVATION_FT] = config.home_altitude_amsl_m / METRES_PER_FOOT
    fdm[properties.IC_HEIGHT_ABOVE_GROUND_FT] = _STANDING_HEIGHT_M / METRES_PER_FOOT
    fdm[properties.IC_HEADING_TRUE_DEG] = config.heading_deg
    if not fdm.run_ic():
        raise AirframeError(f"JSBSim refused the initial conditions of {config}")
    fdm[properties.SCAS_ENGAGE] = 0.0
    fdm[properties.SET_RUNNING] = _ALL_ENGINES
    for unit in range(round(fdm[properties.GEAR_UNITS])):
        skid = fdm[properties.STATIC_FRICTION.format(unit)]
        fdm[properties.ROLLING_FRICTION.format(unit)] = skid


def _node(fdm: jsbsim.FGFDMExec, path: str) -> jsbsim.FGPropertyNode:
    node = fdm.get_property_manager().get_node(path)
    if node is None:
        raise AirframeError(f"{AIRFRAME} of jsbsim {jsbsim.__version__} has no property {path}")
    return node
