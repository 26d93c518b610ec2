"""State of the vehicle at one moment, as the observer has read it from the topics."""

import math
from typing import NamedTuple

from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.control_mode import ManualControlSetpoint, OffboardSetpoint
from uav_firmware.msg.estimate import (
    AidSource,
    EstimatorStatus,
    TerrainEstimate,
    VehicleAttitude,
    VehicleLocalPosition,
    WindEstimate,
)
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.geofence import GeofenceStatus
from uav_firmware.msg.mission import MissionProgress, NavigatorStatus
from uav_firmware.msg.sensors import SensorGps, SensorsStatus
from uav_firmware.msg.status import HomePosition, InternalErrors, LandDetected, StorageStatus


class SensorAges(NamedTuple):
    """Time since each sensor was last received [s]; infinite when never."""

    imu: float
    baro: float
    mag: float
    gps: float
    battery: float
    link: float  # Heartbeat of a ground station
    sticks: float  # MANUAL_CONTROL
    offboard: float  # Streamed setpoint
    range: float = math.inf  # Height above what lies below


class VehicleView(NamedTuple):
    """State at one moment; None where nothing has been published yet."""

    now_us: int  # [us]
    attitude: VehicleAttitude | None
    position: VehicleLocalPosition | None
    estimator: EstimatorStatus | None
    gps: SensorGps | None
    battery: BatteryStatus | None
    land: LandDetected | None
    home: HomePosition | None
    progress: MissionProgress | None
    navigator: NavigatorStatus | None
    fence: GeofenceStatus | None
    failure: FailureDetectorStatus | None
    storage: StorageStatus | None
    storage_check: int  # [-] COM_ARM_SDCARD
    wind: WindEstimate | None
    wind_limit_m_s: float  # [m/s] COM_WIND_MAX; negative: none
    sticks: ManualControlSetpoint | None
    sticks_fresh: bool  # Received within COM_RC_LOSS_T
    offboard: OffboardSetpoint | None
    offboard_fresh: bool  # Streamed at more than 2 Hz
    ages: SensorAges
    imu_delivers: bool = True  # Its newest sample holds a rate
    latched_failures: tuple[str, ...] = ()  # Of former flights, not acknowledged
    sensors: SensorsStatus | None = None  # Which instances have failed
    internal_errors: InternalErrors | None = None
    terrain: TerrainEstimate | None = None  # Ground below

    @property
    def aligned(self) -> bool:
        """Whether tilt and heading are estimated."""
        return self.estimator is not None and self.estimator.aligned

    @property
    def gyro_broken(self) -> bool:
        """Whether the bias of the gyroscope is beyond its limit."""
        return self.estimator is not None and self.estimator.gyro_broken

    @property
    def accel_broken(self) -> bool:
        """Whether the bias of the accelerometer has been beyond its limit."""
        return self.estimator is not None and self.estimator.accel_broken

    @property
    def crashed(self) -> bool:
        """Whether a crash was detected and has not been acknowledged."""
        return self.failure is not None and self.failure.crash != ""

    @property
    def motor_failed(self) -> bool:
        """Whether a motor has failed, in this flight or in one that was not acknowledged."""
        return self.failure is not None and self.failure.failed_motors != 0

    @property
    def stopped(self) -> AidSource:
        """Sources that the estimator does not use, since they disagree with the others."""
        return AidSource(0) if self.estimator is None else self.estimator.stopped

    @property
    def gyro_lost(self) -> bool:
        """Whether no gyroscope is left."""
        return self.sensors is not None and self.sensors.gyro_lost

    @property
    def accel_lost(self) -> bool:
        """Whether no accelerometer is left."""
        return self.sensors is not None and self.sensors.accel_lost

    @property
    def landed(self) -> bool:
        """Whether the vehicle is on the ground."""
        return self.land is None or self.land.landed

    @property
    def resting(self) -> bool:
        """Whether it is on the ground and its rotors cannot lift it."""
        return self.land is None or (self.land.landed and self.land.has_low_throttle)

    @property
    def dead_reckoning(self) -> bool:
        """Whether the position is by dead reckoning from the last fix."""
        return self.position is not None and self.position.dead_reckoning

    @property
    def position_valid(self) -> bool:
        """Whether position and velocity are observed on all axes."""
        estimate = self.position
        return (
            estimate is not None
            and estimate.position_valid
            and estimate.velocity_valid
            and estimate.altitude_valid
        )
