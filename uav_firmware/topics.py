"""Every topic and queue of one vehicle; writers and readers: docs/reference/autopilot-topics.md."""

from dataclasses import dataclass, field
from typing import Any, Final

from uav_firmware.bus import Fork, Queue, Topic
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.control_mode import (
    ManualControlSetpoint,
    OffboardSetpoint,
    VehicleControlMode,
)
from uav_firmware.msg.estimate import (
    EstimatorStatus,
    HoverThrustEstimate,
    TerrainEstimate,
    VehicleAttitude,
    VehicleGlobalPosition,
    VehicleLocalPosition,
    WindEstimate,
)
from uav_firmware.msg.failure import FailureDetectorStatus, RotorLossThrust
from uav_firmware.msg.geofence import Fence, GeofenceStatus, RallyPoints
from uav_firmware.msg.guidance import FollowTarget, OrbitStatus, RegionOfInterest
from uav_firmware.msg.link import RefusedFrames
from uav_firmware.msg.log import LogStreamChunk, LogStreamRequest
from uav_firmware.msg.mission import (
    Mission,
    MissionProgress,
    NavigatorRequest,
    NavigatorStatus,
    PlanCheckRequest,
    PlanCheckResult,
    TargetCheckRequest,
    TargetCheckResult,
)
from uav_firmware.msg.payload import (
    CameraEvent,
    CameraLens,
    CameraStatus,
    GimbalStatus,
    PayloadOrder,
    TrackingState,
)
from uav_firmware.msg.sensors import (
    ImuShift,
    SensorBaro,
    SensorBattery,
    SensorEsc,
    SensorGps,
    SensorGround,
    SensorHygrometer,
    SensorImu,
    SensorMag,
    SensorRange,
    SensorsStatus,
    SensorTruth,
)
from uav_firmware.msg.setpoints import (
    ControlAllocatorStatus,
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
    VehicleTorqueThrustSetpoint,
)
from uav_firmware.msg.status import (
    HomePosition,
    InternalErrors,
    LandDetected,
    ParameterSaveRequest,
    ParameterSaveResult,
    StatusText,
    StorageStatus,
    VehicleCommand,
    VehicleCommandAck,
    VehicleStatus,
)

_LONG_QUEUE: Final = 2048


def _rate(hertz: float) -> dict[str, float]:
    """A topic is published at this rate at least; without one, on change only."""
    return {"rate_hz": hertz}


def _long_queue() -> Queue[Any]:
    return Queue(_LONG_QUEUE)


