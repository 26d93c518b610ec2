"""Reads rotors, commands, attitude, inertial sensor, barometer; publishes what has failed."""

import math
from typing import Final

from uav_firmware.bus import Queue, Topic
from uav_firmware.lib.atmosphere import altitude_from_pressure
from uav_firmware.lib.rotation import rotate, to_euler
from uav_firmware.modules.failure_detector.crash_detector import (
    CrashDetector,
    FallDetector,
    ImpactDetector,
    Moment,
)
from uav_firmware.modules.failure_detector.esc_telemetry import EscTelemetryCheck
from uav_firmware.modules.failure_detector.motor_monitor import MotorLimits, MotorMonitor
from uav_firmware.modules.failure_detector.params import FailureDetectorParams
from uav_firmware.msg.actuators import ActuatorMotors
from uav_firmware.msg.control_mode import ControlLevel, VehicleControlMode
from uav_firmware.msg.estimate import HoverThrustEstimate, VehicleAttitude
from uav_firmware.msg.failure import FailureDetectorStatus
from uav_firmware.msg.sensors import SensorBaro, SensorEsc, SensorImu, SensorsStatus
from uav_firmware.msg.setpoints import VehicleAttitudeSetpoint, VehicleTorqueThrustSetpoint
from uav_firmware.msg.status import LandDetected, Severity, StatusText, VehicleStatus
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

_REPEAT_US: Final = 1_000_000
_ATTITUDE_US: Final = 20_000  # 50 Hz: an attitude counts as lost after tenths of a second
_LONGEST_STEP_S: Final = 0.1
_ESC_SILENT_US: Final = 500_000
_SETPOINT_STALE_US: Final = 500_000
_BARO_SILENT_US: Final = 500_000
_THRUST_TIME_S: Final = 1.0  # A controller that is deceived pulls now and then
_CARRYING_TIME_S: Final = 20.0
_LIFT_TIME_S: Final = 0.05  # Of the mean lift; two rotors that stop halve it within that
_LIFT_M_S2: Final = 7.4  # [m/s^2] Three quarters of what carries a vehicle at rest
_TURNING_RAD_S: Final = 1.5  # [rad/s] Two rotors alone turn the vehicle faster within 0.1 s
_NAN: Final = math.nan
_DOWN: Final[Vector3] = (0.0, 0.0, 1.0)
_SILENT: Final[Vector3] = (_NAN, _NAN, _NAN)


class AxisMonitor:
    """Reports an angle beyond its limit for longer than a gust lasts."""

    __slots__ = ("_beyond_s", "exceeded")

    def __init__(self) -> None:
        self.exceeded = False
        self._beyond_s = 0.0

    def update(self, angle: float, limit: float, time_s: float, dt: float) -> bool:
        """Whether |angle| has been beyond `limit` for `time_s`; a limit of 0 is none."""
        if limit > 0.0 and abs(angle) > limit:
            self._beyond_s += dt
        else:
            self._beyond_s = 0.0
        self.exceeded = self._beyond_s >= time_s
        return self.exceeded


