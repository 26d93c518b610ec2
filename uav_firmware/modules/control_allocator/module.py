"""Reads torque and thrust, publishes motor commands and what could not be produced."""

import math
from typing import Final

from uav_firmware.bus import Queue, Topic
from uav_firmware.modules.control_allocator.allocation import allocate, motor_commands
from uav_firmware.modules.control_allocator.geometry import GeometryError, Mix, Rotor, mix_of
from uav_firmware.modules.control_allocator.params import ControlAllocatorParams
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.failure import RotorLossThrust
from uav_firmware.msg.setpoints import ControlAllocatorStatus, VehicleTorqueThrustSetpoint
from uav_firmware.msg.status import Severity, StatusText, VehicleStatus
from uav_firmware.msg.vectors import Motors
from uav_firmware.parameters import Registry

_FRESH_US: Final = 20_000  # Older thrusts of the law of three rotors are not flown
_STOPPED: Motors = (0.0, 0.0, 0.0, 0.0)


class ControlAllocatorModule:
    """Shell of the allocation law; the last gate before the motors."""

    def __init__(
        self,
        *,
        torque_thrust: Topic[VehicleTorqueThrustSetpoint],
        vehicle_status: Topic[VehicleStatus],
        motors: Topic[ActuatorMotors],
        allocator_status: Topic[ControlAllocatorStatus],
        status_text: Queue[StatusText],
        registry: Registry,
        rotor_loss_thrust: Topic[RotorLossThrust] | None = None,
    ) -> None:
        """Read the geometry.

        Raises:
            GeometryError: if the rotors leave an axis without torque.
        """
        self._torque_thrust = torque_thrust
        self._vehicle_status = vehicle_status
        self._rotor_loss_thrust = Topic() if rotor_loss_thrust is None else rotor_loss_thrust
        self._motors = motors
        self._allocator_status = allocator_status
        self._status_text = status_text
        self._reported = False
        self._registry = registry
        self._seen_version = registry.version
        self._apply(registry.read(ControlAllocatorParams))

    def update(self, now_us: int) -> None:
        """Run the law once. Safety: a motor turns only while the vehicle is armed."""
        if self._seen_version != self._registry.version:
            self._retune(now_us)
        status = self._vehicle_status.value
        setpoint = self._torque_thrust.value
        if status is None or not status.armed:
            self._motors.publish(ActuatorMotors(now_us, _STOPPED))
            return
        if setpoint is None or setpoint.thrust <= 0.0:
            self._motors.publish(ActuatorMotors(now_us, self._idling))
            return
        flown = self._rotor_loss_thrust.value
        if flown is not None and 0 <= now_us - flown.time_us <= _FRESH_US:
            self._fly_on_three(now_us, flown, setpoint)
            return
        result = allocate(setpoint.torque_frd, setpoint.thrust, self._mix)
        control = motor_commands(result.thrust, self._model_factor, self._idle)
        if not math.isfinite(control[0] + control[1] + control[2] + control[3]):
            self._hold_motors(now_us)
            return
        self._motors.publish(ActuatorMotors(now_us, control))
        self._allocator_status.publish(
            ControlAllocatorStatus(now_us, result.unallocated_torque_frd, result.unallocated_thrust)
        )

    def _fly_on_three(
        self, now_us: int, flown: RotorLossThrust, setpoint: VehicleTorqueThrustSetpoint
    ) -> None:
        """Carry out the thrusts of the law of three rotors; the lost one stands.

        None of the commanded torque is produced: so the integrators of the rate loop wait.
        """
        control = motor_commands(flown.thrust, self._model_factor, 0.0)
        self._motors.publish(ActuatorMotors(now_us, control))
        self._allocator_status.publish(ControlAllocatorStatus(now_us, setpoint.torque_frd, 0.0))

    def _hold_motors(self, now_us: int) -> None:
        """Safety: a command that is no number changes nothing; the former one stays."""
        if self._motors.value is None:
            self._motors.publish(ActuatorMotors(now_us, self._idling))
        if not self._reported:
            self._reported = True
            self._status_text.publish(
                StatusText(now_us, Severity.CRITICAL, "Motor command is no number")
            )

    def _retune(self, now_us: int) -> None:
        """Apply changed parameters; rotors that cannot fly leave the former mix in place."""
        self._seen_version = self._registry.version
        try:
            self._apply(self._registry.read(ControlAllocatorParams))
        except GeometryError as error:
            self._status_text.publish(
                StatusText(now_us, Severity.ERROR, f"Geometry not taken: {error}")
            )

    def _apply(self, params: ControlAllocatorParams) -> None:
        self._mix: Mix = mix_of(_rotors(params))
        self._model_factor = params.thrust_model_factor
        self._idle = params.idle
        self._idling: Motors = (params.idle, params.idle, params.idle, params.idle)


def _rotors(params: ControlAllocatorParams) -> tuple[Rotor, Rotor, Rotor, Rotor]:
    return (
        Rotor(params.rotor0_x, params.rotor0_y, params.rotor0_moment),
        Rotor(params.rotor1_x, params.rotor1_y, params.rotor1_moment),
        Rotor(params.rotor2_x, params.rotor2_y, params.rotor2_moment),
        Rotor(params.rotor3_x, params.rotor3_y, params.rotor3_moment),
    )
