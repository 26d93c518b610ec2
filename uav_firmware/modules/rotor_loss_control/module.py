"""Reads attitude, its setpoint and what has failed; publishes thrusts while a rotor is lost."""

import math
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.lib.rotation import rotate
from uav_firmware.modules.rotor_loss_control.controller import (
    Poles,
    RotorArm,
    RotorLossController,
    TouchdownDetector,
    VehicleDynamics,
    limit_tilt,
    tilt_error,
)
from uav_firmware.modules.rotor_loss_control.params import RotorLossParams
from uav_firmware.msg.estimate import VehicleAttitude, VehicleLocalPosition
from uav_firmware.msg.failure import FailureDetectorStatus, RotorLossThrust
from uav_firmware.msg.setpoints import TrajectorySetpoint, VehicleAttitudeSetpoint
from uav_firmware.msg.vectors import Motors, Vector3
from uav_firmware.parameters import Registry

_DOWN: Final[Vector3] = (0.0, 0.0, 1.0)
_SINGLE_MOTORS: Final = {1 << motor: motor for motor in range(4)}
_NONE: Final[Motors] = (0.0, 0.0, 0.0, 0.0)
_LONGEST_STEP_S: Final = 0.05


class RotorLossControlModule:
    """Shell of the law of three rotors; silent while all rotors turn, or while two are lost."""

    def __init__(
        self,
        registry: Registry,
        *,
        attitude: Topic[VehicleAttitude],
        attitude_setpoint: Topic[VehicleAttitudeSetpoint],
        local_position: Topic[VehicleLocalPosition],
        trajectory: Topic[TrajectorySetpoint],
        failure_status: Topic[FailureDetectorStatus],
        rotor_loss_thrust: Topic[RotorLossThrust],
    ) -> None:
        """`registry` must contain the rotors' places, CA_ROTOR*."""
        registry.add(RotorLossParams)
        self._registry = registry
        self._attitude = attitude
        self._attitude_setpoint = attitude_setpoint
        self._local_position = local_position
        self._trajectory = trajectory
        self._failure_status = failure_status
        self._thrust = rotor_loss_thrust
        self._lost: int | None = None
        self._last_us = 0
        self._touch_down = TouchdownDetector()
        self._retune()
        self._law = RotorLossController(_arms(registry))

    def update(self) -> None:
        """Run the law once if exactly one motor has failed."""
        failure = self._failure_status.value
        lost = None if failure is None else _SINGLE_MOTORS.get(failure.failed_motors)
        if lost is None or not self._params.enabled:
            self._lost = None
            return
        if self._seen_version != self._registry.version:
            self._retune()
            self._law.arms = _arms(self._registry)
        attitude, setpoint = self._attitude.value, self._attitude_setpoint.value
        if attitude is None or setpoint is None:
            return
        dt = min((attitude.time_us - self._last_us) * 1e-6, _LONGEST_STEP_S)
        self._last_us = attitude.time_us
        if self._lost != lost:
            self._lost = lost
            self._law.start(_even(setpoint.thrust), lost)
            self._touch_down = TouchdownDetector()
        if dt > 0.0:
            self._fly(attitude, setpoint, lost, dt)

    def _fly(
        self, attitude: VehicleAttitude, setpoint: VehicleAttitudeSetpoint, lost: int, dt: float
    ) -> None:
        if self._touches_down(attitude.rate_frd[2], dt):
            self._thrust.publish(RotorLossThrust(attitude.time_us, lost, _NONE))
            return
        wanted_down = limit_tilt(rotate(setpoint.q_ned_frd, _DOWN), self._tilt_max)
        thrust = self._law.update(
            lost,
            tilt_error(attitude.q_ned_frd, wanted_down),
            attitude.rate_frd,
            setpoint.thrust,
            self._dynamics,
            self._poles,
            dt,
        )
        if math.isfinite(sum(thrust)):
            self._thrust.publish(RotorLossThrust(attitude.time_us, lost, thrust))

    def _touches_down(self, yaw_rate: float, dt: float) -> bool:
        position, trajectory = self._local_position.value, self._trajectory.value
        if position is None or trajectory is None:
            return False
        # An unset speed is NaN, which compares false: no touch-down
        wanted, sink = trajectory.velocity_ned[2], position.velocity_ned[2]
        return self._touch_down.update(wanted, sink, yaw_rate, dt)

    def _retune(self) -> None:
        self._seen_version = self._registry.version
        self._params = params = self._registry.read(RotorLossParams)
        self._tilt_max = math.radians(params.tilt_max_deg)
        self._dynamics = VehicleDynamics(
            acceleration=params.acceleration,
            motor_time_s=params.motor_time_s,
            inertia_ratio=params.inertia_ratio,
            rotor_spin=params.rotor_spin,
        )
        self._poles = Poles(tilt=params.tilt_pole, rate=params.rate_pole)


def _even(collective: float) -> Motors:
    return (collective, collective, collective, collective)


def _arms(registry: Registry) -> tuple[RotorArm, RotorArm, RotorArm, RotorArm]:
    return (_arm(registry, 0), _arm(registry, 1), _arm(registry, 2), _arm(registry, 3))


def _arm(registry: Registry, rotor: int) -> RotorArm:
    lever = complex(-registry.get(f"CA_ROTOR{rotor}_PY"), registry.get(f"CA_ROTOR{rotor}_PX"))
    # Reaction to the right on the body: the rotor itself turns to the left, momentum upwards
    spin = -math.copysign(1.0, registry.get(f"CA_ROTOR{rotor}_KM"))
    return RotorArm(lever / max(abs(lever), 1e-3), spin)
