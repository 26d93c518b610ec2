"""Messages of the gimbal manager."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import (
    GIMBAL,
    SYSTEM,
    MavlinkHarness,
    command_long,
)
from uav_firmware.lib.rotation import from_euler, multiply, to_euler
from uav_firmware.modules.mavlink.telemetry.context import BatteryThresholds, Context
from uav_firmware.modules.mavlink.telemetry.gimbal import gimbal_device_attitude_status
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.payload import Controller, GimbalFlags, GimbalOrder, PayloadCommand
from uav_firmware.msg.status import VehicleCommand
from uav_firmware.msg.vectors import Quaternion

NAN = math.nan
BOTH = GimbalFlags.YAW_IN_VEHICLE_FRAME | GimbalFlags.YAW_IN_EARTH_FRAME


def attitude(**changes: Any) -> Any:
    harness = MavlinkHarness()
    harness.topics.gimbal_status.publish(GIMBAL._replace(**changes))
    context = Context(harness.topics, 0, 0, SYSTEM, BatteryThresholds(0, 0, 0), (0.0, 0.0, 0.0))
    return gimbal_device_attitude_status(context)


@given(st.floats(-1.5, 0.5), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), st.booleans())
def test_both_frames_of_yaw_give_the_same_direction(
    pitch: float, yaw: float, heading: float, locked: bool
) -> None:
    reported = attitude(pitch=pitch, yaw=yaw, heading=heading, yaw_locked=locked)
    w, x, y, z = reported.q
    q: Quaternion = (w, x, y, z)
    if reported.flags & GimbalFlags.YAW_IN_VEHICLE_FRAME:
        assert not locked
        q = multiply(from_euler(0.0, 0.0, reported.delta_yaw), q)
    else:
        assert reported.flags & GimbalFlags.YAW_IN_EARTH_FRAME
        assert reported.flags & GimbalFlags.YAW_LOCK
    roll, seen_pitch, seen_yaw = to_euler(q)
    assert roll == pytest.approx(0.0, abs=1e-6)
    assert seen_pitch == pytest.approx(pitch, abs=1e-6)
    assert math.cos(seen_yaw - yaw) == pytest.approx(1.0)


def test_roll_and_pitch_are_held_against_the_horizon_and_the_device_is_the_first() -> None:
    reported = attitude()
    assert reported.flags & GimbalFlags.ROLL_LOCK
    assert reported.flags & GimbalFlags.PITCH_LOCK
    assert reported.gimbal_device_id == 1
    assert reported.angular_velocity_y == pytest.approx(0.1)
    assert reported.angular_velocity_z > 0.0


def test_the_gimbal_manager_reports_range_and_controllers() -> None:
    harness = MavlinkHarness()
    (ack,) = harness.request(command_long(512, 280), "COMMAND_ACK")
    assert ack.result == 0
    (information,) = harness.request(command_long(512, 280), "GIMBAL_MANAGER_INFORMATION")
    assert math.degrees(information.pitch_min) == pytest.approx(-90.0)
    assert math.degrees(information.pitch_max) == pytest.approx(30.0)
    assert information.gimbal_device_id == 1
    harness.topics.gimbal_status.publish(GIMBAL._replace(primary=Controller(9, 8)))
    harness.run()
    status = harness.received("GIMBAL_MANAGER_STATUS")[-1]
    assert (status.primary_control_sysid, status.primary_control_compid) == (9, 8)


def test_the_gimbal_attitude_is_streamed_by_default() -> None:
    harness = MavlinkHarness()
    harness.run(4_000_000)
    assert len(harness.received("GIMBAL_DEVICE_ATTITUDE_STATUS")) == pytest.approx(20, abs=1)


def test_a_gimbal_command_is_forwarded_with_its_sender() -> None:
    harness = MavlinkHarness()
    harness.send(
        command_long(int(PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW), -30.0, 10.0, NAN, NAN)
    )
    harness.run()
    (order,) = harness.topics.payload_order.drain()
    assert isinstance(order, VehicleCommand)
    assert (order.command, order.param1) == (PayloadCommand.DO_GIMBAL_MANAGER_PITCHYAW, -30.0)
    assert harness.commands() == []


def pitch_yaw(*values: float, flags: int = 0, device: int = 0, target: int = SYSTEM) -> Any:
    return mavlink.MAVLink_gimbal_manager_set_pitchyaw_message(target, 1, flags, device, *values)


def streamed(message: Any) -> list[Any]:
    harness = MavlinkHarness()
    harness.send(message)
    harness.run()
    return harness.topics.payload_order.drain()


def test_streamed_angles_are_published_to_payload() -> None:
    (order,) = streamed(pitch_yaw(-0.5, 0.25, NAN, NAN, flags=16))
    assert isinstance(order, GimbalOrder)
    assert (order.pitch, order.yaw, order.flags) == (-0.5, 0.25, 16)
    assert order.source == Controller(255, 190)
    assert not order.normalised


def test_a_streamed_quaternion_gives_pitch_and_yaw() -> None:
    q = list(from_euler(0.0, -0.5, 0.75))
    message = mavlink.MAVLink_gimbal_manager_set_attitude_message(SYSTEM, 1, 0, 1, q, 0, 0.1, 0.2)
    (order,) = streamed(message)
    assert (order.pitch, order.yaw) == pytest.approx((-0.5, 0.75), abs=1e-6)
    assert (order.pitch_rate, order.yaw_rate) == pytest.approx((0.1, 0.2))


def test_manual_gimbal_control_is_normalised() -> None:
    message = mavlink.MAVLink_gimbal_manager_set_manual_control_message(
        SYSTEM, 1, 0, 0, NAN, NAN, -1.0, 0.5
    )
    (order,) = streamed(message)
    assert order.normalised
    assert order.pitch_rate == -1.0


@pytest.mark.parametrize(
    "message",
    [
        pitch_yaw(0.0, 0.0, 0.0, 0.0, target=SYSTEM + 1),
        pitch_yaw(0.0, 0.0, 0.0, 0.0, device=3),
        pitch_yaw(0.0, 0.0, 0.0, 0.0, flags=BOTH),
        pitch_yaw(0.0, 0.0, 0.0, 0.0, flags=GimbalFlags.RETRACT),
        pitch_yaw(math.inf, 0.0, 0.0, 0.0),
        pitch_yaw(0.0, 1e30, 0.0, 0.0),
        mavlink.MAVLink_gimbal_manager_set_attitude_message(SYSTEM, 1, 0, 1, [0.0] * 4, 0, 0, 0),
        mavlink.MAVLink_gimbal_manager_set_manual_control_message(SYSTEM, 1, 0, 0, 2, 0, 0, 0),
    ],
)
def test_an_invalid_gimbal_order_is_dropped(message: Any) -> None:
    assert streamed(message) == []
