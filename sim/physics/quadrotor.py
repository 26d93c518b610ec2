"""JSBSim's bundled F450 quadrotor behind SI units; the only file that imports jsbsim.

The airframe comes out of the installed jsbsim package (`sim.physics.airframe`). What its files
leave to be wished is put right here by properties at run time:

* Its gear units are wheels (`BOGEY`) that roll with a coefficient of 0.02, so that a 6 m/s
  breeze pushes the vehicle away. A skid does not roll: rolling friction is set to the
  file's static friction, 0.8.
* There is no contact point but the three feet; they bear any blow, and their springs, which
  act along the body's axis, catapult a vehicle that has tipped over. So a vehicle that comes
  to the ground at more than 6 m/s or 60 degrees of tilt, or with its body, lies there for good
  (`Quadrotor.wrecked`). Its accelerometers feel the blow that stops it.

JSBSim turns the attitude by the rate at the start of each step (explicit Euler), so that the
gyros' readings do not add up to it. Its second-order integrator (Buss, "Accurate and efficient
simulation of rigid-body rotations", 2000) is chosen instead.

Errors:
    AirframeError: JSBSim cannot load, initialise or run the airframe.
    MotorCommandError(ValueError): a motor command is no finite number.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Final

import jsbsim

from sim.config import SimulationConfig
from sim.physics import properties
from sim.physics.airframe import AIRFRAME, extended_airframe
from sim.physics.earth import degrees_per_metre, wrapped_longitude_deg
from sim.physics.rotor_effects import ground_effect_factor, rotor_drag
from sim.physics.state_reader import StateReader
from sim.physics.truth import Motors, Quaternion, Truth, Vector3, body_from_ned
from sim.physics.units import METRES_PER_FOOT, NEWTONS_PER_POUND

RATED_VOLTAGE_V: Final = 14.63
"""Voltage [V] at the motors at full command: `maxvolts` of the airframe's DJI E305."""

_STANDING_HEIGHT_M: Final = 0.1507  # Centre of gravity above ground, gear compressed
_SETTLING_TIME_S: Final = 2.0  # The contact springs come to rest within 1.5 s
_REACH_FT: Final = 0.21 / METRES_PER_FOOT  # From the centre of gravity to a foot
_FAR_UP_FT: Final = 10.0  # Above the level of the ground: no foot reaches it
_HARDEST_LANDING_M_S: Final = 6.0  # More breaks a light airframe
_TIPPED_OVER_COSINE: Final = 0.5  # 60 degrees, past the tipping point
_WRECK_HEIGHT_M: Final = 0.06  # Lower than a landing that the feet bear
_BLOW_S: Final = 0.02  # In which a wreck loses its velocity: 6 m/s over 6 cm of arms and feet
_GRAVITY_M_S2: Final = 9.81  # For a wreck at rest only; flight uses JSBSim's gravity
_NEWTON_METRES_PER_POUND_FOOT: Final = NEWTONS_PER_POUND * METRES_PER_FOOT
_ALL_ENGINES: Final = -1.0
_BUSS_SECOND_ORDER: Final = 7.0


class AirframeError(Exception):
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


