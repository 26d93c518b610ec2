"""The topics and queues that the MAVLink module reads and writes."""

from dataclasses import dataclass, field

from uav_firmware.bus import Queue, Topic
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.control_mode import ManualControlSetpoint, OffboardSetpoint
from uav_firmware.msg.estimate import (
    EstimatorStatus,
    VehicleAttitude,
    VehicleGlobalPosition,
    VehicleLocalPosition,
    WindEstimate,
)
from uav_firmware.msg.geofence import Fence, GeofenceStatus, RallyPoints
from uav_firmware.msg.guidance import FollowTarget, OrbitStatus
from uav_firmware.msg.link import RefusedFrames
from uav_firmware.msg.log import LogStreamChunk, LogStreamRequest
from uav_firmware.msg.mission import Mission, MissionProgress
from uav_firmware.msg.payload import (
    CameraEvent,
    CameraLens,
    CameraStatus,
    GimbalStatus,
    PayloadOrder,
    TrackingState,
)
from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorGps,
    SensorGround,
    SensorHygrometer,
    SensorImu,
    SensorMag,
    SensorRange,
    SensorTruth,
)
from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)
from uav_firmware.msg.status import (
    HomePosition,
    LandDetected,
    StatusText,
    VehicleCommand,
    VehicleCommandAck,
    VehicleStatus,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MavlinkTopics:
    """Every connection of the module to the bus; the last three are written, the rest read."""

    attitude: Topic[VehicleAttitude]
    local_position: Topic[VehicleLocalPosition]
    global_position: Topic[VehicleGlobalPosition]
    estimator_status: Topic[EstimatorStatus]
    gps: Topic[SensorGps]
    imu: Topic[SensorImu]
    baro: Topic[SensorBaro]
    battery: Topic[BatteryStatus]
    vehicle_status: Topic[VehicleStatus]
    land_detected: Topic[LandDetected]
    home: Topic[HomePosition]
    mission_progress: Topic[MissionProgress]
    trajectory_setpoint: Topic[TrajectorySetpoint]
    actuator_motors: Topic[ActuatorMotors]
    truth: Topic[SensorTruth]
    command_ack: Queue[VehicleCommandAck]
    status_text: Queue[StatusText]
    vehicle_command: Queue[VehicleCommand]
    mission: Topic[Mission]
    fence: Topic[Fence] = field(default_factory=Topic)
    rally_points: Topic[RallyPoints] = field(default_factory=Topic)
    geofence_status: Topic[GeofenceStatus] = field(default_factory=Topic)
    orbit_status: Topic[OrbitStatus] = field(default_factory=Topic)
    follow_target: Topic[FollowTarget] = field(default_factory=Topic)
    ground_station_heartbeat: Topic[int] = field(default_factory=Topic)  # [us] When heard
    manual_control_setpoint: Topic[ManualControlSetpoint] = field(default_factory=Topic)
    offboard_setpoint: Topic[OffboardSetpoint] = field(default_factory=Topic)
    attitude_setpoint: Topic[VehicleAttitudeSetpoint] = field(default_factory=Topic)
    rates_setpoint: Topic[VehicleRatesSetpoint] = field(default_factory=Topic)
    wind: Topic[WindEstimate] = field(default_factory=Topic)
    payload_order: Queue[PayloadOrder] = field(default_factory=Queue)
    camera_event: Queue[CameraEvent] = field(default_factory=Queue)
    camera_status: Topic[CameraStatus] = field(default_factory=Topic)
    camera_lens: Topic[CameraLens] = field(default_factory=Topic)
    gimbal_status: Topic[GimbalStatus] = field(default_factory=Topic)
    tracking_state: Topic[TrackingState] = field(default_factory=Topic)
    mag: Topic[SensorMag] = field(default_factory=Topic)
    hygrometer: Topic[SensorHygrometer] = field(default_factory=Topic)
    ground_sample: Topic[SensorGround] = field(default_factory=Topic)
    range_finder: Topic[SensorRange] = field(default_factory=Topic)
    refused_frames: Topic[RefusedFrames] = field(default_factory=Topic)
    log_stream_request: Topic[LogStreamRequest] = field(default_factory=Topic)
    log_stream: Queue[LogStreamChunk] = field(default_factory=Queue)
