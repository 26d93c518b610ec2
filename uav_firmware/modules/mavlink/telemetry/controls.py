"""Builders of messages about sticks and motor commands."""

from typing import Final

from uav_firmware.modules.mavlink.telemetry.context import (
    UINT8_MAX,
    UINT16_MAX,
    UINT32_MAX,
    Context,
    boot_ms,
    saturated,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink

STICKS_TIMEOUT_US: Final = 1_000_000
_CENTRE_US: Final = 1500
_REACH_US: Final = 500
_CHANNELS: Final = 18
_PWM_MIN: Final = 1000
_PWM_SPAN: Final = 1000
_OUTPUTS: Final = 32


def rc_channels(context: Context) -> Message:
    """RC_CHANNELS: the sticks as pulse widths in PX4's order roll, pitch, throttle, yaw.

    Without recent sticks the channel count is 0. There is no radio, so no signal strength.
    """
    sticks = context.topics.manual_control_setpoint.value
    pulses: list[int] = []
    if sticks is not None and context.now_us - sticks.time_us <= STICKS_TIMEOUT_US:
        deflections = (sticks.right, sticks.forward, sticks.up, sticks.yaw)
        pulses = [_CENTRE_US + round(_REACH_US * deflection) for deflection in deflections]
    channels = [*pulses, *[UINT16_MAX] * (_CHANNELS - len(pulses))]
    return mavlink.MAVLink_rc_channels_message(
        boot_ms(context.now_us), len(pulses), *channels, UINT8_MAX
    )


def servo_output_raw(context: Context) -> Message | None:
    """SERVO_OUTPUT_RAW: motor commands as equivalent pulse widths [us]."""
    motors = context.topics.actuator_motors.value
    if motors is None:
        return None
    pulses = [
        saturated(_PWM_MIN + _PWM_SPAN * control, _PWM_MIN, _PWM_MIN + _PWM_SPAN, _PWM_MIN)
        for control in motors.control
    ]
    return mavlink.MAVLink_servo_output_raw_message(
        time_usec=motors.time_us & UINT32_MAX,
        port=0,
        servo1_raw=pulses[0],
        servo2_raw=pulses[1],
        servo3_raw=pulses[2],
        servo4_raw=pulses[3],
        servo5_raw=0,
        servo6_raw=0,
        servo7_raw=0,
        servo8_raw=0,
    )


def actuator_output_status(context: Context) -> Message | None:
    """ACTUATOR_OUTPUT_STATUS: the motor commands, 0 to 1, of the outputs in use."""
    motors = context.topics.actuator_motors.value
    if motors is None:
        return None
    unused = [0.0] * (_OUTPUTS - len(motors.control))
    return mavlink.MAVLink_actuator_output_status_message(
        time_usec=motors.time_us, active=len(motors.control), actuator=[*motors.control, *unused]
    )
