"""Writes the motors, lets a control step pass and publishes what the instruments say."""

from typing import Final

from uav_firmware.bus import Topic
from uav_firmware.cal.vehicle import Vehicle
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.sensors import (
    SensorBaro,
    SensorBattery,
    SensorEsc,
    SensorGps,
    SensorGround,
    SensorHygrometer,
    SensorImu,
    SensorMag,
    SensorRange,
    SensorTruth,
)
from uav_firmware.msg.vectors import Motors

MOTORS_STALE_US: Final = 200_000  # [us] Safety: an older command stops the motors
_STOPPED: Final[Motors] = (0.0, 0.0, 0.0, 0.0)


class VehicleIoModule:
    """The only module that touches the component abstraction layer's vehicle."""

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        motors: Topic[ActuatorMotors],
        imus: Topic[tuple[SensorImu, ...]],
        baros: Topic[tuple[SensorBaro | None, ...]],
        mags: Topic[tuple[SensorMag | None, ...]],
        gps: Topic[SensorGps],
        battery: Topic[SensorBattery],
        esc: Topic[SensorEsc],
        range_finder: Topic[SensorRange],
        hygrometer: Topic[SensorHygrometer],
        ground: Topic[SensorGround],
        truth: Topic[SensorTruth],
    ) -> None:
        self._vehicle = vehicle
        self._motors = motors
        self._imus, self._baros, self._mags = imus, baros, mags
        fitted = vehicle.fitted
        self._imu_instances = range(fitted.imus)
        self._baro_instances = range(fitted.barometers)
        self._mag_instances = range(fitted.compasses)
        self._gps = gps
        self._battery = battery
        self._esc = esc
        self._range_finder = range_finder
        self._hygrometer = hygrometer
        self._ground = ground
        self._truth = truth

    def update(self) -> None:
        """Let one control step pass. Publishes what is new after it."""
        vehicle = self._vehicle
        motors = self._motors.value
        if motors is not None:
            is_stale = vehicle.time_us - motors.time_us > MOTORS_STALE_US
            vehicle.write_motors(_STOPPED if is_stale else motors.control)
        vehicle.advance()
        self._imus.publish(tuple([vehicle.read_imu(i) for i in self._imu_instances]))
        if (esc := vehicle.read_esc()) is not None:
            self._esc.publish(esc)
        if not vehicle.only_fast:
            self._publish_slow(vehicle)

    def _publish_slow(self, vehicle: Vehicle) -> None:
        """Publish what is due less often than every other step."""
        baros = [vehicle.read_baro(i) for i in self._baro_instances]
        if any(baros):
            self._baros.publish(tuple(baros))
        mags = [vehicle.read_mag(i) for i in self._mag_instances]
        if any(mags):
            self._mags.publish(tuple(mags))
        if (gps := vehicle.read_gps()) is not None:
            self._gps.publish(gps)
        if (battery := vehicle.read_battery()) is not None:
            self._battery.publish(battery)
        if (distance := vehicle.read_range()) is not None:
            self._range_finder.publish(distance)
        if (air := vehicle.read_hygrometer()) is not None:
            self._hygrometer.publish(air)
        if (ground := vehicle.read_ground()) is not None:
            self._ground.publish(ground)

    def update_truth(self) -> None:
        """Publish the true state of a simulated vehicle, for display only."""
        if (truth := self._vehicle.read_truth()) is not None:
            self._truth.publish(truth)
