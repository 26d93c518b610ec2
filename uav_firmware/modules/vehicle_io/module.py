"""Writes the motors, lets a control step pass and publishes what the instruments say."""

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


class VehicleIoModule:
    """The only module that touches the component abstraction layer's vehicle."""

    def __init__(
        self,
        vehicle: Vehicle,
        *,
        motors: Topic[ActuatorMotors],
        imu: Topic[SensorImu],
        baro: Topic[SensorBaro],
        mag: Topic[SensorMag],
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
        self._imu = imu
        self._baro = baro
        self._mag = mag
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
            vehicle.write_motors(motors.control)
        vehicle.advance()
        self._imu.publish(vehicle.read_imu())
        if (baro := vehicle.read_baro()) is not None:
            self._baro.publish(baro)
        if (mag := vehicle.read_mag()) is not None:
            self._mag.publish(mag)
        if (gps := vehicle.read_gps()) is not None:
            self._gps.publish(gps)
        if (battery := vehicle.read_battery()) is not None:
            self._battery.publish(battery)
        if (esc := vehicle.read_esc()) is not None:
            self._esc.publish(esc)
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
