import pytest

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    GROUND,
    UNKNOWN_PEER,
    MavlinkHarness,
)
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.modules.mavlink.wire.peers import (
    MAX_CANDIDATES,
    MAX_DISCOVERED_PEERS,
    PeerTable,
    Profile,
)

HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
SECOND_US = 1_000_000


def test_configured_peers_get_heartbeats_from_the_start() -> None:
    harness = MavlinkHarness()
    harness.run(10 * SECOND_US)
    assert 20 <= len(harness.received("HEARTBEAT")) <= 24
    assert 20 <= len(harness.received("HEARTBEAT", at=BROKER)) <= 24


def test_a_peer_is_discovered_by_its_heartbeat() -> None:
    harness = MavlinkHarness()
    harness.run(SECOND_US)
    assert harness.received(at=UNKNOWN_PEER) == []
    harness.send(HEARTBEAT, source=UNKNOWN_PEER)
    harness.run(10 * SECOND_US)
    assert len(harness.received("ATTITUDE", at=UNKNOWN_PEER)) > 140


def test_an_unknown_sender_without_heartbeat_is_ignored() -> None:
    harness = MavlinkHarness()
    arm = mavlink.MAVLink_command_long_message(7, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    harness.send(arm, source=UNKNOWN_PEER)
    harness.run()
    assert harness.commands() == []
    harness.send(HEARTBEAT, source=UNKNOWN_PEER)
    harness.send(arm, source=UNKNOWN_PEER)
    harness.run()
    assert len(harness.commands()) == 1


def listen_to(harness: MavlinkHarness, source: Address, seconds: int) -> None:
    """Let a peer send HEARTBEAT every second for a time."""
    for _ in range(seconds):
        harness.send(HEARTBEAT, source=source)
        harness.run(SECOND_US)
    harness.send(HEARTBEAT, source=source)
    harness.run()


@pytest.mark.thorough
def test_a_discovered_peer_times_out_and_can_return() -> None:
    harness = MavlinkHarness()
    listen_to(harness, UNKNOWN_PEER, 70)
    harness.run(59 * SECOND_US)
    harness.received(at=UNKNOWN_PEER)
    harness.run(SECOND_US // 2)
    assert harness.received(at=UNKNOWN_PEER)
    harness.run(3 * SECOND_US)
    harness.received(at=UNKNOWN_PEER)
    harness.run(2 * SECOND_US)
    assert harness.received(at=UNKNOWN_PEER) == []
    assert harness.received("HEARTBEAT", at=GROUND)
    harness.send(HEARTBEAT, source=UNKNOWN_PEER)
    harness.run(2 * SECOND_US)
    assert harness.received("HEARTBEAT", at=UNKNOWN_PEER)


def test_a_peer_with_one_heartbeat_times_out_after_ten_seconds() -> None:
    harness = MavlinkHarness()
    harness.send(HEARTBEAT, source=UNKNOWN_PEER)
    harness.run(9 * SECOND_US)
    harness.received(at=UNKNOWN_PEER)
    harness.run(SECOND_US // 2)
    assert harness.received(at=UNKNOWN_PEER)
    harness.run(3 * SECOND_US)
    harness.received(at=UNKNOWN_PEER)
    harness.run(20 * SECOND_US)
    assert harness.received(at=UNKNOWN_PEER) == []


@pytest.mark.thorough
def test_the_timeout_grows_with_the_time_a_peer_is_known() -> None:
    harness = MavlinkHarness()
    listen_to(harness, UNKNOWN_PEER, 30)
    harness.run(28 * SECOND_US)
    harness.received(at=UNKNOWN_PEER)
    harness.run(SECOND_US // 2)
    assert harness.received(at=UNKNOWN_PEER)
    harness.run(4 * SECOND_US)
    harness.received(at=UNKNOWN_PEER)
    harness.run(SECOND_US)
    assert harness.received(at=UNKNOWN_PEER) == []


def forged(number: int) -> Address:
    return (f"198.51.{number // 250 % 250}.{number % 250 + 1}", 1024 + number // 62_500)


def test_a_ground_station_is_admitted_during_a_flood_of_forged_peers() -> None:
    harness = MavlinkHarness()
    for step in range(400):
        for number in range(50 * step, 50 * step + 50):
            harness.send(HEARTBEAT, source=forged(number))
        if step % 50 == 25:
            harness.send(HEARTBEAT, source=UNKNOWN_PEER)
        harness.run()
    assert len(harness.received("ATTITUDE", at=UNKNOWN_PEER)) > 10
    assert len(harness.module._peers) == MAX_DISCOVERED_PEERS + 2


def test_an_active_ground_station_is_not_replaced_during_a_flood() -> None:
    harness = MavlinkHarness()
    listen_to(harness, UNKNOWN_PEER, 2)
    harness.send(mavlink.MAVLink_param_request_list_message(7, 1), source=UNKNOWN_PEER)
    for _ in range(20):
        for number in range(100):
            harness.send(HEARTBEAT, source=forged(number))
        harness.send(HEARTBEAT, source=UNKNOWN_PEER)
        harness.run(SECOND_US)
    harness.received(at=UNKNOWN_PEER)
    harness.run(SECOND_US)
    assert len(harness.received("ATTITUDE", at=UNKNOWN_PEER)) > 10


def test_a_timed_out_peer_is_replaced_first() -> None:
    harness = MavlinkHarness()
    request = mavlink.MAVLink_param_request_read_message(7, 1, b"NONE", -1)
    for number in range(MAX_DISCOVERED_PEERS):
        harness.send(HEARTBEAT, source=forged(number))
        harness.send(request, source=forged(number))
    for _ in range(8):
        for number in range(1, MAX_DISCOVERED_PEERS):
            harness.send(HEARTBEAT, source=forged(number))
        harness.run(SECOND_US)
    listen_to(harness, UNKNOWN_PEER, 2)
    harness.received(at=UNKNOWN_PEER)
    harness.received(at=forged(0))
    harness.run(SECOND_US)
    assert harness.received(at=UNKNOWN_PEER)
    assert harness.received(at=forged(0)) == []
    assert all(harness.received(at=forged(number)) for number in range(1, MAX_DISCOVERED_PEERS))


def test_candidates_use_bounded_memory() -> None:
    table = PeerTable((), {Profile.GROUND_STATION: {0: SECOND_US}})
    for number in range(3 * MAX_CANDIDATES):
        table.discover(forged(number), number)
    assert len(table) == MAX_DISCOVERED_PEERS
    assert len(table._candidates) == MAX_CANDIDATES
    assert len(table.close_timed_out(3 * MAX_CANDIDATES)) == 0


def test_the_number_of_discovered_peers_is_limited() -> None:
    harness = MavlinkHarness()
    for i in range(MAX_DISCOVERED_PEERS + 5):
        harness.send(HEARTBEAT, source=("192.0.2.50", 20_000 + i))
    harness.run(SECOND_US)
    received = [
        bool(harness.received(at=("192.0.2.50", 20_000 + i)))
        for i in range(MAX_DISCOVERED_PEERS + 5)
    ]
    assert received == [True] * MAX_DISCOVERED_PEERS + [False] * 5


def test_each_peer_has_a_sequence_counter_without_gaps() -> None:
    harness = MavlinkHarness()
    harness.run(8 * SECOND_US)
    for peer in (GROUND, BROKER):
        sequence = [message.get_seq() for message in harness.received(at=peer)]
        assert len(sequence) > 256
        assert sequence == [i % 256 for i in range(len(sequence))]


def test_own_frames_from_a_router_are_ignored() -> None:
    harness = MavlinkHarness()
    arm = mavlink.MAVLink_command_long_message(7, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    harness.send(arm, system=7, component=1)
    harness.run()
    assert harness.commands() == []


def test_heartbeats_of_ground_station_and_broker_are_published() -> None:
    harness = MavlinkHarness()
    received = harness.topics.ground_station_heartbeat
    for kind, expected in ((6, 1), (18, 2), (2, 2), (30, 2)):
        harness.send(mavlink.MAVLink_heartbeat_message(kind, 8, 0, 0, 0, 3))
        harness.run()
        assert received.count == expected
    assert received.value is not None
    assert received.value <= harness.now_us


def test_an_unreachable_peer_gets_heartbeats_only() -> None:
    harness = MavlinkHarness()
    harness.memory.unreachable.add(BROKER)
    harness.run(2 * SECOND_US)
    harness.received(at=BROKER)
    harness.run(5 * SECOND_US)
    reported = harness.received(at=BROKER)
    assert {message.get_type() for message in reported} == {"HEARTBEAT"}
    assert len(reported) >= 4
    assert len(harness.received("ATTITUDE", at=GROUND)) > 60


def test_a_peer_that_becomes_reachable_gets_all_streams_within_seconds() -> None:
    harness = MavlinkHarness()
    harness.memory.unreachable.add(BROKER)
    harness.run(5 * SECOND_US)
    harness.memory.unreachable.clear()
    harness.run(4 * SECOND_US)
    harness.received(at=BROKER)
    harness.run(SECOND_US)
    assert len(harness.received("ATTITUDE", at=BROKER)) > 50


def test_an_unreachable_peer_that_sends_gets_all_streams_at_once() -> None:
    harness = MavlinkHarness()
    harness.memory.unreachable.add(BROKER)
    harness.run(5 * SECOND_US)
    harness.memory.unreachable.clear()
    harness.send(HEARTBEAT, source=BROKER)
    harness.received(at=BROKER)
    harness.run(SECOND_US)
    assert len(harness.received("ATTITUDE", at=BROKER)) > 50
