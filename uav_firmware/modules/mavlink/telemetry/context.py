"""What a builder may look at: the topics, the time and a few facts of the module."""

from typing import NamedTuple

from uav_firmware.modules.mavlink.topics import MavlinkTopics
from uav_firmware.msg.vectors import Vector3


class BatteryThresholds(NamedTuple):
    """Remaining charge, 0 to 1, below which each warning holds."""

    low: float
    critical: float
    emergency: float


class Context(NamedTuple):
    """One instant of the vehicle as the telemetry sees it."""

    topics: MavlinkTopics
    now_us: int  # [us] Since boot
    boot_time_utc_us: int  # [us] Since 1970; 0 when unknown
    system_id: int
    battery_thresholds: BatteryThresholds
    vibration_frd: Vector3  # [m/s^2] Mean change between accelerometer samples