class FailureDetectorModule:
    """Shell of the detectors; declares `FailureDetectorParams`."""

    def __init__(
        self,
        registry: Registry,
        *,
        motors: Topic[ActuatorMotors],
        esc: Topic[SensorEsc],
        attitude: Topic[VehicleAttitude],
        vehicle_status: Topic[VehicleStatus],
        sensors_status: Topic[SensorsStatus],
        failure_status: Topic[FailureDetectorStatus],
        status_text: Queue[StatusText],
        imu: Topic[SensorImu],
        baro: Topic[SensorBaro],
        attitude_setpoint: Topic[VehicleAttitudeSetpoint],
        torque_thrust: Topic[VehicleTorqueThrustSetpoint],
        hover_thrust_estimate: Topic[HoverThrustEstimate],
        land_detected: Topic[LandDetected],
        vehicle_control_mode: Topic[VehicleControlMode],
    ) -> None:
        registry.add(FailureDetectorParams)
        self._registry = registry
        self._motors = motors
        self._esc = esc
        self._attitude = attitude
        self._imu = imu
        self._baro = baro
        self._attitude_setpoint = attitude_setpoint
        self._torque_thrust = torque_thrust
        self._hover_thrust = hover_thrust_estimate
        self._landed = land_detected
        self._control_mode = vehicle_control_mode
        self._vehicle_status = vehicle_status
        self._sensors_status = sensors_status
        self._failure_status = failure_status
        self._status_text = status_text
        self._seen_version = registry.version
        self._params = registry.read(FailureDetectorParams)
        self._motor_monitor = MotorMonitor(_limits(self._params))
        self._roll, self._pitch = AxisMonitor(), AxisMonitor()
        self._crash_detector, self._impact_detector = CrashDetector(), ImpactDetector()
        self._fall_detector = FallDetector()
        self._struck = False
        self._lift_m_s2 = 0.0  # [m/s^2] Smoothed
        self._thrust = self._carrying_thrust = math.nan
        self._crash = ""
        self._cleared_us = 0
        self._imu_count = 0
        self._esc_received_us: int | None = None
        self._esc_seen = 0
        self._esc_count = 0
        self._esc_us = 0
        self._esc_check = EscTelemetryCheck()
        self._attitude_us = 0
        self._blow_us = 0

    def update(self, now_us: int) -> None:
        """Look once; publish on change and once a second."""
        if self._seen_version != self._registry.version:
            self._seen_version = self._registry.version
            self._params = self._registry.read(FailureDetectorParams)
            self._motor_monitor.limits = _limits(self._params)
        status = self._vehicle_status.value
        armed = status is not None and status.armed
        if status is not None and status.failures_cleared_us > self._cleared_us:
            self._cleared_us = status.failures_cleared_us
            self._motor_monitor.forgive()
            self._crash = ""
        if self._esc.count != self._esc_seen and _is_complete(self._esc.value):
            self._esc_seen, self._esc_received_us = self._esc.count, now_us
        if armed:
            self._detect_impacts(now_us)
            self._monitor_motors()
            self._check_telemetry(now_us)
        else:
            self._motor_monitor.rest()
            self._esc_check.rest()
        elapsed_us = now_us - self._attitude_us
        if elapsed_us >= _ATTITUDE_US:
            self._attitude_us = now_us
            dt = min(elapsed_us * 1e-6, _LONGEST_STEP_S)
            self._monitor_attitude(dt)
            if armed and self._params.crash_enabled:
                self._crash = self._detect_crash(now_us, dt) or self._crash
            else:
                self._crash_detector.reset()
            if self._detect_fall(dt, armed=armed) and not self._crash:
                self._crash = "fell with its motors stopped"
                self._publish_text(now_us, f"Crash: {self._crash}")
        self._publish(now_us)

    def _monitor_motors(self) -> None:
        if self._esc.count == self._esc_count or not self._params.motors_enabled:
            return
        self._esc_count = self._esc.count
        esc, motors = self._esc.value, self._motors.value
        sensors = self._sensors_status.value
        if esc is None or motors is None or (sensors is not None and sensors.gyro_lost):
            return  # Without a gyroscope the motors are driven, and the rotors hit, by chance
        dt = min((esc.time_us - self._esc_us) * 1e-6, _LONGEST_STEP_S)
        self._esc_us = esc.time_us
        monitor = self._motor_monitor
        if dt > 0.0:
            monitor.update(
                motors.control,
                esc.rotor_rpm,
                dt,
                struck=self._struck,
                is_carried=self._is_carried,
            )
        if (monitor.failed | monitor.blocked).bit_count() > 1 and monitor.blocked:
            self._crash = self._crash or "has hit something, rotors stand"

    def _check_telemetry(self, now_us: int) -> None:
        """Say once that a failed motor would not be seen."""
        motors, check = self._motors.value, self._esc_check
        if motors is None or not self._params.motors_enabled:
            return
        silent = self._is_esc_silent(now_us)
        if check.update(self._esc.value, motors.control, now_us, silent=silent):
            text = f"ESC telemetry {check.fault}: a motor that fails is not recognised"
            self._publish_text(now_us, text, Severity.WARNING)

    def _is_esc_silent(self, now_us: int) -> bool:
        received_us = self._esc_received_us
        return received_us is None or now_us - received_us > _ESC_SILENT_US

    def _detect_impacts(self, now_us: int) -> None:
        imu, dt = self._imu.value, (now_us - self._blow_us) * 1e-6
        self._blow_us = now_us
        self._struck = False
        if imu is None:
            return
        dt = min(dt, _LONGEST_STEP_S)
        lift = -imu.specific_force_frd[2]
        if math.isfinite(lift):
            self._lift_m_s2 += dt / (dt + _LIFT_TIME_S) * (lift - self._lift_m_s2)
        if self._params.crash_enabled:
            self._struck = self._impact_detector.update(imu.rate_frd, imu.specific_force_frd, dt)

    @property
    def _is_carried(self) -> bool:
        """Whether the vehicle flies, with the lift of all its rotors and without a rotation.

        Behind a blow it may be the ground that carries it.
        """
        attitude, landed = self._attitude.value, self._landed.value
        if self._struck or attitude is None or landed is None or landed.landed:
            return False
        turns = max(map(abs, attitude.rate_frd)) > _TURNING_RAD_S
        return self._lift_m_s2 > _LIFT_M_S2 and not turns

    @property
    def _leads_attitude(self) -> bool:
        """Whether an attitude is commanded, which it is not in acro."""
        control = self._control_mode.value
        return control is None or control.level is not ControlLevel.RATES

    def _detect_crash(self, now_us: int, dt: float) -> str:
        imu, silent = self._imu.value, self._imu.count == self._imu_count
        self._imu_count = self._imu.count
        if imu is None:
            return ""
        seen = Moment(
            _SILENT if silent else imu.rate_frd,
            _SILENT if silent else imu.specific_force_frd,
            self._thrust_axis_error(now_us),
            self._motor_monitor.failed.bit_count(),
            self._thrust_share(dt),
            self._height_m(now_us),
        )
        return self._crash_detector.update(seen, dt)

    def _detect_fall(self, dt: float, *, armed: bool) -> bool:
        imu, landed = self._imu.value, self._landed.value
        if armed or not self._params.crash_enabled:
            self._fall_detector.note_armed(
                in_air=armed and landed is not None and not landed.landed
            )
            return False
        return imu is not None and self._fall_detector.update(imu.specific_force_frd, dt)

    def _thrust_share(self, dt: float) -> float:
        """Thrust over what carries the vehicle; NaN where nothing has shown that in this flight.

        What carries is the less of two: the hover thrust that the controller has learnt, which
        follows the estimate, and the mean of what was commanded in flight, which follows nothing.
        """
        commanded, learnt, landed = (
            self._torque_thrust.value, self._hover_thrust.value, self._landed.value
        )  # fmt: skip
        if commanded is None or learnt is None or landed is None or landed.landed:
            self._thrust = self._carrying_thrust = _NAN
            return _NAN
        thrust, mean = self._thrust, self._carrying_thrust
        if math.isnan(mean):
            thrust = mean = commanded.thrust
        self._thrust = thrust = thrust + dt / (dt + _THRUST_TIME_S) * (commanded.thrust - thrust)
        self._carrying_thrust = mean = mean + dt / (dt + _CARRYING_TIME_S) * (thrust - mean)
        carrying = min(mean, learnt.hover_thrust)
        known = learnt.valid and carrying > 0.0 and not self._motor_monitor.failed
        return thrust / carrying if known else _NAN

    def _height_m(self, now_us: int) -> float:
        baro = self._baro.value
        if baro is None or now_us - baro.time_us > _BARO_SILENT_US or not baro.pressure_pa > 0.0:
            return _NAN
        return altitude_from_pressure(baro.pressure_pa)

    def _thrust_axis_error(self, now_us: int) -> float:
        """Angle [rad] between the thrust axis and where it shall point; NaN without an order."""
        attitude, setpoint = self._attitude.value, self._attitude_setpoint.value
        if attitude is None or setpoint is None or not self._leads_attitude:
            return _NAN
        if now_us - setpoint.time_us > _SETPOINT_STALE_US:
            return _NAN
        axis, wanted = rotate(attitude.q_ned_frd, _DOWN), rotate(setpoint.q_ned_frd, _DOWN)
        cosine = axis[0] * wanted[0] + axis[1] * wanted[1] + axis[2] * wanted[2]
        return math.acos(min(max(cosine, -1.0), 1.0))

    def _monitor_attitude(self, dt: float) -> None:
        """Judge roll and pitch where an attitude is led, as PX4 does: acro may roll over."""
        attitude = self._attitude.value
        if attitude is None:
            return
        params = self._params
        led = self._leads_attitude
        roll, pitch, _ = to_euler(attitude.q_ned_frd) if led else (0.0, 0.0, 0.0)
        self._roll.update(roll, math.radians(params.roll_deg), params.roll_time_s, dt)
        self._pitch.update(pitch, math.radians(params.pitch_deg), params.pitch_time_s, dt)

    def _publish(self, now_us: int) -> None:
        former = self._failure_status.value
        monitor = self._motor_monitor
        seen = (
            self._roll.exceeded,
            self._pitch.exceeded,
            monitor.failed,
            monitor.weak,
            self._crash,
            self._is_esc_silent(now_us),
        )
        if former is not None and seen == former[1:] and now_us - former.time_us < _REPEAT_US:
            return
        self._failure_status.publish(FailureDetectorStatus(now_us, *seen))
        self._report_changes(now_us, former)

    def _report_changes(self, now_us: int, former: FailureDetectorStatus | None) -> None:
        """Say what is new."""
        known = 0 if former is None else former.failed_motors
        for motor in range(4):
            if (self._motor_monitor.failed & ~known) >> motor & 1:
                self._publish_text(now_us, f"Motor {motor + 1} failed")
        if self._motor_monitor.weak and not (former is not None and former.propulsion_weak):
            self._publish_text(now_us, "Propulsion weak")
        was_lost = former is not None and (former.roll_exceeded or former.pitch_exceeded)
        if (self._roll.exceeded or self._pitch.exceeded) and not was_lost:
            self._publish_text(now_us, "Attitude beyond limits")

    def _publish_text(self, now_us: int, text: str, severity: Severity = Severity.CRITICAL) -> None:
        self._status_text.publish(StatusText(now_us, severity, text))


def _is_complete(esc: SensorEsc | None) -> bool:
    """Whether each speed controller reports a speed."""
    if esc is None:
        return False
    one, two, three, four = esc.rotor_rpm
    return math.isfinite(one + two + three + four)


def _limits(params: FailureDetectorParams) -> MotorLimits:
    return MotorLimits(
        full_speed_rpm=params.full_speed_rpm,
        least_command=params.least_command,
        least_share=params.least_share,
        time_s=params.time_ms * 1e-3,
        weak_share=params.weak_share,
    )
