"""A vehicle that was away shows that it is the same: by its clock, or by its number."""

from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.unit.mavlink_broker.microservices.harness import received

AWAY_S = 20.0


def version(uid: int) -> Message:
    message = mavlink.MAVLink_autopilot_version_message(0, 0, 0, 0, 0, *[[0] * 8] * 3, 0, 0, uid)
    return received(message)


def heartbeat(base_mode: int = 81) -> Message:
    return received(mavlink.MAVLink_heartbeat_message(2, 12, base_mode, 0, 4, 3))


def clock(boot_ms: int) -> Message:
    return received(mavlink.MAVLink_global_position_int_message(boot_ms, *[0] * 8))


def known(*, has_clock: bool) -> Vehicle:
    """A vehicle whose number is known at 1 s."""
    vehicle = Vehicle(1, Route(254, 191, 1, 1))
    for now in (0.0, 0.5, 1.0):
        vehicle.take(heartbeat(), now)
        if has_clock:
            vehicle.take(clock(30_000 + round(now * 1e3)), now)
    vehicle.take(version(6), 1.0)
    assert vehicle.is_identified
    return vehicle


def test_without_a_clock_its_number_is_asked_for_again() -> None:
    vehicle = known(has_clock=False)
    vehicle.take(heartbeat(), 1.0 + AWAY_S)
    assert not vehicle.is_identified
    assert not vehicle.may_be_restarted(1.0 + AWAY_S)


def test_with_a_clock_that_has_to_go_on() -> None:
    vehicle = known(has_clock=True)
    vehicle.take(heartbeat(), 1.0 + AWAY_S)
    assert vehicle.is_identified
    assert vehicle.may_be_restarted(1.0 + AWAY_S)
    vehicle.take(clock(51_000), 1.0 + AWAY_S)
    assert not vehicle.may_be_restarted(1.0 + AWAY_S)


def test_another_number_shows_a_swap_unless_the_vehicle_is_armed() -> None:
    vehicle = known(has_clock=False)
    assert vehicle.is_swapped_for(version(7))
    assert not vehicle.is_swapped_for(version(6))
    assert not vehicle.is_swapped_for(version(0))
    vehicle.take(heartbeat(81 | mavlink.MAV_MODE_FLAG_SAFETY_ARMED), 1.5)
    assert not vehicle.is_swapped_for(version(7))
