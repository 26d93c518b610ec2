"""Estimator on the bus: sensor topics in, attitude, position and status out."""

import math
from typing import Final, TypeVar

from uav_firmware.bus import Topic
from uav_firmware.lib.drag import DragModel
from uav_firmware.lib.rotation import yaw_of
from uav_firmware.modules.estimator.ekf_core import EkfCore
from uav_firmware.modules.estimator.estimator import Estimator
from uav_firmware.modules.estimator.health import Validity, status_flags
from uav_firmware.modules.estimator.kalman_filter.state import VELOCITY
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.msg.estimate import (
    EstimatorStatus,
    VehicleAttitude,
    VehicleGlobalPosition,
    VehicleLocalPosition,
)
from uav_firmware.msg.sensors import (
    ImuShift,
    SensorBaro,
    SensorGps,
    SensorImu,
    SensorMag,
    SensorsStatus,
)
from uav_firmware.msg.setpoints import VehicleTorqueThrustSetpoint
from uav_firmware.msg.status import LandDetected
from uav_firmware.parameters import Registry

T = TypeVar("T")

_DRAG_PARAMETERS: Final = ("EKF2_BCOEF_X", "EKF2_BCOEF_Y", "EKF2_MCOEF")  # The commander's
_GLOBAL_EVERY_US: Final = 20_000  # Validity and accuracy too: they change slowly
_STATUS_EVERY_US: Final = 200_000


def drag_of(registry: Registry) -> DragModel | None:
    """Drag of the airframe; None where its coefficients are not declared, or give no airspeed."""
    if not set(_DRAG_PARAMETERS) <= set(registry.names()):
        return None
    drag = DragModel(*(float(registry.get(name)) for name in _DRAG_PARAMETERS))
    return drag if drag.gives_airspeed else None


