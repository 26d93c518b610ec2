"""Reads the power monitor's samples, publishes the estimated charge."""

import math

from uav_firmware.bus import Topic
from uav_firmware.modules.battery.charge import ChargeEstimator
from uav_firmware.modules.battery.params import BatteryParams
from uav_firmware.msg.battery import BatteryStatus
from uav_firmware.msg.sensors import SensorBattery
from uav_firmware.parameters import Registry


class BatteryModule:
    """Shell of the charge estimate; declares `BatteryParams`."""

    def __init__(
        self,
        registry: Registry,
        *,
        sensor_battery: Topic[SensorBattery],
        battery_status: Topic[BatteryStatus],
    ) -> None:
        registry.add(BatteryParams)
        self._registry = registry
        self._sensor_battery = sensor_battery
        self._battery_status = battery_status
        self._seen_version = registry.version
        self._seen_count = 0
        self._charge = ChargeEstimator(registry.read(BatteryParams).pack)

    def update(self) -> None:
        """Add the newest sample, if there is a new one."""
        if self._sensor_battery.count == self._seen_count:
            return
        self._seen_count = self._sensor_battery.count
        if self._seen_version != self._registry.version:
            self._seen_version = self._registry.version
            self._charge.pack = self._registry.read(BatteryParams).pack
        sample = self._sensor_battery.value
        if sample is None or not math.isfinite(sample.voltage_v):
            return  # A monitor without a voltage has not measured: its age shows it
        charge = self._charge
        charge.update(sample.time_us, sample.voltage_v, sample.current_a)
        self._battery_status.publish(
            BatteryStatus(
                sample.time_us,
                sample.voltage_v,
                sample.current_a,
                charge.consumed_ah,
                charge.pack.capacity_ah,
                charge.remaining,
            )
        )