class Quadrotor:
    """One airframe standing on the ground, its motors stopped, ready for the first step.

    Raises:
        AirframeError: if the installed jsbsim does not hold a usable F450.
    """

    def __init__(self, config: SimulationConfig) -> None:
        fdm = _load_airframe(1.0 / config.physics_rate_hz)
        _initialise(fdm, config)
        self._state = StateReader(
            lambda path: _node(fdm, path).get_double_value,
            ground_amsl_m=config.home_altitude_amsl_m,
        )
        self._run = fdm.run
        self._height_above_ground_ft = _node(
            fdm, properties.HEIGHT_ABOVE_GROUND_FT
        ).get_double_value
        self._altitude_ft = _node(fdm, properties.ALTITUDE_GEODETIC_FT).get_double_value
        self._far_up_ft = config.home_altitude_amsl_m / METRES_PER_FOOT + _FAR_UP_FT
        self._set_motors = _setters(fdm, properties.ESC_COMMANDS_NORM)
        self._set_wind = _setters(fdm, properties.WIND_NED_FPS)
        self._motors: Motors = (0.0, 0.0, 0.0, 0.0)
        self._wreck: Truth | None = None
        self._blow_frd: Vector3 = (0.0, 0.0, 0.0)  # [m/s^2] On top of the weight, at the impact
        self._blow_steps = 0  # Physics steps for which it still lasts
        self._all_blow_steps = round(_BLOW_S * config.physics_rate_hz)
        (
            self._set_drag_forward,
            self._set_drag_right,
            self._set_yaw_brake,
            self._set_ground_lift,
        ) = _setters(
            fdm,
            (
                properties.ROTOR_DRAG_FORWARD_LBS,
                properties.ROTOR_DRAG_RIGHT_LBS,
                properties.ROTOR_DRAG_LBFFT,
                properties.GROUND_EFFECT_LBS,
            ),
        )
        self._ground_effect = config.ground_effect
        self.advance(round(_SETTLING_TIME_S * config.physics_rate_hz))

    def command(self, motors: Motors) -> None:
        """Command the ESCs, 0 stopped to 1 rated voltage; beyond that they saturate.

        Raises:
            MotorCommandError: when a command is no finite number; nothing is changed.
        """
        if not math.isfinite(motors[0] + motors[1] + motors[2] + motors[3]):
            raise MotorCommandError(f"motor commands must be finite, not {motors}")
        self._motors = motors
        one, two, three, four = self._set_motors
        one(motors[0])  # JSBSim's actuators clip to 0 and 1
        two(motors[1])
        three(motors[2])
        four(motors[3])

    def set_wind(self, wind_ned: Vector3) -> None:
        """Velocity [m/s, NED] of the air that the vehicle flies in."""
        north, east, down = self._set_wind
        north(wind_ned[0] / METRES_PER_FOOT)
        east(wind_ned[1] / METRES_PER_FOOT)
        down(wind_ned[2] / METRES_PER_FOOT)

    def set_rotor_effects(self, truth: Truth) -> None:
        """Let the rotors drag in the air and feel the ground, as the truth is.

        The forces are held for a control step, 4 ms: they change the velocity by a third of it
        in a second.
        """
        state = self._state
        forward_n, right_n, yaw_nm = rotor_drag(
            truth.rotor_rpm, state.air_velocity_frd(), truth.rate_frd, state.density_kg_m3()
        )
        self._set_drag_forward(forward_n / NEWTONS_PER_POUND)
        self._set_drag_right(right_n / NEWTONS_PER_POUND)
        self._set_yaw_brake(yaw_nm / _NEWTON_METRES_PER_POUND_FOOT)
        if self._ground_effect:
            more = ground_effect_factor(state.height_above_ground_m()) - 1.0
            self._set_ground_lift(more * state.thrust_lbs())

    def advance(self, steps: int) -> None:
        """Let `steps` physics steps pass.

        Raises:
            AirframeError: if JSBSim ends the simulation.
        """
        if self._wreck is not None:
            self._blow_steps -= steps
            return
        run, altitude_ft, height_ft = self._run, self._altitude_ft, self._height_above_ground_ft
        far_up_ft = self._far_up_ft
        for left in reversed(range(steps)):
            if not run():
                raise AirframeError("JSBSim ended the simulation")
            # JSBSim keeps the altitude; the height above the ground it works out when asked
            if altitude_ft() < far_up_ft and height_ft() < _REACH_FT and self._hits_ground():
                self._wreck = self._lying_still()
                self._blow_steps = self._all_blow_steps - left
                return

    def _hits_ground(self) -> bool:
        """Whether the body is down, or the feet come down too fast or too far from upright."""
        return (
            self._state.height_above_ground_m() < _WRECK_HEIGHT_M
            or self._state.sink_rate_m_s() > _HARDEST_LANDING_M_S
            or self._state.cosine_of_tilt() < _TIPPED_OVER_COSINE
        )

    @property
    def wrecked(self) -> bool:
        """Whether the vehicle has hit the ground too hard or not with its feet."""
        return self._wreck is not None

    def truth(self, time_us: int) -> Truth:
        """The state now, said to be at `time_us`."""
        if self._wreck is None:
            return self._state.truth(time_us)
        weight = self._wreck.specific_force_frd
        if self._blow_steps <= 0:
            return self._wreck.lying_still(time_us, weight)
        forward, right, down = self._blow_frd
        felt = (weight[0] + forward, weight[1] + right, weight[2] + down)
        return self._wreck.lying_still(time_us, felt)

    def motor_power_w(self) -> float:
        """Electrical power [W] that the four motors draw: each its voltage times its current."""
        if self._wreck is not None:
            return 0.0
        return RATED_VOLTAGE_V * sum(self.motor_currents_a())

    def motor_currents_a(self) -> Motors:
        """Current [A] that each motor draws at the rated voltage: its share of on-time."""
        if self._wreck is not None:
            return (0.0, 0.0, 0.0, 0.0)
        one, two, three, four = self._state.motor_currents_a()
        duty_1, duty_2, duty_3, duty_4 = self._motors
        # The usual case first: min and max cost more than all the rest.
        usual = 0.0 <= duty_1 <= 1.0 and 0.0 <= duty_2 <= 1.0
        if not (usual and 0.0 <= duty_3 <= 1.0 and 0.0 <= duty_4 <= 1.0):
            duty_1, duty_2 = min(max(duty_1, 0.0), 1.0), min(max(duty_2, 0.0), 1.0)
            duty_3, duty_4 = min(max(duty_3, 0.0), 1.0), min(max(duty_4, 0.0), 1.0)
        return (duty_1 * one, duty_2 * two, duty_3 * three, duty_4 * four)

    def _lying_still(self) -> Truth:
        """The state of a wreck: where and how it hit the ground, at rest, rotors stopped."""
        last = self._state.truth(0)
        north, east, down = last.velocity_ned
        stop_ned = (-north / _BLOW_S, -east / _BLOW_S, -down / _BLOW_S)
        self._blow_frd = body_from_ned(last.q_ned_frd, stop_ned)
        return last.lying_still(0, _weight_on_ground(last.q_ned_frd))


