"""The control modules on the simulated airframe, with the truth in place of an estimator.

Separates control from estimation: what a test sees here is the laws' doing alone.
"""

import math
from collections.abc import Callable

from sim.config import SimulationConfig
from sim.physics.truth import Truth
from sim.simulation import Simulation
from uav_firmware.bus import Queue, Topic
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.lib.rotation import rotate
from uav_firmware.modules.attitude_control.module import AttitudeControlModule
from uav_firmware.modules.attitude_control.params import AttitudeControlParams
from uav_firmware.modules.control_allocator.module import ControlAllocatorModule
from uav_firmware.modules.control_allocator.params import ControlAllocatorParams
from uav_firmware.modules.land_detector.module import LandDetectorModule
from uav_firmware.modules.land_detector.params import LandDetectorParams
from uav_firmware.modules.manual_control.params import ManualControlParams
from uav_firmware.modules.position_control.module import PositionControlModule
from uav_firmware.modules.position_control.params import PositionControlParams
from uav_firmware.modules.rate_control.module import RateControlModule
from uav_firmware.modules.rate_control.params import RateControlParams
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.estimate import HoverThrustEstimate, VehicleAttitude, VehicleLocalPosition
from uav_firmware.msg.setpoints import (
    ControlAllocatorStatus,
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
    VehicleTorqueThrustSetpoint,
)
from uav_firmware.msg.status import LandDetected, LandedState, NavigationState, VehicleStatus
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

_METRES_PER_DEGREE = 111_195.0  # only differences of a few metres are judged
_POSITION_EVERY = 4  # control steps between two runs of the position law

Trajectory = Callable[[float, Vector3], TrajectorySetpoint]
"""Setpoint for the time since arming [s] and the present position [m, NED]."""


