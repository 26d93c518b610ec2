"""Watches motion and thrust, publishes whether the vehicle stands, and where the ground is."""

import math
from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.lib.ground_contact import BLIND_DESCENT_M_S, STALE_SETPOINT_US
from uav_firmware.lib.terrain import TerrainFilter
from uav_firmware.modules.land_detector.params import LandDetectorParams
from uav_firmware.modules.land_detector.signs import (
    Observation,
    Thresholds,
    is_clear,
    lifts_off,
    stands,
    touches_ground,
)
from uav_firmware.modules.land_detector.states import LandEvent, next_state
from uav_firmware.msg.control_mode import ControlLevel, VehicleControlMode
from uav_firmware.msg.estimate import (
    HoverThrustEstimate,
    TerrainEstimate,
    VehicleAttitude,
    VehicleLocalPosition,
)
from uav_firmware.msg.sensors import SensorRange
from uav_firmware.msg.setpoints import TrajectorySetpoint, VehicleTorqueThrustSetpoint
from uav_firmware.msg.status import LandDetected, LandedState, NavigationState, VehicleStatus
from uav_firmware.parameters import Registry

_PERIOD_US: Final = 1_000_000  # repeated at least this often
_LIFT_OFF_S: Final = 0.1  # time that lift-off must be seen
_LANDING_HEIGHT: Final = 2.0  # [m] A descent below it is a landing in every mode
_LEADING_SPEED: Final = 0.1  # [m/s] Of a setpoint that leads up or down
_THROTTLE_MARGIN: Final = 0.01  # [-] A throttle that is down, above MPC_MANTHR_MIN
_LANDING_STATES: Final = frozenset({NavigationState.AUTO_LAND, NavigationState.AUTO_PRECLAND})


