"""Two vehicles with one system id are distinguished from one vehicle on two links."""

from mavlink_broker.links.url import Address
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.routing.link_selection import DuplicateSystemIds

HERE = Address("192.0.2.1", 14581)
THERE = Address("192.0.2.9", 14581)
ELSEWHERE = Address("192.0.2.20", 14581)


def attitude(boot_s: float) -> Message:
    return received_from_1(mavlink.MAVLink_attitude_message(int(boot_s * 1e3), 0, 0, 0, 0, 0, 0))


def heartbeat() -> Message:
    return received_from_1(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))


def received_from_1(message: Message) -> Message:
    (decoded,) = Decoder().decode(Encoder(1, 1).encode(message))
    return decoded


def received(behind_s: float, seconds: int = 10) -> tuple[DuplicateSystemIds, list[bool]]:
    """Two links, on the second of which the clock is behind by so much."""
    twins, reported = DuplicateSystemIds(), []
    for second in range(seconds):
        twins.receive_active(attitude(100.0 + second), HERE, float(second))
        reported.append(
            twins.receive_other(attitude(100.1 + second - behind_s), THERE, second + 0.1)
        )
    return twins, reported


def test_the_same_clock_on_both_links_is_one_vehicle() -> None:
    for behind_s in (0.0, 1.5, 5.0):
        twins, reported = received(behind_s)
        assert not any(reported)
        assert twins.warning(1, 10.0) is None


def test_another_clock_is_another_vehicle_and_reported_once() -> None:
    twins, reported = received(40.0)
    assert reported.count(True) == 1
    assert twins.warning(1, 10.0) == (
        "another vehicle at 192.0.2.9:14581 has the same system id, 1"
    )
    assert twins.warning(2, 10.0) is None


def test_a_warning_ends_when_the_other_falls_silent() -> None:
    twins, _ = received(40.0)
    assert twins.warning(1, 60.0) is None


def test_a_forgotten_system_has_no_warning() -> None:
    twins, _ = received(40.0)
    twins.forget(1)
    assert twins.warning(1, 10.0) is None
    assert not twins.receive_other(attitude(3.0), THERE, 10.0)


def test_one_without_a_clock_is_the_same_once_it_is_received_for_as_long_as_a_clock_takes() -> None:
    """However long the first one has been silent: its clock follows its first heartbeat."""
    twins, _ = received(0.0)
    assert not twins.is_same(heartbeat(), ELSEWHERE, 100.0)
    assert not twins.is_same(heartbeat(), ELSEWHERE, 102.9)
    assert twins.is_same(heartbeat(), ELSEWHERE, 103.0)


def test_its_first_clock_shows_on_the_active_link_that_it_is_another() -> None:
    for boot_s, is_another in ((500.0, True), (150.0, True), (204.0, False), (3.0, False)):
        twins, _ = received(0.0)
        twins.is_same(heartbeat(), ELSEWHERE, 100.0)
        assert not twins.receive_active(heartbeat(), ELSEWHERE, 103.0)
        assert twins.receive_active(attitude(boot_s), ELSEWHERE, 104.0) is is_another
        assert not twins.receive_active(attitude(boot_s + 0.1), ELSEWHERE, 104.1)
