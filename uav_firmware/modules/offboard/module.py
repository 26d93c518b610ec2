"""Reads streamed setpoints, publishes them to the control loop that they address."""

import math
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.lib.ground_contact import GROUND_SINK_SPEED_M_S
from uav_firmware.lib.guide import (
    LONGEST_STEP_S,
    VERTICAL_LEASH_M,
    Guide,
    GuideLimits,
    advanced_yaw,
)
from uav_firmware.lib.vector import ZERO
from uav_firmware.modules.offboard.motion import SpeedLimits, follow, wants_to_rise
from uav_firmware.msg.control_mode import ControlSource, OffboardSetpoint, VehicleControlMode
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)
from uav_firmware.msg.status import LandDetected, VehicleStatus
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

_LIFT_OFF_SPEED: Final = 1.0  # [m/s] Setpoint on the ground to take off
_UNSET: Final[Vector3] = (math.nan, math.nan, math.nan)


class OffboardModule:
    """Shell: streamed setpoints in, setpoints of the control loops out."""

    def __init__(
        self,
        registry: Registry,
        *,
        offboard_setpoint: Topic[OffboardSetpoint],
        vehicle_control_mode: Topic[VehicleControlMode],
        vehicle_status: Topic[VehicleStatus],
        vehicle_local_position: Topic[VehicleLocalPosition],
        land_detected: Topic[LandDetected],
        trajectory_setpoint: Topic[TrajectorySetpoint],
        vehicle_attitude_setpoint: Topic[VehicleAttitudeSetpoint],
        vehicle_rates_setpoint: Topic[VehicleRatesSetpoint],
    ) -> None:
        self._registry = registry
        self._setpoint = offboard_setpoint
        self._control_mode = vehicle_control_mode
        self._status = vehicle_status
        self._local_position = vehicle_local_position
        self._land = land_detected
        self._trajectory = trajectory_setpoint
        self._attitude = vehicle_attitude_setpoint
        self._rates = vehicle_rates_setpoint
        self._guide = Guide()
        self._yaw = 0.0
        self._was_active = False  # Whether the last step flew a trajectory setpoint
        self._last_us = 0
        self._read_parameters()

    def update(self) -> None:
        """Publish the setpoint if offboard control is in command."""
        estimate, status = self._local_position.value, self._status.value
        control, setpoint = self._control_mode.value, self._setpoint.value
        if (
            estimate is None
            or status is None
            or control is None
            or control.source is not ControlSource.OFFBOARD
            or setpoint is None
        ):
            self._was_active = False
            return
        if self._parameter_version != self._registry.version:
            self._read_parameters()
        now_us = estimate.time_us
        dt = min((now_us - self._last_us) * 1e-6, LONGEST_STEP_S)
        self._last_us = now_us
        match setpoint:
            case TrajectorySetpoint():
                self._fly(setpoint, estimate, dt)
            case VehicleAttitudeSetpoint():
                thrust = self._thrust(setpoint.thrust, status, now_us)
                self._attitude.publish(
                    VehicleAttitudeSetpoint(now_us, setpoint.q_ned_frd, setpoint.yaw_rate, thrust)
                )
            case VehicleRatesSetpoint():
                thrust = self._thrust(setpoint.thrust, status, now_us)
                self._rates.publish(VehicleRatesSetpoint(now_us, setpoint.rate_frd, thrust))
        self._was_active = isinstance(setpoint, TrajectorySetpoint)

    @property
    def _landed(self) -> bool:
        return self._land.value is None or self._land.value.landed

    def _fly(self, setpoint: TrajectorySetpoint, estimate: VehicleLocalPosition, dt: float) -> None:
        if not self._was_active or self._landed:
            self._restart(estimate)
        yaw_rate = self._advance_yaw(setpoint, estimate, dt)
        if self._landed:
            self._fly_on_ground(setpoint, estimate)
        elif dt > 0.0:
            motion = follow(
                setpoint, self._guide, estimate.position_ned, self._limits, self._speeds, dt
            )
            self._trajectory.publish(
                TrajectorySetpoint(estimate.time_us, *motion, self._yaw, yaw_rate)
            )

    def _restart(self, estimate: VehicleLocalPosition) -> None:
        """Start from the present position and velocity; on the ground at rest."""
        known = estimate.velocity_valid and not self._landed
        self._guide.restart(estimate.position_ned, estimate.velocity_ned if known else ZERO)
        self._yaw = estimate.heading

    def _fly_on_ground(self, setpoint: TrajectorySetpoint, estimate: VehicleLocalPosition) -> None:
        """Take off when the setpoint leads up, else stay on the ground."""
        rises = wants_to_rise(setpoint, estimate.position_ned)
        velocity = (0.0, 0.0, -_LIFT_OFF_SPEED if rises else GROUND_SINK_SPEED_M_S)
        self._trajectory.publish(
            TrajectorySetpoint(estimate.time_us, _UNSET, velocity, ZERO, estimate.heading, 0.0)
        )

    def _advance_yaw(
        self, setpoint: TrajectorySetpoint, estimate: VehicleLocalPosition, dt: float
    ) -> float:
        """Use the heading setpoint, or advance it by the rate; return the rate [rad/s]."""
        rate = 0.0 if math.isnan(setpoint.yaw_rate) else setpoint.yaw_rate
        if not math.isnan(setpoint.yaw):
            self._yaw = setpoint.yaw
        elif rate != 0.0:
            self._yaw = advanced_yaw(self._yaw, rate, estimate.heading, dt)
        return rate

    def _thrust(self, thrust: float, status: VehicleStatus, now_us: int) -> float:
        """Thrust [-] of the setpoint; zero while disarmed or spooling up."""
        if not status.armed or now_us - status.armed_since_us < self._spool_up_us:
            return 0.0
        return thrust

    def _read_parameters(self) -> None:
        get = self._registry.get
        self._parameter_version = self._registry.version
        self._limits = GuideLimits(
            acceleration_horizontal=get("MPC_ACC_HOR"),
            acceleration_up=get("MPC_ACC_UP_MAX"),
            acceleration_down=get("MPC_ACC_DOWN_MAX"),
            jerk=get("MPC_JERK_AUTO"),
            leash_horizontal=get("MPC_XY_ERR_MAX"),
            leash_vertical=VERTICAL_LEASH_M,
        )
        self._speeds = SpeedLimits(
            get("MPC_XY_CRUISE"), get("MPC_Z_V_AUTO_UP"), get("MPC_Z_V_AUTO_DN")
        )
        self._spool_up_us = get("COM_SPOOLUP_TIME") * 1e6
