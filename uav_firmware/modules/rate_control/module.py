"""Reads wanted and measured rates, publishes torque and thrust, at control rate."""

from uav_firmware.bus import Topic
from uav_firmware.lib.vector import ZERO
from uav_firmware.modules.rate_control.controller import AxisGains, RateController
from uav_firmware.modules.rate_control.params import RateControlParams
from uav_firmware.msg.estimate import VehicleAttitude
from uav_firmware.msg.setpoints import (
    ControlAllocatorStatus,
    VehicleRatesSetpoint,
    VehicleTorqueThrustSetpoint,
)
from uav_firmware.parameters import Registry

_LONGEST_STEP_S = 0.05  # a longer pause is no derivative


class RateControlModule:
    """Shell of the rate law."""

    def __init__(
        self,
        *,
        attitude: Topic[VehicleAttitude],
        rates_setpoint: Topic[VehicleRatesSetpoint],
        allocator_status: Topic[ControlAllocatorStatus],
        torque_thrust: Topic[VehicleTorqueThrustSetpoint],
        registry: Registry,
    ) -> None:
        self._attitude = attitude
        self._rates_setpoint = rates_setpoint
        self._allocator_status = allocator_status
        self._torque_thrust = torque_thrust
        self._registry = registry
        self._seen_version = registry.version
        params = registry.read(RateControlParams)
        self._law = RateController(_gains(params), params.derivative_cutoff_hz)
        self._last_us = 0

    def update(self) -> None:
        """Run the law once on the newest attitude; without thrust there is no torque."""
        attitude = self._attitude.value
        setpoint = self._rates_setpoint.value
        if attitude is None or setpoint is None:
            return
        if self._seen_version != self._registry.version:
            self._retune()
        dt = (attitude.time_us - self._last_us) * 1e-6
        self._last_us = attitude.time_us
        if setpoint.thrust <= 0.0 or not 0.0 < dt <= _LONGEST_STEP_S:
            self._law.reset()
            torque = ZERO
        else:
            status = self._allocator_status.value
            unallocated = ZERO if status is None else status.unallocated_torque_frd
            torque = self._law.update(setpoint.rate_frd, attitude.rate_frd, unallocated, dt)
        self._torque_thrust.publish(
            VehicleTorqueThrustSetpoint(attitude.time_us, torque, setpoint.thrust)
        )

    def _retune(self) -> None:
        self._seen_version = self._registry.version
        params = self._registry.read(RateControlParams)
        self._law.tune(_gains(params), params.derivative_cutoff_hz)


def _gains(params: RateControlParams) -> tuple[AxisGains, AxisGains, AxisGains]:
    """Sort the parameters by axis, with each multiplier applied."""
    roll, pitch, yaw = params.roll_multiplier, params.pitch_multiplier, params.yaw_multiplier
    return (
        AxisGains(
            roll * params.roll_p,
            roll * params.roll_i,
            roll * params.roll_d,
            params.roll_integral_limit,
        ),
        AxisGains(
            pitch * params.pitch_p,
            pitch * params.pitch_i,
            pitch * params.pitch_d,
            params.pitch_integral_limit,
        ),
        AxisGains(
            yaw * params.yaw_p,
            yaw * params.yaw_i,
            yaw * params.yaw_d,
            params.yaw_integral_limit,
        ),
    )
