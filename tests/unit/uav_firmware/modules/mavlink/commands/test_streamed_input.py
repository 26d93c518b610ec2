"""MANUAL_CONTROL, FOLLOW_TARGET: direction, range, sender."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    GROUND,
    SYSTEM,
    MavlinkHarness,
)
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.msg.control_mode import ManualControlSetpoint

AXIS = st.integers(-0x8000, 0x7FFF)


def send(
    harness: MavlinkHarness,
    x: int,
    y: int,
    z: int,
    r: int,
    target: int = SYSTEM,
    system: int = 255,
    source: Address = GROUND,
) -> None:
    harness.send(
        mavlink.MAVLink_manual_control_message(target=target, x=x, y=y, z=z, r=r, buttons=0),
        system=system,
        source=source,
    )
    harness.run()


def sticks(harness: MavlinkHarness) -> ManualControlSetpoint | None:
    return harness.topics.manual_control_setpoint.value


@pytest.mark.parametrize(
    ("axes", "wanted"),
    [
        ((1000, 0, 500, 0), (1.0, 0.0, 0.0, 0.0)),
        ((0, 1000, 500, 0), (0.0, 1.0, 0.0, 0.0)),
        ((0, 0, 1000, 0), (0.0, 0.0, 1.0, 0.0)),
        ((0, 0, 0, 0), (0.0, 0.0, -1.0, 0.0)),
        ((0, 0, 500, 1000), (0.0, 0.0, 0.0, 1.0)),
        ((-500, -250, 250, -1000), (-0.5, -0.25, -0.5, -1.0)),
        ((1001, -2000, -1000, 32766), (1.0, -1.0, -1.0, 1.0)),
    ],
)
def test_each_axis_has_its_direction(
    axes: tuple[int, int, int, int], wanted: tuple[float, float, float, float]
) -> None:
    harness = MavlinkHarness()
    send(harness, *axes)
    received = sticks(harness)
    assert received is not None
    assert received[1:] == pytest.approx(wanted)


@given(AXIS, AXIS, AXIS, AXIS)
def test_any_sticks_are_within_range_or_ignored(x: int, y: int, z: int, r: int) -> None:
    harness = MavlinkHarness()
    send(harness, x, y, z, r)
    received = sticks(harness)
    assert (received is None) is (0x7FFF in {x, y, z, r})
    assert received is None or all(-1.0 <= axis <= 1.0 for axis in received[1:])


def test_sticks_for_another_vehicle_are_ignored() -> None:
    harness = MavlinkHarness()
    for target in (0, SYSTEM + 1):
        send(harness, 1000, 0, 500, 0, target=target)
    assert sticks(harness) is None


FULL, CENTRED = (-1000, 0, 500, 0), (0, 50, 540, 0)
SECOND = "Manual control by system 254 from now on"
CENTRE = "Sticks of system 254 not used: centre them"


def first_falls_silent(*, landed: bool = False) -> MavlinkHarness:
    """System 255 has flown by full deflection, and another sender has waited all the time."""
    harness = MavlinkHarness()
    land = harness.topics.land_detected
    assert land.value is not None
    land.publish(land.value._replace(landed=landed))
    send(harness, 1000, 0, 500, 0, system=255)
    send(harness, *FULL, system=254)
    assert forward(harness) == 1.0
    harness.run(1_100_000)
    return harness


def forward(harness: MavlinkHarness) -> float:
    received = sticks(harness)
    assert received is not None
    return received.forward


def texts(harness: MavlinkHarness) -> list[str]:
    return [message.text for message in harness.received("STATUSTEXT")]


def test_in_the_air_another_sender_of_sticks_is_accepted_once_they_are_centred() -> None:
    harness = first_falls_silent()
    for _ in range(5):
        send(harness, *FULL, system=254)
    assert forward(harness) == 1.0
    send(harness, *CENTRED, system=254)
    assert forward(harness) == 0.0
    send(harness, *FULL, system=254)
    assert forward(harness) == -1.0
    harness.run()
    assert texts(harness) == [CENTRE, SECOND]


@pytest.mark.parametrize("axis", range(4))
def test_every_stick_has_to_be_centred_the_throttle_too(axis: int) -> None:
    harness = first_falls_silent()
    axes = list(CENTRED)
    axes[axis] += 200
    send(harness, *(axes[0], axes[1], axes[2], axes[3]), system=254)
    assert forward(harness) == 1.0


@pytest.mark.parametrize("legacy", [False, True], ids=["DO_SET_MODE", "SET_MODE"])
@pytest.mark.parametrize(("system", "wanted"), [(254, -1.0), (253, 1.0)])
def test_a_mode_ordered_by_a_sender_makes_its_sticks_count(
    system: int, wanted: float, *, legacy: bool
) -> None:
    harness = first_falls_silent()
    send(harness, *FULL, system=254)
    order: Any = mavlink.MAVLink_command_long_message(
        SYSTEM, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )
    if legacy:
        order = mavlink.MAVLink_set_mode_message(SYSTEM, 1, 3 << 16)
    harness.send(order, system=system)
    harness.run()
    assert forward(harness) == wanted


def test_a_mode_ordered_while_another_sender_steers_changes_nothing() -> None:
    harness = first_falls_silent()
    send(harness, *FULL, system=254)
    send(harness, 500, 0, 500, 0, system=255)
    order = mavlink.MAVLink_set_mode_message(SYSTEM, 1, 3 << 16)
    harness.send(order, system=254)
    harness.run()
    assert forward(harness) == 0.5


def test_on_the_ground_another_sender_of_sticks_is_accepted_after_a_timeout() -> None:
    harness = first_falls_silent(landed=True)
    send(harness, *FULL, system=254)
    assert forward(harness) == -1.0
    harness.run()
    assert texts(harness) == [SECOND]


def test_the_same_sender_of_sticks_goes_on_after_a_pause() -> None:
    harness = first_falls_silent()
    send(harness, *FULL, system=255)
    assert forward(harness) == -1.0
    harness.run()
    assert texts(harness) == []


def test_two_senders_of_sticks_with_the_same_ids_do_not_steer_at_once() -> None:
    harness = first_falls_silent()
    send(harness, 500, 0, 500, 0, system=255)
    for axes in (FULL, CENTRED, FULL):
        send(harness, *axes, system=255, source=BROKER)
        assert forward(harness) == 0.5
    harness.run(1_100_000)
    send(harness, *FULL, system=255, source=BROKER)
    assert forward(harness) == 0.5, "its pilot may not know that he begins to steer"
    send(harness, *CENTRED, system=255, source=BROKER)
    assert forward(harness) == 0.0
    send(harness, *FULL, system=255, source=BROKER)
    assert forward(harness) == -1.0


def report(
    capabilities: int = 3, latitude: float = 40.4, altitude: float = 650.0, north: float = 2.0
) -> Any:
    return mavlink.MAVLink_follow_target_message(
        timestamp=1,
        est_capabilities=capabilities,
        lat=round(latitude * 1e7),
        lon=-37_000_000,
        alt=altitude,
        vel=[north, -1.0, 0.5],
        acc=[0.0] * 3,
        attitude_q=[1.0, 0.0, 0.0, 0.0],
        rates=[0.0] * 3,
        position_cov=[1.5, 0.0, 0.0],
        custom_state=0,
    )


def test_target_position_and_velocity_are_published() -> None:
    harness = MavlinkHarness()
    harness.send(report())
    harness.run()
    target = harness.topics.follow_target.value
    assert target is not None
    assert target.latitude_deg == pytest.approx(40.4)
    assert target.longitude_deg == pytest.approx(-3.7)
    assert target.altitude_amsl_m == 650.0
    assert target.velocity_ned == (2.0, -1.0, 0.5)
    assert target.accuracy_m == 1.5
    assert target.system_id == 255


def test_missing_target_values_are_unset() -> None:
    harness = MavlinkHarness()
    harness.send(report(capabilities=1))
    harness.run()
    target = harness.topics.follow_target.value
    assert target is not None
    assert all(map(math.isnan, target.velocity_ned))
    harness.send(report(capabilities=2))
    harness.run()
    target = harness.topics.follow_target.value
    assert target is not None
    assert math.isnan(target.latitude_deg)


@pytest.mark.parametrize(
    "message",
    [
        report(latitude=95.0),
        report(altitude=math.nan),
        report(altitude=math.inf),
        report(north=math.nan),
        report(north=1e9),
    ],
)
def test_impossible_targets_are_ignored(message: Any) -> None:
    harness = MavlinkHarness()
    harness.send(message)
    harness.run()
    assert harness.topics.follow_target.value is None
