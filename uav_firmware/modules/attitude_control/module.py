"""Reads attitude and its setpoint, publishes wanted body rates, at control rate."""

import math

from uav_firmware.bus import Topic
from uav_firmware.modules.attitude_control.controller import AttitudeGains, rate_setpoint
from uav_firmware.modules.attitude_control.params import AttitudeControlParams
from uav_firmware.msg.control_mode import ControlLevel, VehicleControlMode
from uav_firmware.msg.estimate import VehicleAttitude
from uav_firmware.msg.setpoints import VehicleAttitudeSetpoint, VehicleRatesSetpoint
from uav_firmware.parameters import Registry

_LEVEL_RATES = (0.0, 0.0, 0.0)


class AttitudeControlModule:
    """Shell of the attitude law."""

    def __init__(
        self,
        *,
        attitude: Topic[VehicleAttitude],
        attitude_setpoint: Topic[VehicleAttitudeSetpoint],
        rates_setpoint: Topic[VehicleRatesSetpoint],
        registry: Registry,
        vehicle_control_mode: Topic[VehicleControlMode] | None = None,
    ) -> None:
        self._attitude = attitude
        self._attitude_setpoint = attitude_setpoint
        self._rates_setpoint = rates_setpoint
        self._control_mode = vehicle_control_mode
        self._registry = registry
        self._seen_version = registry.version
        self._gains = _gains(registry.read(AttitudeControlParams))

    def update(self) -> None:
        """Run the controller once; without thrust no rate is commanded.

        Where sticks or a stream ask for body rates themselves, the loop stays open.
        """
        control = None if self._control_mode is None else self._control_mode.value
        if control is not None and control.level is ControlLevel.RATES:
            return
        attitude = self._attitude.value
        setpoint = self._attitude_setpoint.value
        if attitude is None or setpoint is None:
            return
        if self._seen_version != self._registry.version:
            self._seen_version = self._registry.version
            self._gains = _gains(self._registry.read(AttitudeControlParams))
        rates = _LEVEL_RATES
        if setpoint.thrust > 0.0:
            rates = rate_setpoint(
                attitude.q_ned_frd, setpoint.q_ned_frd, setpoint.yaw_rate, self._gains
            )
        self._rates_setpoint.publish(VehicleRatesSetpoint(attitude.time_us, rates, setpoint.thrust))


def _gains(params: AttitudeControlParams) -> AttitudeGains:
    return AttitudeGains(
        p_frd=(params.roll_p, params.pitch_p, params.yaw_p),
        yaw_weight=params.yaw_weight,
        rate_limit_frd=(
            math.radians(params.roll_rate_max_deg_s),
            math.radians(params.pitch_rate_max_deg_s),
            math.radians(params.yaw_rate_max_deg_s),
        ),
    )
