"""Reads the topics into one view of the vehicle, and estimates the wind."""

import math
from typing import Any, Final

from uav_firmware.bus import Topic
from uav_firmware.lib.atmosphere import density_at
from uav_firmware.lib.drag import DragModel
from uav_firmware.modules.commander.failsafe.machine import FailureLatch
from uav_firmware.modules.commander.failsafe.params import FailsafeParams
from uav_firmware.modules.commander.failsafe.wind import WindEstimator
from uav_firmware.modules.commander.vehicle_view import SensorAges, VehicleView
from uav_firmware.msg.estimate import WindEstimate
from uav_firmware.msg.sensors import SensorImu
from uav_firmware.topics import Topics

OFFBOARD_FRESH_S: Final = 0.5  # 2 Hz
_WIND_PERIOD_US: Final = 100_000  # 10 Hz


class TopicAge:
    """Age of the newest value of a topic, from when it was first read."""

    __slots__ = ("_count", "_read_us", "_topic")

    def __init__(self, topic: Topic[object]) -> None:
        self._topic = topic
        self._count = 0
        self._read_us: int | None = None

    def age(self, now_us: int) -> float:
        """Time since the last new value [s]; infinite when there was none."""
        if self._topic.count != self._count:
            self._count = self._topic.count
            self._read_us = now_us
        return math.inf if self._read_us is None else (now_us - self._read_us) * 1e-6


class Observer:
    """Holds the ages of the topics and the wind estimate of this flight."""

    def __init__(self, topics: Topics, latch: FailureLatch) -> None:
        self._topics = topics
        self._latch = latch
        aged: tuple[Topic[Any], ...] = (
            topics.sensor_imu,
            topics.sensor_baro,
            topics.sensor_mag,
            topics.sensor_gps,
            topics.battery_status,
            topics.ground_station_heartbeat,
            topics.manual_control_setpoint,
            topics.offboard_setpoint,
            topics.sensor_range,
        )
        self._ages = [TopicAge(topic) for topic in aged]
        self._wind = WindEstimator()
        self._wind_us = 0

    def read(self, now_us: int, params: FailsafeParams) -> VehicleView:
        """State of the vehicle at this moment."""
        topics = self._topics
        ages = SensorAges(*[topic.age(now_us) for topic in self._ages])
        # Positional: keywords take three times as long, fifty times a second
        return VehicleView(
            now_us,
            topics.vehicle_attitude.value,
            topics.vehicle_local_position.value,
            topics.estimator_status.value,
            topics.sensor_gps.value,
            topics.battery_status.value,
            topics.land_detected.value,
            topics.home_position.value,
            topics.mission_progress.value,
            topics.navigator_status.value,
            topics.geofence_status.value,
            topics.failure_detector_status.value,
            topics.storage_status.value,
            params.storage_check,
            topics.wind.value,
            params.wind_max_m_s,
            topics.manual_control_setpoint.value,
            ages.sticks <= params.sticks_loss_s,
            topics.offboard_setpoint.value,
            ages.offboard <= OFFBOARD_FRESH_S,
            ages,
            _has_rate(topics.sensor_imu.value),
            self._latch.texts,
            topics.sensors_status.value,
            topics.internal_errors.value,
            topics.terrain_estimate.value,
        )

    def observe_wind(self, view: VehicleView, drag: DragModel) -> None:
        """Update and publish the wind estimate, ten times a second in the air."""
        if view.landed:
            self._wind.restart()
            return
        elapsed_us = view.now_us - self._wind_us
        if elapsed_us < _WIND_PERIOD_US:
            return
        self._wind_us = view.now_us
        estimate, attitude = view.position, view.attitude
        if estimate is None or attitude is None or not estimate.velocity_valid:
            return
        self._wind.update(
            attitude.q_ned_frd,
            estimate.acceleration_ned,
            estimate.velocity_ned,
            min(elapsed_us * 1e-6, 1.0),
        )
        altitude = estimate.origin_altitude_amsl_m - estimate.position_ned[2]
        wind = self._wind.wind(drag, _density(altitude))
        if wind is not None:
            self._topics.wind.publish(WindEstimate(view.now_us, *wind))


def _has_rate(imu: SensorImu | None) -> bool:
    """Whether a sample holds a rate: a driver reports NaN for a failed gyroscope."""
    return imu is None or math.isfinite(sum(imu.rate_frd))


def _density(altitude_amsl_m: float) -> float:
    """Density of the air [kg/m^3]; that at sea level when the altitude is unknown."""
    return density_at(altitude_amsl_m if math.isfinite(altitude_amsl_m) else 0.0)