class ControlBench:
    """A vehicle that is armed when asked and follows any trajectory given."""

    def __init__(self, config: SimulationConfig | None = None) -> None:
        self.simulation = Simulation(config or SimulationConfig(sensor_noise_factor=0.0))
        self.vehicle = JsbsimVehicle(self.simulation)
        self.registry = Registry()
        for group in (
            PositionControlParams,
            AttitudeControlParams,
            RateControlParams,
            ControlAllocatorParams,
            LandDetectorParams,
            ManualControlParams,
        ):
            self.registry.add(group)
        self._make_topics()
        self._make_modules()
        self._start = self.simulation.truth
        self._last_velocity: Vector3 = (0.0, 0.0, 0.0)
        self._steps = 0
        self.set_armed(armed=False)
        self._sense()

    def set_armed(self, *, armed: bool) -> None:
        """Arm or disarm without asking anyone."""
        now_us = self.vehicle.time_us
        self._armed_us = now_us
        self.status.publish(
            VehicleStatus(
                time_us=now_us,
                armed=armed,
                navigation_state=NavigationState.AUTO_MISSION,
                failsafe=False,
                preflight_checks_pass=True,
                armed_since_us=now_us if armed else 0,
                sensors_present=0,
                sensors_enabled=0,
                sensors_health=0,
            )
        )

    def run(
        self, seconds: float, trajectory: Trajectory, watch: Callable[[], None] | None = None
    ) -> None:
        """Fly a trajectory; `watch` is called after every step."""
        for _ in range(round(seconds * 1e6 / self.vehicle.step_us)):
            self._step(trajectory)
            if watch is not None:
                watch()

    @property
    def truth(self) -> Truth:
        """True state."""
        return self.simulation.truth

    @property
    def time_s(self) -> float:
        """Time since arming or disarming."""
        return (self.vehicle.time_us - self._armed_us) * 1e-6

    @property
    def position_ned(self) -> Vector3:
        """True position about the start [m]."""
        truth, start = self.simulation.truth, self._start
        shrink = math.cos(math.radians(start.latitude_deg))
        return (
            (truth.latitude_deg - start.latitude_deg) * _METRES_PER_DEGREE,
            (truth.longitude_deg - start.longitude_deg) * _METRES_PER_DEGREE * shrink,
            start.altitude_amsl_m - truth.altitude_amsl_m,
        )

    @property
    def landed_state(self) -> LandedState:
        """Output of the land detector."""
        land = self.land.value
        return LandedState.UNDEFINED if land is None else land.landed_state

    def _step(self, trajectory: Trajectory) -> None:
        motors = self.motors.value
        if motors is not None:
            self.vehicle.write_motors(motors.control)
        self.vehicle.advance()
        self._sense()
        if self._steps % _POSITION_EVERY == 0:
            self.trajectory.publish(trajectory(self.time_s, self.position_ned))
            self.position_control.update()
            self.land_detector.update()
        self.attitude_control.update()
        self.rate_control.update()
        self.allocator.update(self.vehicle.time_us)
        self._steps += 1

    def _sense(self) -> None:
        """Publish the truth as if it were an estimate."""
        truth = self.simulation.truth
        self.attitude.publish(VehicleAttitude(truth.time_us, truth.q_ned_frd, truth.rate_frd))
        north, east, down = rotate(truth.q_ned_frd, truth.specific_force_frd)
        self.local_position.publish(
            VehicleLocalPosition(
                time_us=truth.time_us,
                position_ned=self.position_ned,
                velocity_ned=truth.velocity_ned,
                acceleration_ned=(north, east, down + 9.80665),
                heading=math.remainder(math.radians(truth.yaw_deg), math.tau),
                origin_latitude_deg=self._start.latitude_deg,
                origin_longitude_deg=self._start.longitude_deg,
                origin_altitude_amsl_m=self._start.altitude_amsl_m,
                horizontal_accuracy_m=0.0,
                vertical_accuracy_m=0.0,
                position_valid=True,
                altitude_valid=True,
                velocity_valid=True,
                heading_valid=True,
            )
        )

    def _make_topics(self) -> None:
        self.status: Topic[VehicleStatus] = Topic()
        self.attitude: Topic[VehicleAttitude] = Topic()
        self.local_position: Topic[VehicleLocalPosition] = Topic()
        self.trajectory: Topic[TrajectorySetpoint] = Topic()
        self.land: Topic[LandDetected] = Topic()
        self.hover_thrust: Topic[HoverThrustEstimate] = Topic()
        self.attitude_setpoint: Topic[VehicleAttitudeSetpoint] = Topic()
        self.rates_setpoint: Topic[VehicleRatesSetpoint] = Topic()
        self.torque_thrust: Topic[VehicleTorqueThrustSetpoint] = Topic()
        self.allocator_status: Topic[ControlAllocatorStatus] = Topic()
        self.motors: Topic[ActuatorMotors] = Topic()

    def _make_modules(self) -> None:
        self.position_control = PositionControlModule(
            trajectory=self.trajectory,
            local_position=self.local_position,
            vehicle_status=self.status,
            land_detected=self.land,
            attitude_setpoint=self.attitude_setpoint,
            hover_thrust_estimate=self.hover_thrust,
            registry=self.registry,
        )
        self.attitude_control = AttitudeControlModule(
            attitude=self.attitude,
            attitude_setpoint=self.attitude_setpoint,
            rates_setpoint=self.rates_setpoint,
            registry=self.registry,
        )
        self.rate_control = RateControlModule(
            attitude=self.attitude,
            rates_setpoint=self.rates_setpoint,
            allocator_status=self.allocator_status,
            torque_thrust=self.torque_thrust,
            registry=self.registry,
        )
        self.allocator = ControlAllocatorModule(
            torque_thrust=self.torque_thrust,
            vehicle_status=self.status,
            motors=self.motors,
            allocator_status=self.allocator_status,
            status_text=Queue(),
            registry=self.registry,
        )
        self.land_detector = LandDetectorModule(
            attitude=self.attitude,
            local_position=self.local_position,
            torque_thrust=self.torque_thrust,
            trajectory=self.trajectory,
            vehicle_status=self.status,
            land_detected=self.land,
            vehicle_control_mode=Topic(),
            hover_thrust_estimate=self.hover_thrust,
            range_finder=Topic(),
            terrain_estimate=Topic(),
            registry=self.registry,
        )
