"""Reads trajectory and estimate, publishes attitude and thrust."""

import math
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.lib.ground_contact import BLIND_DESCENT_M_S, STALE_SETPOINT_US
from uav_firmware.lib.resets import ResetFollower
from uav_firmware.lib.rotation import from_thrust_direction_and_yaw, wrap_pi
from uav_firmware.lib.vector import ZERO, add
from uav_firmware.modules.position_control.control_math import ThrustLimits
from uav_firmware.modules.position_control.controller import (
    Motion,
    PositionController,
    PositionGains,
    PositionLimits,
)
from uav_firmware.modules.position_control.hover_thrust import (
    HoverThrustEstimator,
    HoverThrustNoise,
)
from uav_firmware.modules.position_control.params import PositionControlParams
from uav_firmware.modules.position_control.takeoff_ramp import Takeoff, TakeoffRamp
from uav_firmware.modules.position_control.touchdown import TouchDown, settle
from uav_firmware.modules.position_control.wanted_motion import (
    BLIND,
    LEVEL,
    observable,
    wants_climb,
)
from uav_firmware.msg.control_mode import ControlLevel, VehicleControlMode
from uav_firmware.msg.estimate import HoverThrustEstimate, VehicleLocalPosition
from uav_firmware.msg.setpoints import TrajectorySetpoint, VehicleAttitudeSetpoint
from uav_firmware.msg.status import LandDetected, LandedState, VehicleStatus
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

_LONGEST_STEP_S: Final = 0.1  # after a longer pause the integrator does not move
_ACCELERATION_NOISE: Final = 2.0  # [m/s^2] Covers the motors' lag as well as the sensor
_LEVEL_SPEED: Final = 0.2  # [m/s] Vertical
_UP_NED: Final[Vector3] = (0.0, 0.0, -1.0)