class LandDetectorModule:
    """Shell of the land detector: thresholds, times and the table of states."""

    def __init__(
        self,
        *,
        attitude: Topic[VehicleAttitude],
        local_position: Topic[VehicleLocalPosition],
        torque_thrust: Topic[VehicleTorqueThrustSetpoint],
        trajectory: Topic[TrajectorySetpoint],
        vehicle_status: Topic[VehicleStatus],
        land_detected: Topic[LandDetected],
        registry: Registry,
        vehicle_control_mode: Topic[VehicleControlMode],
        hover_thrust_estimate: Topic[HoverThrustEstimate],
        range_finder: Topic[SensorRange],
        terrain_estimate: Topic[TerrainEstimate],
    ) -> None:
        """`registry` must contain the thrusts of position_control and manual_control."""
        self._control_mode = vehicle_control_mode
        self._hover_thrust = hover_thrust_estimate
        self._attitude = attitude
        self._local_position = local_position
        self._torque_thrust = torque_thrust
        self._trajectory = trajectory
        self._vehicle_status = vehicle_status
        self._land_detected = land_detected
        self._range_finder = range_finder
        self._range_count = 0
        self._terrain = TerrainFilter()
        self._terrain_estimate = terrain_estimate
        self._registry = registry
        self._state = LandedState.ON_GROUND
        self._ground_down = 0.0  # [m] Down position of the ground where it last stood
        self._touching_since_us: int | None = None
        self._standing_since_us: int | None = None
        self._lifting_since_us: int | None = None
        self._retune()

    def update(self) -> None:
        """Run one step; publish on change and once a second."""
        position = self._local_position.value
        attitude = self._attitude.value
        status = self._vehicle_status.value
        if position is None or attitude is None or status is None:
            return
        if self._seen_version != self._registry.version:
            self._retune()
        self._measure_ground(attitude, position)
        if self._state is LandedState.ON_GROUND and not status.armed:
            self._ground_down = position.position_ned[2]
        torque_thrust = self._torque_thrust.value
        now_us = attitude.time_us
        seen = Observation(
            position.velocity_ned,
            attitude.rate_frd,
            0.0 if torque_thrust is None else torque_thrust.thrust,
            self._ground_down - position.position_ned[2],
            self._commanded_sink(position, now_us),
            position.sink_accuracy_m_s,
        )
        low_thrust = self._low_thrust
        self._note_times(seen, now_us, low_thrust, reckoned=position.dead_reckoning)
        for event in self._events(seen, status, now_us):
            self._state = next_state(self._state, event)
        low_throttle = not status.armed or seen.thrust <= low_thrust
        self._publish(now_us, status, low_throttle=low_throttle)

    def _measure_ground(self, attitude: VehicleAttitude, position: VehicleLocalPosition) -> None:
        """Publish where the ground is, with each sample of the range finder."""
        sample = self._range_finder.value
        if sample is None or self._range_finder.count == self._range_count:
            return
        self._range_count = self._range_finder.count
        terrain, former = self._terrain, self._terrain_estimate.value
        is_flying = self._state is not LandedState.ON_GROUND
        down = terrain.update(sample, attitude.q_ned_frd, position, is_flying=is_flying)
        had_failed = former is not None and former.has_failed
        if not math.isnan(down) or terrain.has_failed or had_failed:
            self._terrain_estimate.publish(
                TerrainEstimate(sample.time_us, down, terrain.has_failed)
            )

    def _note_times(
        self, seen: Observation, now_us: int, low_thrust: float, *, reckoned: bool
    ) -> None:
        """Remember since when each sign has held.

        A velocity that is reckoned by drag shows a wind to a vehicle that stands: it is no sign.
        """
        usual = self._limits
        limits = Thresholds(
            usual.vertical_speed,
            math.inf if reckoned else usual.horizontal_speed,
            usual.rotation,
            low_thrust,
            usual.lift_thrust,
        )
        if not touches_ground(seen, limits):
            self._touching_since_us = None
        elif self._touching_since_us is None:
            self._touching_since_us = now_us
        if not stands(seen, limits):
            self._standing_since_us = None
        elif self._standing_since_us is None:
            self._standing_since_us = now_us
        if not lifts_off(seen, limits):
            self._lifting_since_us = None
        elif self._lifting_since_us is None:
            self._lifting_since_us = now_us

    def _events(self, seen: Observation, status: VehicleStatus, now_us: int) -> list[LandEvent]:
        """What has been seen, the most certain first."""
        events = []
        if not status.armed:
            return [LandEvent.DISARM]
        if _held(self._standing_since_us, now_us, self._trigger_s):
            events.append(LandEvent.TOUCH_DOWN)
        if _held(self._lifting_since_us, now_us, _LIFT_OFF_S):
            events.append(LandEvent.LIFT_OFF)
        if is_clear(seen):
            events.append(LandEvent.CLEAR)
        leading = self._leading_speed()
        in_landing = status.navigation_state in _LANDING_STATES or seen.height < _LANDING_HEIGHT
        if leading > _LEADING_SPEED and in_landing:
            events.append(LandEvent.DESCEND)
        if leading < -_LEADING_SPEED:
            events.append(LandEvent.CLIMB)
        return events

    @property
    def _leads_height(self) -> bool:
        """Whether a trajectory leads; else throttle or thrust setpoint do."""
        control = self._control_mode.value
        return control is None or control.level is ControlLevel.POSITION

    def _commanded_sink(self, position: VehicleLocalPosition, now_us: int) -> float:
        """Vertical speed [m/s, down] commanded by the position loop, position error included."""
        if not self._leads_height:
            return math.inf
        setpoint = self._trajectory.value
        if setpoint is None or now_us - setpoint.time_us > STALE_SETPOINT_US:
            return BLIND_DESCENT_M_S
        forward = setpoint.velocity_ned[2]
        if not position.altitude_valid:  # position_control descends at any setpoint
            return BLIND_DESCENT_M_S if math.isnan(forward) else max(forward, BLIND_DESCENT_M_S)
        error = setpoint.position_ned[2] - position.position_ned[2]
        if math.isnan(error):
            return BLIND_DESCENT_M_S if math.isnan(forward) else forward
        return self._position_gain * error + (0.0 if math.isnan(forward) else forward)

    @property
    def _low_thrust(self) -> float:
        """Thrust [-] that cannot carry the weight."""
        if not self._leads_height:
            return self._lift_thrust
        learnt = self._hover_thrust.value
        hover = learnt.hover_thrust if learnt is not None and learnt.valid else self._believed_hover
        return self._least + self._low_share * (hover - self._least)

    def _leading_speed(self) -> float:
        """Vertical speed that the navigator asks for [m/s, down]; 0 when unset."""
        setpoint = self._trajectory.value
        if setpoint is None or math.isnan(setpoint.velocity_ned[2]):
            return 0.0
        return setpoint.velocity_ned[2]

    def _publish(self, now_us: int, status: VehicleStatus, *, low_throttle: bool) -> None:
        landed = self._state is LandedState.ON_GROUND
        contact = landed or (
            status.armed and _held(self._touching_since_us, now_us, 0.5 * self._trigger_s)
        )
        former = self._land_detected.value
        if (
            former is None
            or former.landed_state is not self._state
            or former.ground_contact is not contact
            or former.has_low_throttle is not low_throttle
            or now_us - former.time_us >= _PERIOD_US
        ):
            self._land_detected.publish(
                LandDetected(now_us, landed, contact, self._state, low_throttle)
            )

    def _retune(self) -> None:
        self._seen_version = self._registry.version
        params = self._registry.read(LandDetectorParams)
        self._least = self._registry.get("MPC_THR_MIN")
        self._believed_hover = self._registry.get("MPC_THR_HOVER")
        self._position_gain = self._registry.get("MPC_Z_P")
        self._low_share = params.low_thrust
        self._lift_thrust = self._registry.get("MPC_MANTHR_MIN") + _THROTTLE_MARGIN
        self._trigger_s = params.trigger_time_s
        self._limits = Thresholds(
            vertical_speed=params.vertical_speed_max,
            horizontal_speed=params.horizontal_speed_max,
            rotation=math.radians(params.rotation_max_deg_s),
            thrust=self._low_thrust,
            lift_thrust=self._lift_thrust,
        )


def _held(since_us: int | None, now_us: int, duration_s: float) -> bool:
    """Whether a sign has held for a while."""
    return since_us is not None and (now_us - since_us) * 1e-6 >= duration_s
