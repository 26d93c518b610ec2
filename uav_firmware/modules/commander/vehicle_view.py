"""What the commander sees of the vehicle at one moment; made by the module, read by the rest."""

from typing import NamedTuple

from uav_firmware.msg.estimate import VehicleAttitude, VehicleLocalPosition
from uav_firmware.msg.mission import MissionProgress, NavigatorStatus
from uav_firmware.msg.sensors import SensorBattery, SensorGps
from uav_firmware.msg.status import HomePosition, LandDetected


class SensorAges(NamedTuple):
    """Time since each sensor was last heard [s]; infinite when never."""

    imu: float
    baro: float
    mag: float
    gps: float
    battery: float
    link: float  # Heartbeat of a ground station


class VehicleView(NamedTuple):
    """One moment; None where nothing has been published yet."""

    now_us: int  # [us]
    attitude: VehicleAttitude | None
    position: VehicleLocalPosition | None
    aligned: bool  # The estimator knows tilt and heading
    gps: SensorGps | None
    battery: SensorBattery | None
    land: LandDetected | None
    home: HomePosition | None
    progress: MissionProgress | None
    navigator: NavigatorStatus | None
    ages: SensorAges

    @property
    def landed(self) -> bool:
        """Whether the vehicle stands on the ground."""
        return self.land is None or self.land.landed

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
