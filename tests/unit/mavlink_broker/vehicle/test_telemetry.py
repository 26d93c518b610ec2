"""Messages to reports: directions and units first."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.vehicle.telemetry import Snapshot, battery, pose, state_vector

NUMBERS: dict[str, Any] = {"vehicle_id": 1, "sequence_number": 0}


def position(**changed: int) -> Any:
    fields = {
        "time_boot_ms": 1,
        "lat": 404434000,
        "lon": -37382000,
        "alt": 655_000,
        "relative_alt": 4840,
        "vx": 0,
        "vy": 0,
        "vz": 0,
        "hdg": 65535,
    }
    return mavlink.MAVLink_global_position_int_message(**(fields | changed))


def attitude(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Any:
    return mavlink.MAVLink_attitude_message(1, roll, pitch, yaw, 0, 0, 0)


def battery_status(remaining: int, number: int = 0) -> Any:
    return mavlink.MAVLink_battery_status_message(number, 0, 0, 0, [0] * 10, 0, 0, 0, remaining)


def seen(*messages: Any) -> Snapshot:
    snapshot = Snapshot(battery_capacity_ah=5.2)
    for message in messages:
        snapshot.take(message)
    return snapshot


def test_yaw_is_clockwise_from_north_and_never_negative() -> None:
    west = pose(seen(position(), attitude(yaw=-math.pi / 2)), **NUMBERS)
    east = pose(seen(position(), attitude(yaw=math.pi / 2)), **NUMBERS)
    assert west is not None
    assert east is not None
    assert west.yaw == pytest.approx(270.0)
    assert east.yaw == pytest.approx(90.0)


def test_altitude_is_above_home_and_not_above_the_sea() -> None:
    report = pose(seen(position(), attitude()), **NUMBERS)
    assert report is not None
    assert report.altitude == pytest.approx(4.84)


def test_speed_counts_the_climb_too() -> None:
    vector = state_vector(seen(position(vx=300, vy=400, vz=-1200), attitude()), **NUMBERS)
    assert vector is not None
    assert vector.linear_speed == pytest.approx(13.0)


def test_what_is_unknown_is_absent() -> None:
    assert pose(seen(position()), **NUMBERS) is None
    assert pose(seen(attitude()), **NUMBERS) is None
    vector = state_vector(seen(position(), attitude(), battery_status(-1)), **NUMBERS)
    assert vector is not None
    assert vector.battery_percentage is None
    assert battery(seen(battery_status(-1)), **NUMBERS) is None


def test_battery_percentage_is_a_fraction() -> None:
    report = battery(seen(battery_status(80)), **NUMBERS)
    assert report is not None
    assert report.percentage == pytest.approx(0.8)
    assert report.capacity == 5.2


@pytest.mark.parametrize(("sent_s", "known_s"), [(600, 600.0), (0, None), (-5, None)])
def test_the_battery_time_is_the_estimate_of_the_vehicle(
    sent_s: int, known_s: float | None
) -> None:
    status = battery_status(80)
    status.time_remaining = sent_s
    assert seen(status).battery_time_s == known_s


@pytest.mark.parametrize(
    ("fix_type", "satellites", "known"),
    [
        (3, 14, ("3d", 14)),
        (6, 30, ("rtk_fixed", 30)),
        (1, 255, ("none", None)),
        (99, 0, ("unknown", 0)),
    ],
)
def test_the_quality_of_the_gps_is_named(
    fix_type: int, satellites: int, known: tuple[str, int | None]
) -> None:
    message = mavlink.MAVLink_gps_raw_int_message(
        0, fix_type, 0, 0, 0, 65535, 65535, 0, 0, satellites
    )
    assert seen(message).gps == known


def test_only_the_first_battery_counts() -> None:
    assert seen(battery_status(80), battery_status(10, number=1)).battery_fraction == 0.8


@given(
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
    st.floats(width=32),
    st.floats(width=32),
    st.floats(width=32),
    st.integers(-128, 127),
)
def test_whatever_a_vehicle_sends_the_reports_are_valid_or_absent(
    lat: int, lon: int, roll: float, pitch: float, yaw: float, remaining: int
) -> None:
    snapshot = seen(
        position(lat=lat, lon=lon), attitude(roll, pitch, yaw), battery_status(remaining)
    )
    vector = state_vector(snapshot, **NUMBERS)
    battery(snapshot, **NUMBERS)
    if vector is not None:
        assert 0.0 <= vector.yaw < 360.0
        assert -180.0 <= vector.roll < 180.0


def test_a_position_before_the_first_fix_is_dropped() -> None:
    assert seen(position(lat=0, lon=0)).position is None


def system_status(present: int, health: int) -> Any:
    return mavlink.MAVLink_sys_status_message(
        present, present, health, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
    )


def test_readiness_is_known_only_where_the_vehicle_reports_it() -> None:
    prearm = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert seen(system_status(0, 0)).ready_to_arm is None
    assert seen(system_status(prearm, 0)).ready_to_arm is False
    assert seen(system_status(prearm, prearm)).ready_to_arm is True


def test_a_restarted_vehicle_keeps_its_battery_capacity_only() -> None:
    snapshot = seen(position(), attitude(), battery_status(50))
    snapshot.forget()
    assert snapshot == Snapshot(battery_capacity_ah=5.2)


def test_on_the_ground_means_disarmed_too() -> None:
    def heartbeat(base_mode: int) -> Any:
        return mavlink.MAVLink_heartbeat_message(2, 12, base_mode, 0, 4, 3)

    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    on_ground = mavlink.MAVLink_extended_sys_state_message(0, 1)
    in_air = mavlink.MAVLink_extended_sys_state_message(0, 2)
    assert not seen(on_ground).is_on_ground
    assert seen(on_ground, heartbeat(0)).is_on_ground
    assert not seen(on_ground, heartbeat(armed)).is_on_ground
    assert not seen(in_air, heartbeat(0)).is_on_ground