class PositionControlModule:
    """Shell of the position law, with the take-off ramp."""

    def __init__(
        self,
        *,
        trajectory: Topic[TrajectorySetpoint],
        local_position: Topic[VehicleLocalPosition],
        vehicle_status: Topic[VehicleStatus],
        land_detected: Topic[LandDetected],
        attitude_setpoint: Topic[VehicleAttitudeSetpoint],
        registry: Registry,
        vehicle_control_mode: Topic[VehicleControlMode] | None = None,
        hover_thrust_estimate: Topic[HoverThrustEstimate] | None = None,
    ) -> None:
        self._hover_thrust = Topic() if hover_thrust_estimate is None else hover_thrust_estimate
        self._trajectory = trajectory
        self._local_position = local_position
        self._vehicle_status = vehicle_status
        self._land_detected = land_detected
        self._attitude_setpoint = attitude_setpoint
        self._control_mode = vehicle_control_mode
        self._registry = registry
        self._ramp = TakeoffRamp()
        self._touchdown = TouchDown()
        self._yaw = 0.0
        self._last_us = 0
        self._resets = ResetFollower()
        self._setpoint_count = 0
        self._setpoint_shift = (ZERO, ZERO)  # [m], [m/s] By resets since that setpoint
        self._last_thrust_up = 0.0  # [-] Last commanded
        self._retune()
        self._hover = HoverThrustEstimator(self._params.thrust_hover, _hover_noise(self._params))
        self._law_hover = self._params.thrust_hover  # [-] What the law flies by
        self._law = PositionController(_gains(self._params), _limits(self._params))

    def update(self) -> None:
        """Run the law once on the newest estimate; on the ground the thrust is zero."""
        position = self._local_position.value
        status = self._vehicle_status.value
        if position is None or status is None:
            return
        if self._seen_version != self._registry.version:
            self._retune()
            self._law.gains = _gains(self._params)
            self._law.limits = _limits(self._params)
        dt = (position.time_us - self._last_us) * 1e-6
        self._last_us = position.time_us
        wanted = self._wanted(position)
        thrust_max = self._thrust_limit(position, status, wanted)
        if not self._leads:
            self._law.reset()
            self._yaw = position.heading
        elif thrust_max <= 0.0:
            self._idle(position)
        elif dt > 0.0:
            self._fly(position, wanted, thrust_max, min(dt, _LONGEST_STEP_S))

    @property
    def _leads(self) -> bool:
        """Whether the position loop is closed; else sticks or a stream lead the attitude."""
        control = None if self._control_mode is None else self._control_mode.value
        return control is None or control.level is ControlLevel.POSITION

    def _thrust_limit(
        self, position: VehicleLocalPosition, status: VehicleStatus, wanted: Motion
    ) -> float:
        """Advance the take-off; return the largest thrust that is allowed now."""
        params = self._params
        now_s = position.time_us * 1e-6
        land = self._land_detected.value
        self._ramp.update(
            now_s=now_s,
            armed=status.armed,
            landed=land is None or land.landed,
            wants_climb=self._leads and wants_climb(wanted, position),
            spool_up_time_s=params.spool_up_time_s,
            ramp_time_s=params.takeoff_ramp_time_s,
        )
        return self._ramp.thrust_limit(
            now_s=now_s,
            ramp_time_s=params.takeoff_ramp_time_s,
            start=params.thrust_min,
            full=params.thrust_max,
        )

    def _wanted(self, position: VehicleLocalPosition) -> Motion:
        """The trajectory's motion as far as the estimate can follow it; else a descent."""
        setpoint = self._trajectory.value
        if self._trajectory.count != self._setpoint_count:
            self._setpoint_count = self._trajectory.count
            self._setpoint_shift = (ZERO, ZERO)
        self._follow_resets(position)
        if setpoint is None or position.time_us - setpoint.time_us > STALE_SETPOINT_US:
            wanted = Motion(BLIND, (0.0, 0.0, BLIND_DESCENT_M_S), LEVEL)
        else:
            place, speed = self._setpoint_shift
            wanted = Motion(
                add(setpoint.position_ned, place),
                add(setpoint.velocity_ned, speed),
                setpoint.acceleration_ned,
                setpoint.speed_max,
            )
        return observable(wanted, position)

    def _follow_resets(self, position: VehicleLocalPosition) -> None:
        """Move a setpoint that is older than a reset of the estimate with the estimate."""
        step = self._resets.update(position.resets)
        setpoint = self._trajectory.value
        if step is None or setpoint is None or setpoint.time_us >= position.time_us:
            return
        place, speed = self._setpoint_shift
        self._setpoint_shift = (add(place, step.position_ned), add(speed, step.velocity_ned))
        self._yaw = wrap_pi(self._yaw + step.heading)

    def _fly(
        self, position: VehicleLocalPosition, wanted: Motion, thrust_max: float, dt: float
    ) -> None:
        params = self._params
        land = self._land_detected.value
        near_ground = self._ramp.state is Takeoff.RAMP_UP or (
            land is not None and land.ground_contact
        )
        limits = ThrustLimits(
            minimum=min(params.thrust_min, thrust_max),
            maximum=thrust_max,
            # During the ramp most of what there is has to lift.
            horizontal_margin=min(params.thrust_xy_margin, 0.5 * thrust_max),
            tilt=self._tilt_ground if near_ground else self._tilt_air,
        )
        measured = Motion(position.position_ned, position.velocity_ned, position.acceleration_ned)
        self._learn_hover(position, wanted, dt)
        wanted = self._settled(position, wanted)
        thrust = self._law.update(wanted, measured, limits, self._law_hover, dt)
        self._last_thrust_up = -thrust[2]
        yaw_rate = self._follow_yaw(position)
        north, east, down = thrust
        self._attitude_setpoint.publish(
            VehicleAttitudeSetpoint(
                position.time_us,
                from_thrust_direction_and_yaw(thrust, self._yaw),
                yaw_rate,
                math.sqrt(north * north + east * east + down * down),
            )
        )

    def _settled(self, position: VehicleLocalPosition, wanted: Motion) -> Motion:
        """What is wanted, or, once the ground carries the vehicle, to stand on it."""
        share = self._last_thrust_up / self._law_hover
        now_s, sink_speed = position.time_us * 1e-6, position.velocity_ned[2]
        accuracy_m_s = position.sink_accuracy_m_s
        if not self._touchdown.update(now_s, wanted, sink_speed, share, accuracy_m_s):
            return wanted
        self._law.forget_horizontal()
        return settle(self._params.z_velocity_max_down)

    def _learn_hover(self, position: VehicleLocalPosition, wanted: Motion, dt: float) -> None:
        """Improve the hover thrust in level flight: while it sinks, the ground may carry it.

        It is learnt with MPC_USE_HTE at 0 too, for the land detector; the law then stays with
        the parameter.
        """
        land = self._land_detected.value
        airborne = land is not None and land.landed_state is LandedState.IN_AIR
        level = abs(wanted.velocity_ned[2]) < _LEVEL_SPEED  # false for NaN
        if not (airborne and level):
            return
        present = self._hover.update(self._last_thrust_up, -position.acceleration_ned[2], dt)
        self._publish_hover(position.time_us)
        if self._params.estimates_hover_thrust:
            self._law.follow_hover(self._law_hover, present)
            self._law_hover = present

    def _publish_hover(self, time_us: int) -> None:
        estimate = self._hover
        self._hover_thrust.publish(HoverThrustEstimate(time_us, estimate.hover, estimate.learnt))

    def _follow_yaw(self, position: VehicleLocalPosition) -> float:
        """Set the wanted yaw, keep the former one where none is set; return the rate."""
        setpoint = self._trajectory.value
        if setpoint is None or position.time_us - setpoint.time_us > STALE_SETPOINT_US:
            return 0.0
        if not math.isnan(setpoint.yaw):
            self._yaw = setpoint.yaw
        return 0.0 if math.isnan(setpoint.yaw_rate) else setpoint.yaw_rate

    def _idle(self, position: VehicleLocalPosition) -> None:
        self._law.reset()
        self._hover.reset(self._params.thrust_hover, _hover_noise(self._params))
        self._law_hover = self._params.thrust_hover
        self._publish_hover(position.time_us)
        self._yaw = position.heading
        self._attitude_setpoint.publish(
            VehicleAttitudeSetpoint(
                position.time_us, from_thrust_direction_and_yaw(_UP_NED, self._yaw), 0.0, 0.0
            )
        )

    def _retune(self) -> None:
        self._seen_version = self._registry.version
        self._params = self._registry.read(PositionControlParams)
        self._tilt_air = math.radians(self._params.tilt_max_air_deg)
        self._tilt_ground = math.radians(self._params.tilt_max_ground_deg)


def _hover_noise(params: PositionControlParams) -> HoverThrustNoise:
    return HoverThrustNoise(
        initial=params.hover_thrust_error,
        walk=params.hover_thrust_noise,
        acceleration=_ACCELERATION_NOISE,
        gate=params.hover_thrust_gate,
    )


def _gains(params: PositionControlParams) -> PositionGains:
    return PositionGains(
        position_p=(params.xy_p, params.z_p),
        velocity_p=(params.xy_velocity_p, params.z_velocity_p),
        velocity_i=(params.xy_velocity_i, params.z_velocity_i),
        velocity_d=(params.xy_velocity_d, params.z_velocity_d),
    )


def _limits(params: PositionControlParams) -> PositionLimits:
    return PositionLimits(
        speed_horizontal=params.xy_velocity_max,
        speed_up=params.z_velocity_max_up,
        speed_down=params.z_velocity_max_down,
    )