def _weight_on_ground(q_ned_frd: Quaternion) -> Vector3:
    return body_from_ned(q_ned_frd, (0.0, 0.0, -_GRAVITY_M_S2))


def _load_airframe(step_s: float) -> jsbsim.FGFDMExec:
    jsbsim.set_logger(_SILENCE)
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    fdm.set_debug_level(0)
    fdm.set_dt(step_s)
    try:
        with extended_airframe(Path(fdm.get_root_dir()) / "aircraft") as folder:
            fdm.set_aircraft_path(str(folder))
            loaded = fdm.load_model(AIRFRAME)
    except OSError as error:
        raise AirframeError(f"{AIRFRAME} cannot be read: {error}") from error
    if not loaded:
        raise AirframeError(f"the installed jsbsim {jsbsim.__version__} has no usable {AIRFRAME}")
    return fdm


def _initialise(fdm: jsbsim.FGFDMExec, config: SimulationConfig) -> None:
    """Stand on the ground at the start place, nose to the heading, engines able to run."""
    east_deg = degrees_per_metre(config.home_latitude_deg, config.home_altitude_amsl_m).east
    fdm[properties.IC_LATITUDE_GEODETIC_DEG] = config.home_latitude_deg
    fdm[properties.IC_LONGITUDE_DEG] = wrapped_longitude_deg(
        config.home_longitude_deg + config.start_east_m * east_deg
    )
    fdm[properties.IC_TERRAIN_ELEVATION_FT] = config.home_altitude_amsl_m / METRES_PER_FOOT
    fdm[properties.IC_HEIGHT_ABOVE_GROUND_FT] = _STANDING_HEIGHT_M / METRES_PER_FOOT
    fdm[properties.IC_HEADING_TRUE_DEG] = config.heading_deg
    if not fdm.run_ic():
        raise AirframeError(f"JSBSim refused the initial conditions of {config}")
    fdm[properties.ROTATION_INTEGRATOR] = _BUSS_SECOND_ORDER
    fdm[properties.SET_RUNNING] = _ALL_ENGINES
    for unit in range(round(fdm[properties.GEAR_UNITS])):
        skid = fdm[properties.STATIC_FRICTION.format(unit)]
        fdm[properties.ROLLING_FRICTION.format(unit)] = skid


def _setters(fdm: jsbsim.FGFDMExec, paths: tuple[str, ...]) -> list[Callable[[float], bool]]:
    return [_node(fdm, path).set_double_value for path in paths]


def _node(fdm: jsbsim.FGFDMExec, path: str) -> jsbsim.FGPropertyNode:
    node = fdm.get_property_manager().get_node(path)
    if node is None:
        raise AirframeError(f"{AIRFRAME} of jsbsim {jsbsim.__version__} has no property {path}")
    return node
