"""The topics and queues that the commander reads and writes."""

from dataclasses import dataclass, field
from typing import Any

from uav_firmware.bus import Queue, Topic
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.control_mode import (
    ManualControlSetpoint,
    OffboardSetpoint,
    VehicleControlMode,
)
from uav_firmware.msg.estimate import (
    EstimatorStatus,
    VehicleAttitude,
    VehicleLocalPosition,
    WindEstimate,
)
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.geofence import GeofenceStatus
from uav_firmware.msg.mission import Mission, MissionProgress, NavigatorRequest, NavigatorStatus
from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorGps,
    SensorImu,
    SensorMag,
    SensorRange,
    SensorsStatus,
)
from uav_firmware.msg.status import (
    HomePosition,
    LandDetected,
    StatusText,
    StorageStatus,
    VehicleCommand,
    VehicleCommandAck,
    VehicleStatus,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CommanderTopics:
    """Every connection of the module to the bus; what it writes comes last."""

    vehicle_command: Queue[VehicleCommand] = field(default_factory=Queue)
    vehicle_attitude: Topic[VehicleAttitude] = field(default_factory=Topic)
    vehicle_local_position: Topic[VehicleLocalPosition] = field(default_factory=Topic)
    estimator_status: Topic[EstimatorStatus] = field(default_factory=Topic)
    land_detected: Topic[LandDetected] = field(default_factory=Topic)
    mission: Topic[Mission] = field(default_factory=Topic)
    mission_progress: Topic[MissionProgress] = field(default_factory=Topic)
    navigator_status: Topic[NavigatorStatus] = field(default_factory=Topic)
    geofence_status: Topic[GeofenceStatus] = field(default_factory=Topic)
    storage_status: Topic[StorageStatus] = field(default_factory=Topic)
    failure_detector_status: Topic[FailureDetectorStatus] = field(default_factory=Topic)
    sensors_status: Topic[SensorsStatus] = field(default_factory=Topic)
    sensor_imu: Topic[SensorImu] = field(default_factory=Topic)
    sensor_baro: Topic[SensorBaro] = field(default_factory=Topic)
    sensor_mag: Topic[SensorMag] = field(default_factory=Topic)
    sensor_gps: Topic[SensorGps] = field(default_factory=Topic)
    sensor_range: Topic[SensorRange] = field(default_factory=Topic)
    battery_status: Topic[BatteryStatus] = field(default_factory=Topic)
    ground_station_heartbeat: Topic[Any] = field(default_factory=Topic)
    manual_control_setpoint: Topic[ManualControlSetpoint] = field(default_factory=Topic)
    offboard_setpoint: Topic[OffboardSetpoint] = field(default_factory=Topic)
    vehicle_command_ack: Queue[VehicleCommandAck] = field(default_factory=Queue)
    vehicle_status: Topic[VehicleStatus] = field(default_factory=Topic)
    vehicle_control_mode: Topic[VehicleControlMode] = field(default_factory=Topic)
    home_position: Topic[HomePosition] = field(default_factory=Topic)
    wind: Topic[WindEstimate] = field(default_factory=Topic)
    navigator_request: Queue[NavigatorRequest] = field(default_factory=Queue)
    status_text: Queue[StatusText] = field(default_factory=Queue)
