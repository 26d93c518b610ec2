"""Streamed setpoints: frames, masks and refusals."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.cases import failures
from tests.unit.uav_firmware.modules.mavlink.harness import BROKER, LOCAL, SYSTEM, MavlinkHarness
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.control_mode import OffboardSetpoint
from uav_firmware.msg.setpoints import (
    TrajectorySetpoint,
    VehicleAttitudeSetpoint,
    VehicleRatesSetpoint,
)

POSITION, VELOCITY, ACCELERATION, YAW, YAW_RATE = 0b111, 0b111 << 3, 0b111 << 6, 1 << 10, 1 << 11
ALL = POSITION | VELOCITY | ACCELERATION | YAW | YAW_RATE
NAN = math.nan


def local(unmasked: int = POSITION, **fields: Any) -> Any:
    """A local setpoint in which only the quantities named by their bits are set."""
    numbers = dict.fromkeys(
        ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0
    )
    values: dict[str, Any] = {
        "time_boot_ms": 0,
        "target_system": SYSTEM,
        "target_component": 1,
        "coordinate_frame": 1,
        "type_mask": ALL & ~unmasked,
        **numbers,
    }
    return mavlink.MAVLink_set_position_target_local_ned_message(**{**values, **fields})


def worldwide(unmasked: int = POSITION, **fields: Any) -> Any:
    numbers = dict.fromkeys(("vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0)
    values: dict[str, Any] = {
        "time_boot_ms": 0,
        "target_system": SYSTEM,
        "target_component": 1,
        "coordinate_frame": 6,
        "type_mask": ALL & ~unmasked,
        "lat_int": 404_434_000,
        "lon_int": -37_382_000,
        "alt": 10.0,
        **numbers,
    }
    return mavlink.MAVLink_set_position_target_global_int_message(**{**values, **fields})


def attitude(mask: int = 0b111, **fields: Any) -> Any:
    values: dict[str, Any] = {
        "time_boot_ms": 0,
        "target_system": SYSTEM,
        "target_component": 1,
        "type_mask": mask,
        "q": [1.0, 0.0, 0.0, 0.0],
        "body_roll_rate": 0.0,
        "body_pitch_rate": 0.0,
        "body_yaw_rate": 0.0,
        "thrust": 0.3,
    }
    return mavlink.MAVLink_set_attitude_target_message(**{**values, **fields})


def setpoint_and_texts(message: Any) -> tuple[OffboardSetpoint | None, list[str]]:
    harness = MavlinkHarness()
    harness.send(message)
    harness.run()
    return harness.topics.offboard_setpoint.value, texts(harness)


def texts(harness: MavlinkHarness) -> list[str]:
    return [m.text for m in harness.received("STATUSTEXT")]


def motion(message: Any) -> TrajectorySetpoint:
    setpoint, _ = setpoint_and_texts(message)
    assert isinstance(setpoint, TrajectorySetpoint)
    return setpoint


def test_position_alone_sets_position_only() -> None:
    setpoint = motion(local(x=1.0, y=-2.0, z=-3.0))
    assert setpoint.position_ned == (1.0, -2.0, -3.0)
    assert all(map(math.isnan, (*setpoint.velocity_ned, *setpoint.acceleration_ned)))
    assert math.isnan(setpoint.yaw)
    assert math.isnan(setpoint.yaw_rate)
    assert setpoint.time_us > 0


def test_velocity_with_height_and_yaw_rate() -> None:
    mask = 0b11 << 3 | 0b100 | YAW_RATE
    setpoint = motion(local(mask, vx=1.0, vy=2.0, z=-5.0, yaw_rate=0.5))
    assert setpoint.velocity_ned[:2] == (1.0, 2.0)
    assert setpoint.position_ned[2] == -5.0
    assert math.isnan(setpoint.position_ned[0])
    assert math.isnan(setpoint.velocity_ned[2])
    assert setpoint.yaw_rate == 0.5


def test_forward_follows_the_heading() -> None:
    setpoint = motion(local(VELOCITY, coordinate_frame=8, vx=2.0, vz=-1.0))
    heading = LOCAL.heading
    assert setpoint.velocity_ned == pytest.approx(
        (2.0 * math.cos(heading), 2.0 * math.sin(heading), -1.0)
    )


@pytest.mark.parametrize(("frame", "altitude"), [(6, 10.0), (3, 10.0), (5, 660.0), (0, 660.0)])
def test_a_global_position_becomes_local(frame: int, altitude: float) -> None:
    setpoint = motion(worldwide(coordinate_frame=frame, alt=altitude, lat_int=404_443_000))
    north, east, down = setpoint.position_ned
    assert north == pytest.approx(100.0, abs=0.5)
    assert east == pytest.approx(0.0, abs=0.1)
    assert down == pytest.approx(-10.0, abs=0.01)


def test_attitude_with_thrust_and_yaw_rate() -> None:
    setpoint, _ = setpoint_and_texts(attitude(0b011, q=[0.0, 0.0, 0.0, 1.0], body_yaw_rate=0.4))
    assert isinstance(setpoint, VehicleAttitudeSetpoint)
    assert setpoint.q_ned_frd == (0.0, 0.0, 0.0, 1.0)
    assert (setpoint.yaw_rate, setpoint.thrust) == pytest.approx((0.4, 0.3))


def test_body_rates_with_thrust() -> None:
    setpoint, _ = setpoint_and_texts(
        attitude(128, body_roll_rate=0.1, body_pitch_rate=-0.2, body_yaw_rate=0.3)
    )
    assert isinstance(setpoint, VehicleRatesSetpoint)
    assert setpoint.rate_frd == pytest.approx((0.1, -0.2, 0.3))


REFUSED = [
    (local(0b001), "half of a horizontal position"),
    (local(0b011), "sets nothing vertical"),
    (local(0b100), "sets nothing horizontal"),
    (local(0), "sets nothing horizontal"),
    (local(x=NAN, y=NAN, z=NAN), "sets nothing horizontal"),
    (local(type_mask=1 << 9), "force"),
    (local(x=math.inf), "position inf"),
    (local(VELOCITY, vx=1e6), "velocity 1e+06"),
    (local(ACCELERATION, afz=-1e3), "acceleration -1000"),
    (local(POSITION | YAW_RATE, yaw_rate=math.inf), "yaw rate inf"),
    (local(coordinate_frame=8), "position in a body frame"),
    (local(coordinate_frame=7), "frame 7"),
    (worldwide(coordinate_frame=11), "frame 11"),
    (worldwide(lat_int=0, lon_int=0), "position"),
    (worldwide(lat_int=2_000_000_000), "out of range"),
    (attitude(64), "no collective thrust"),
    (attitude(thrust=1.5), "thrust is 1.5"),
    (attitude(thrust=NAN), "thrust is nan"),
    (attitude(q=[0.0, 0.0, 0.0, 0.0]), "unit length"),
    (attitude(q=[NAN, 0.0, 0.0, 0.0]), "unit length"),
    (attitude(128 | 2), "neither attitude nor all body rates"),
    (attitude(128, body_roll_rate=NAN), "neither attitude nor all body rates"),
    (attitude(128, body_roll_rate=1e4), "body rate"),
    (attitude(0, body_roll_rate=0.5), "beside an attitude"),
]


def check_refused(message: Any, reason: str) -> None:
    setpoint, received = setpoint_and_texts(message)
    assert setpoint is None
    assert reason in "".join(received)
    assert "ignored" in "".join(received)


def test_invalid_setpoints_are_ignored_with_a_status_text() -> None:
    assert failures(check_refused, REFUSED) == []


def test_a_refusal_is_reported_once_until_a_setpoint_is_accepted() -> None:
    harness = MavlinkHarness()
    reported = []
    for message in (local(0), local(0), local(0), local(), local(0)):
        harness.send(message)
        harness.run()
        reported.append(len(texts(harness)) > 0)
    assert reported == [True, False, False, False, True]


@pytest.mark.thorough
@given(
    st.integers(0, 0xFFFF),
    st.integers(0, 255),
    st.lists(st.floats(width=32), min_size=11, max_size=11),
)
def test_infinite_numbers_are_refused(mask: int, frame: int, numbers: list[float]) -> None:
    names = ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate")
    fields: dict[str, Any] = dict(zip(names, numbers, strict=True))
    setpoint, _ = setpoint_and_texts(local(type_mask=mask, coordinate_frame=frame, **fields))
    if setpoint is not None:
        assert isinstance(setpoint, TrajectorySetpoint)
        flat = (*setpoint.position_ned, *setpoint.velocity_ned, *setpoint.acceleration_ned)
        assert not any(map(math.isinf, (*flat, setpoint.yaw, setpoint.yaw_rate)))


def test_setpoints_for_another_vehicle_are_ignored() -> None:
    assert setpoint_and_texts(local(target_system=SYSTEM + 1)) == (None, [])
    assert setpoint_and_texts(local(target_system=0)) == (None, [])


@pytest.mark.parametrize("second_system", [254, 255], ids=["other ids", "same ids"])
def test_a_second_sender_is_accepted_after_a_timeout(second_system: int) -> None:
    harness = MavlinkHarness()
    harness.send(local(x=1.0), system=255)
    harness.send(local(x=2.0), system=second_system, source=BROKER)
    harness.run()
    first = harness.topics.offboard_setpoint.value
    assert isinstance(first, TrajectorySetpoint)
    assert first.position_ned[0] == 1.0
    harness.run(1_100_000)
    harness.send(local(x=2.0), system=second_system, source=BROKER)
    harness.run()
    second = harness.topics.offboard_setpoint.value
    assert isinstance(second, TrajectorySetpoint)
    assert second.position_ned[0] == 2.0
