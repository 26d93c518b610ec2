"""Reads sticks and estimate, publishes the setpoint of the piloted mode."""

import math
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.lib.ground_contact import GROUND_SINK_SPEED_M_S
from uav_firmware.lib.guide import LONGEST_STEP_S, Guide, advanced_yaw
from uav_firmware.lib.resets import ResetFollower
from uav_firmware.lib.rotation import rotate_by_yaw, wrap_pi
from uav_firmware.lib.terrain import ground_down
from uav_firmware.modules.manual_control.stick_setpoints import (
    attitude,
    body_rates,
    climb_velocity,
    thrust,
    tilt_acceleration,
)
from uav_firmware.modules.manual_control.stick_shaping import shaped, with_expo
from uav_firmware.modules.manual_control.tuning import Tuning, tuning_from
from uav_firmware.msg.control_mode import (
    ControlSource,
    ManualControlSetpoint,
    VehicleControlMode,
)
from uav_firmware.msg.estimate import TerrainEstimate, VehicleLocalPosition
from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)
from uav_firmware.msg.status import HomePosition, LandDetected, NavigationState, VehicleStatus
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

_NAN: Final = math.nan
_CENTRED: Final = ManualControlSetpoint(0, 0.0, 0.0, 0.0, 0.0)


class ManualControlModule:
    """Shell: sticks and estimate in, setpoints out."""

    def __init__(
        self,
        registry: Registry,
        *,
        manual_control_setpoint: Topic[ManualControlSetpoint],
        vehicle_control_mode: Topic[VehicleControlMode],
        vehicle_status: Topic[VehicleStatus],
        vehicle_local_position: Topic[VehicleLocalPosition],
        land_detected: Topic[LandDetected],
        home_position: Topic[HomePosition],
        terrain_estimate: Topic[TerrainEstimate],
        trajectory_setpoint: Topic[TrajectorySetpoint],
        vehicle_attitude_setpoint: Topic[VehicleAttitudeSetpoint],
        vehicle_rates_setpoint: Topic[VehicleRatesSetpoint],
    ) -> None:
        self._registry = registry
        self._sticks = manual_control_setpoint
        self._control_mode = vehicle_control_mode
        self._status = vehicle_status
        self._local_position = vehicle_local_position
        self._land = land_detected
        self._home = home_position
        self._terrain_estimate = terrain_estimate
        self._trajectory = trajectory_setpoint
        self._attitude = vehicle_attitude_setpoint
        self._rates = vehicle_rates_setpoint
        self._guide = Guide()
        self._yaw = 0.0
        self._was_active = False  # Whether the last step published a setpoint
        self._last_us = 0
        self._resets = ResetFollower()
        self._read_parameters()

    def update(self) -> None:
        """Publish the setpoint if manual control is in command."""
        estimate, status = self._local_position.value, self._status.value
        control = self._control_mode.value
        if (
            estimate is None
            or status is None
            or control is None
            or control.source is not ControlSource.MANUAL
        ):
            self._was_active = False
            return
        if self._parameter_version != self._registry.version:
            self._read_parameters()
        step = self._resets.update(estimate.resets)
        if step is not None:
            self._guide.shift(step.position_ned, step.velocity_ned)
            self._yaw = wrap_pi(self._yaw + step.heading)
        dt = min((estimate.time_us - self._last_us) * 1e-6, LONGEST_STEP_S)
        self._last_us = estimate.time_us
        if not self._was_active or self._landed:
            self._restart(estimate)
        self._was_active = True
        if dt > 0.0:
            self._fly(estimate, status, dt)

    @property
    def _landed(self) -> bool:
        return self._land.value is None or self._land.value.landed

    def _restart(self, estimate: VehicleLocalPosition) -> None:
        """Start from the present position and velocity; on the ground at rest."""
        velocity = estimate.velocity_ned
        known = estimate.velocity_valid and not self._landed
        self._guide.restart(estimate.position_ned, velocity if known else (0.0, 0.0, 0.0))
        self._yaw = estimate.heading

    def _fly(self, estimate: VehicleLocalPosition, status: VehicleStatus, dt: float) -> None:
        match status.navigation_state:
            case NavigationState.POSCTL:
                self._fly_position(estimate, dt)
            case NavigationState.ALTCTL:
                self._fly_altitude(estimate, dt)
            case NavigationState.ACRO:
                self._fly_rates(estimate, status)
            case _:  # MANUAL equals STAB: a multirotor needs attitude control
                self._fly_attitude(estimate, status, dt)

    def _raw(self, now_us: int) -> ManualControlSetpoint:
        """Newest sticks, not shaped; centred when none arrived for COM_RC_LOSS_T."""
        sticks = self._sticks.value
        if sticks is None or now_us - sticks.time_us > self._tuning.stale_us:
            return _CENTRED
        return sticks

    def _fly_position(self, estimate: VehicleLocalPosition, dt: float) -> None:
        tuning = self._tuning
        sticks = shaped(self._raw(estimate.time_us), tuning.curves)
        yaw_rate = self._advance_yaw(sticks.yaw, estimate, dt)
        north, east = rotate_by_yaw(sticks.forward, sticks.right, self._yaw)
        down = self._vertical(sticks.up, estimate)
        velocity = (north * tuning.speed_max, east * tuning.speed_max, down)
        if self._landed:
            self._fly_on_ground(estimate, down)
            return
        guide = self._guide
        guide.advance(velocity, estimate.position_ned, tuning.guide, dt)
        self._trajectory.publish(
            TrajectorySetpoint(
                estimate.time_us,
                guide.position,
                guide.velocity,
                guide.acceleration,
                self._yaw,
                yaw_rate,
            )
        )

    def _fly_altitude(self, estimate: VehicleLocalPosition, dt: float) -> None:
        tuning = self._tuning
        sticks = shaped(self._raw(estimate.time_us), tuning.curves)
        yaw_rate = self._advance_yaw(sticks.yaw, estimate, dt)
        down = self._vertical(sticks.up, estimate)
        if self._landed:
            self._fly_on_ground(estimate, down)
            return
        guide = self._guide
        guide.advance((0.0, 0.0, down), estimate.position_ned, tuning.guide, dt)
        tilt = tilt_acceleration(sticks.forward, sticks.right, self._yaw, tuning.tilt_max)
        self._trajectory.publish(
            TrajectorySetpoint(
                estimate.time_us,
                (_NAN, _NAN, guide.position[2]),
                (_NAN, _NAN, guide.velocity[2]),
                (tilt[0], tilt[1], guide.acceleration[2]),
                self._yaw,
                yaw_rate,
            )
        )

    def _fly_on_ground(self, estimate: VehicleLocalPosition, down: float) -> None:
        """Take off when the stick is up, else stay on the ground."""
        velocity = (0.0, 0.0, down if down < 0.0 else GROUND_SINK_SPEED_M_S)
        unset: Vector3 = (_NAN, _NAN, _NAN)
        self._trajectory.publish(
            TrajectorySetpoint(
                estimate.time_us, unset, velocity, (0.0, 0.0, 0.0), estimate.heading, 0.0
            )
        )

    def _fly_attitude(
        self, estimate: VehicleLocalPosition, status: VehicleStatus, dt: float
    ) -> None:
        raw, tuning = self._raw(estimate.time_us), self._tuning
        sticks = shaped(raw, tuning.curves)
        yaw_rate = self._advance_yaw(sticks.yaw, estimate, dt)
        q = attitude(sticks.forward, sticks.right, self._yaw, tuning.tilt_max)
        thrust = self._thrust(raw, status, estimate.time_us)
        self._attitude.publish(VehicleAttitudeSetpoint(estimate.time_us, q, yaw_rate, thrust))

    def _fly_rates(self, estimate: VehicleLocalPosition, status: VehicleStatus) -> None:
        raw, tuning = self._raw(estimate.time_us), self._tuning
        with_curves = raw._replace(
            forward=with_expo(raw.forward, tuning.acro_expo),
            right=with_expo(raw.right, tuning.acro_expo),
            yaw=with_expo(raw.yaw, tuning.acro_yaw_expo),
        )
        thrust = self._thrust(raw, status, estimate.time_us)
        rates = body_rates(with_curves, tuning.acro_rates_frd)
        self._rates.publish(VehicleRatesSetpoint(estimate.time_us, rates, thrust))

    def _thrust(self, raw: ManualControlSetpoint, status: VehicleStatus, now_us: int) -> float:
        """Thrust [-] of the throttle stick; zero while disarmed or spooling up."""
        if not status.armed or now_us - status.armed_since_us < self._tuning.spool_up_us:
            return 0.0
        return thrust(raw.up, self._tuning.throttle, landed=self._landed)

    def _vertical(self, up: float, estimate: VehicleLocalPosition) -> float:
        """Vertical velocity [m/s, down] of the throttle stick, slower near the ground."""
        ground = ground_down(self._terrain_estimate.value, estimate.time_us)
        if math.isnan(ground):
            home = self._home.value
            ground = home.position_ned[2] if home is not None else 0.0
        sink = self._tuning.descent.limit(ground - estimate.position_ned[2])
        return climb_velocity(up, self._tuning.speed_up, sink)

    def _advance_yaw(self, stick: float, estimate: VehicleLocalPosition, dt: float) -> float:
        """Advance the heading setpoint and return its rate [rad/s]."""
        rate = 0.0 if self._landed else stick * self._tuning.yaw_rate_max
        self._yaw = advanced_yaw(self._yaw, rate, estimate.heading, dt)
        return rate

    def _read_parameters(self) -> None:
        self._parameter_version = self._registry.version
        self._tuning: Tuning = tuning_from(self._registry)