@dataclass(frozen=True, slots=True)
class Topics:
    """Empty at first; each vehicle has its own.

    The field states the type of the message and how often it is published.
    """

    sensor_imus: Topic[tuple[SensorImu, ...]] = field(default_factory=Topic, metadata=_rate(250))
    sensor_baros: Topic[tuple[SensorBaro | None, ...]] = field(
        default_factory=Topic, metadata=_rate(50)
    )
    sensor_mags: Topic[tuple[SensorMag | None, ...]] = field(
        default_factory=Topic, metadata=_rate(50)
    )
    sensors_status: Topic[SensorsStatus] = field(default_factory=Topic, metadata=_rate(1))
    imu_shift: Topic[ImuShift] = field(default_factory=Topic)
    sensor_imu: Topic[SensorImu] = field(default_factory=Topic, metadata=_rate(250))
    sensor_baro: Topic[SensorBaro] = field(default_factory=Topic, metadata=_rate(50))
    sensor_mag: Topic[SensorMag] = field(default_factory=Topic, metadata=_rate(50))
    sensor_gps: Topic[SensorGps] = field(default_factory=Topic, metadata=_rate(10))
    sensor_battery: Topic[SensorBattery] = field(default_factory=Topic, metadata=_rate(10))
    battery_status: Topic[BatteryStatus] = field(default_factory=Topic, metadata=_rate(10))
    sensor_hygrometer: Topic[SensorHygrometer] = field(default_factory=Topic, metadata=_rate(1))
    sensor_ground: Topic[SensorGround] = field(default_factory=Topic, metadata=_rate(1))
    sensor_range: Topic[SensorRange] = field(default_factory=Topic, metadata=_rate(20))
    sensor_esc: Topic[SensorEsc] = field(default_factory=Topic, metadata=_rate(125))
    sensor_truth: Topic[SensorTruth] = field(default_factory=Topic, metadata=_rate(50))
    vehicle_attitude: Topic[VehicleAttitude] = field(default_factory=Topic, metadata=_rate(250))
    vehicle_local_position: Topic[VehicleLocalPosition] = field(
        default_factory=Topic, metadata=_rate(250)
    )
    vehicle_global_position: Topic[VehicleGlobalPosition] = field(
        default_factory=Topic, metadata=_rate(50)
    )
    estimator_status: Topic[EstimatorStatus] = field(default_factory=Topic, metadata=_rate(5))
    wind: Topic[WindEstimate] = field(default_factory=Topic)
    vehicle_status: Topic[VehicleStatus] = field(default_factory=Topic, metadata=_rate(2))
    land_detected: Topic[LandDetected] = field(default_factory=Topic, metadata=_rate(1))
    terrain_estimate: Topic[TerrainEstimate] = field(default_factory=Topic)
    storage_status: Topic[StorageStatus] = field(default_factory=Topic)
    internal_errors: Topic[InternalErrors] = field(default_factory=Topic)
    home_position: Topic[HomePosition] = field(default_factory=Topic)
    mission: Topic[Mission] = field(default_factory=Topic)
    mission_progress: Topic[MissionProgress] = field(default_factory=Topic)
    navigator_request: Queue[NavigatorRequest] = field(default_factory=Queue)
    navigator_status: Topic[NavigatorStatus] = field(default_factory=Topic)
    target_check_request: Queue[TargetCheckRequest] = field(default_factory=Queue)
    target_check_result: Queue[TargetCheckResult] = field(default_factory=Queue)
    plan_check_request: Queue[PlanCheckRequest] = field(default_factory=Queue)
    plan_check_result: Queue[PlanCheckResult] = field(default_factory=Queue)
    vehicle_control_mode: Topic[VehicleControlMode] = field(default_factory=Topic)
    manual_control_setpoint: Topic[ManualControlSetpoint] = field(default_factory=Topic)
    offboard_setpoint: Topic[OffboardSetpoint] = field(default_factory=Topic)
    fence: Topic[Fence] = field(default_factory=Topic)
    rally_points: Topic[RallyPoints] = field(default_factory=Topic)
    geofence_status: Topic[GeofenceStatus] = field(default_factory=Topic, metadata=_rate(9))
    follow_target: Topic[FollowTarget] = field(default_factory=Topic)
    orbit_status: Topic[OrbitStatus] = field(default_factory=Topic)
    region_of_interest: Topic[RegionOfInterest] = field(default_factory=Topic)
    payload_order: Queue[PayloadOrder] = field(default_factory=_long_queue)
    camera_event: Queue[CameraEvent] = field(default_factory=Queue)
    camera_status: Topic[CameraStatus] = field(default_factory=Topic)
    camera_lens: Topic[CameraLens] = field(default_factory=Topic)
    gimbal_status: Topic[GimbalStatus] = field(default_factory=Topic, metadata=_rate(25))
    tracking_state: Topic[TrackingState] = field(default_factory=Topic)
    trajectory_setpoint: Topic[TrajectorySetpoint] = field(
        default_factory=Topic, metadata=_rate(62.5)
    )
    hover_thrust_estimate: Topic[HoverThrustEstimate] = field(
        default_factory=Topic, metadata=_rate(62.5)
    )
    vehicle_attitude_setpoint: Topic[VehicleAttitudeSetpoint] = field(
        default_factory=Topic, metadata=_rate(62.5)
    )
    vehicle_rates_setpoint: Topic[VehicleRatesSetpoint] = field(
        default_factory=Topic, metadata=_rate(250)
    )
    vehicle_torque_thrust_setpoint: Topic[VehicleTorqueThrustSetpoint] = field(
        default_factory=Topic, metadata=_rate(250)
    )
    control_allocator_status: Topic[ControlAllocatorStatus] = field(default_factory=Topic)
    failure_detector_status: Topic[FailureDetectorStatus] = field(
        default_factory=Topic, metadata=_rate(1)
    )
    rotor_loss_thrust: Topic[RotorLossThrust] = field(default_factory=Topic)
    actuator_motors: Topic[ActuatorMotors] = field(default_factory=Topic, metadata=_rate(250))
    ground_station_heartbeat: Topic[int] = field(default_factory=Topic)
    log_stream_request: Topic[LogStreamRequest] = field(default_factory=Topic)
    log_stream: Queue[LogStreamChunk] = field(default_factory=Queue)
    refused_frames: Topic[RefusedFrames] = field(default_factory=Topic)
    parameter_save_request: Queue[ParameterSaveRequest] = field(default_factory=Queue)
    parameter_save_result: Queue[ParameterSaveResult] = field(default_factory=Queue)
    vehicle_command: Queue[VehicleCommand] = field(default_factory=Queue)
    vehicle_command_ack: Queue[VehicleCommandAck] = field(default_factory=Queue)
    status_text: Fork[StatusText] = field(default_factory=Fork)
