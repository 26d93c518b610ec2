"""Reads rotor telemetry, commands and attitude, publishes what has failed."""

import math
from typing import Final

from uav_firmware.bus import Queue, Topic
from uav_firmware.lib.rotation import to_euler
from uav_firmware.modules.failure_detector.attitude_watch import AxisWatch
from uav_firmware.modules.failure_detector.motor_watch import MotorLimits, MotorWatch
from uav_firmware.modules.failure_detector.params import FailureDetectorParams
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.estimate import VehicleAttitude
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.sensors import SensorEsc
from uav_firmware.msg.status import StatusText, VehicleStatus
from uav_firmware.parameters import Registry

_REPEAT_US: Final = 1_000_000
_ATTITUDE_US: Final = 20_000  # 50 Hz: an attitude counts as lost after tenths of a second
_LONGEST_STEP_S: Final = 0.1
_CRITICAL: Final = 2  # MAV_SEVERITY


class FailureDetectorModule:
    """Shell of the two watches; declares `FailureDetectorParams`."""

    def __init__(
        self,
        registry: Registry,
        *,
        motors: Topic[ActuatorMotors],
        esc: Topic[SensorEsc],
        attitude: Topic[VehicleAttitude],
        vehicle_status: Topic[VehicleStatus],
        failure_status: Topic[FailureDetectorStatus],
        status_text: Queue[StatusText],
    ) -> None:
        registry.add(FailureDetectorParams)
        self._registry = registry
        self._motors = motors
        self._esc = esc
        self._attitude = attitude
        self._vehicle_status = vehicle_status
        self._failure_status = failure_status
        self._status_text = status_text
        self._seen_version = registry.version
        self._params = registry.read(FailureDetectorParams)
        self._watch = MotorWatch(_limits(self._params))
        self._roll, self._pitch = AxisWatch(), AxisWatch()
        self._esc_count = 0
        self._esc_us = 0
        self._attitude_us = 0

    def update(self, now_us: int) -> None:
        """Look once; publish on change and once a second."""
        if self._seen_version != self._registry.version:
            self._seen_version = self._registry.version
            self._params = self._registry.read(FailureDetectorParams)
            self._watch.limits = _limits(self._params)
        status = self._vehicle_status.value
        if status is not None and status.armed:
            self._watch_motors()
        else:
            self._watch.reset()
        elapsed_us = now_us - self._attitude_us
        if elapsed_us >= _ATTITUDE_US:
            self._attitude_us = now_us
            self._watch_attitude(min(elapsed_us * 1e-6, _LONGEST_STEP_S))
        self._publish(now_us)

    def _watch_motors(self) -> None:
        if self._esc.count == self._esc_count or not self._params.motors_enabled:
            return
        self._esc_count = self._esc.count
        esc, motors = self._esc.value, self._motors.value
        if esc is None or motors is None:
            return
        dt = min((esc.time_us - self._esc_us) * 1e-6, _LONGEST_STEP_S)
        self._esc_us = esc.time_us
        if dt > 0.0:
            self._watch.update(motors.control, esc.rotor_rpm, dt)

    def _watch_attitude(self, dt: float) -> None:
        attitude = self._attitude.value
        if attitude is None:
            return
        params = self._params
        roll, pitch, _ = to_euler(attitude.q_ned_frd)
        self._roll.update(roll, math.radians(params.roll_deg), params.roll_time_s, dt)
        self._pitch.update(pitch, math.radians(params.pitch_deg), params.pitch_time_s, dt)

    def _publish(self, now_us: int) -> None:
        former = self._failure_status.value
        watch = self._watch
        seen = (self._roll.exceeded, self._pitch.exceeded, watch.failed, watch.weak)
        if former is not None and seen == former[1:] and now_us - former.time_us < _REPEAT_US:
            return
        self._failure_status.publish(FailureDetectorStatus(now_us, *seen))
        self._tell(now_us, former)

    def _tell(self, now_us: int, former: FailureDetectorStatus | None) -> None:
        """Say what is new."""
        known = 0 if former is None else former.failed_motors
        for motor in range(4):
            if (self._watch.failed & ~known) >> motor & 1:
                self._say(now_us, f"Motor {motor + 1} failed")
        if self._watch.weak and not (former is not None and former.propulsion_weak):
            self._say(now_us, "Propulsion weak")
        was_lost = former is not None and (former.roll_exceeded or former.pitch_exceeded)
        if (self._roll.exceeded or self._pitch.exceeded) and not was_lost:
            self._say(now_us, "Attitude beyond limits")

    def _say(self, now_us: int, text: str) -> None:
        self._status_text.publish(StatusText(now_us, _CRITICAL, text))


def _limits(params: FailureDetectorParams) -> MotorLimits:
    return MotorLimits(
        full_speed_rpm=params.full_speed_rpm,
        least_command=params.least_command,
        least_share=params.least_share,
        time_s=params.time_ms * 1e-3,
        weak_share=params.weak_share,
    )