class EstimatorModule:
    """Thin shell about `Estimator`: which topics are new, and when to publish what.

    `update` is called once per control step, after the driver has published the sensors.
    Attitude and local position follow each inertial sample, global position at 50 Hz, status
    at 5 Hz. Attitude appears with the alignment, global position with the origin. The registry
    must contain `EstimatorParams`.
    """

    def __init__(
        self,
        *,
        imu: Topic[SensorImu],
        baro: Topic[SensorBaro],
        mag: Topic[SensorMag],
        gps: Topic[SensorGps],
        attitude: Topic[VehicleAttitude],
        local_position: Topic[VehicleLocalPosition],
        global_position: Topic[VehicleGlobalPosition],
        estimator_status: Topic[EstimatorStatus],
        registry: Registry,
        landed: Topic[LandDetected],
        imu_shift: Topic[ImuShift],
        sensors_status: Topic[SensorsStatus],
        torque_thrust: Topic[VehicleTorqueThrustSetpoint],
    ) -> None:
        self._registry = registry
        self._seen_version = registry.version
        self.estimator = Estimator(registry.read(EstimatorParams), drag_of(registry))
        self._imu, self._baro, self._mag, self._gps = imu, baro, mag, gps
        self._landed = landed
        self._imu_shift = imu_shift
        self._sensors_status = sensors_status
        self._torque_thrust = torque_thrust
        self._attitude = attitude
        self._local_position = local_position
        self._global_position = global_position
        self._status = estimator_status
        self._counts = [0, 0, 0, 0, 0, 0, 0]
        self._aid_counts = (0, 0, 0, 0)
        self._validity = Validity()
        self._accuracy_m = (math.nan, math.nan)
        self._sink_accuracy_m_s = math.inf
        self._global_due_us = 0
        self._status_due_us = 0

    def update(self) -> None:
        """Process new messages of the topics and publish the estimate."""
        if self._registry.version != self._seen_version:
            self._seen_version = self._registry.version
            self.estimator.configure(self._registry.read(EstimatorParams), drag_of(self._registry))
        imu = self._new(0, self._imu)
        if imu is None:
            return
        estimator = self.estimator
        shift = self._new(5, self._imu_shift)
        if shift is not None:
            estimator.shift_biases(shift)
        sensors = self._new(6, self._sensors_status)
        if sensors is not None:
            estimator.update_sensors(sensors)
        commanded = self._torque_thrust.value
        if commanded is not None:
            estimator.imu_checks.expect_thrust(commanded.thrust)
        if not estimator.update_imu(imu):
            self._publish_status(imu.time_us)
            return
        self._update_aids(estimator)
        estimator.finish_step()
        if estimator.core is not None:
            self._publish(estimator.core)

    def _new(self, index: int, topic: Topic[T]) -> T | None:
        """The value of a topic if it has not been seen yet."""
        if topic.count == self._counts[index]:
            return None
        self._counts[index] = topic.count
        return topic.value

    def _update_aids(self, estimator: Estimator) -> None:
        counts = (self._landed.count, self._mag.count, self._baro.count, self._gps.count)
        if counts == self._aid_counts:  # Most steps bring an inertial sample alone
            return
        self._aid_counts = counts
        landed = self._new(1, self._landed)
        if landed is not None:
            estimator.update_landed(landed)
        mag = self._new(2, self._mag)
        if mag is not None:
            estimator.update_mag(mag)
        baro = self._new(3, self._baro)
        if baro is not None:
            estimator.update_baro(baro)
        gps = self._new(4, self._gps)
        if gps is not None:
            estimator.update_gps(gps)

    def _publish(self, core: EkfCore) -> None:
        """Attitude and local position now, the others when they are due."""
        state, time_us = core.state, core.time_us
        self._attitude.publish(VehicleAttitude(time_us, state.q_ned_frd, self.estimator.rate_frd))
        if time_us >= self._global_due_us:
            self._global_due_us = time_us + _GLOBAL_EVERY_US
            self._validity = self.estimator.validity()
            self._accuracy_m = self.estimator.accuracy_m()
            self._sink_accuracy_m_s = core.ekf.sigma(VELOCITY.stop - 1)
            self._publish_global(core)
        self._publish_local(core)
        self._publish_status(time_us)

    def _publish_local(self, core: EkfCore) -> None:
        state, origin, validity = core.state, core.origin, self._validity
        horizontal, vertical = self._accuracy_m
        latitude, longitude, altitude = (
            (math.nan, math.nan, math.nan)
            if origin is None
            else (origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m)
        )
        self._local_position.publish(
            VehicleLocalPosition(
                core.time_us,
                state.position_ned,
                state.velocity_ned,
                core.ekf.acceleration_ned,
                yaw_of(state.q_ned_frd),
                latitude,
                longitude,
                altitude,
                horizontal,
                vertical,
                validity.position,
                validity.altitude,
                validity.velocity,
                validity.heading,
                core.reset_log.resets,
                validity.dead_reckoning,
                self._sink_accuracy_m_s,
            )
        )

    def _publish_global(self, core: EkfCore) -> None:
        if core.origin is None:
            return
        latitude, longitude, altitude = core.origin.to_geodetic(core.state.position_ned)
        horizontal, vertical = self._accuracy_m
        self._global_position.publish(
            VehicleGlobalPosition(core.time_us, latitude, longitude, altitude, horizontal, vertical)
        )

    def _publish_status(self, time_us: int) -> None:
        if time_us < self._status_due_us:
            return
        self._status_due_us = time_us + _STATUS_EVERY_US
        estimator, core = self.estimator, self.estimator.core
        horizontal, vertical = self._accuracy_m
        self._status.publish(
            EstimatorStatus(
                time_us,
                status_flags(self._validity),
                estimator.gps.velocity.ratio,
                estimator.gps.horizontal.ratio,
                max(estimator.gps.vertical.ratio, estimator.baro.height.ratio),
                estimator.compass.heading.ratio,
                horizontal,
                vertical,
                (0.0, 0.0, 0.0) if core is None else core.state.gyro_bias_frd,
                aligned=core is not None and estimator.compass.aligned,
                gyro_broken=estimator.gyro_broken,
                gyro_jump_us=estimator.gyro_jump_us,
                accel_bias_frd=(0.0, 0.0, 0.0) if core is None else core.state.accel_bias_frd,
                accel_broken=estimator.accel_broken,
                stopped=estimator.stopped,
                heading_set_us=None if core is None else core.heading_set_us,
            )
        )
