from tests.unit.uav_firmware.modules.mavlink.harness import BROKER, GROUND, STRANGER, Bench
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.dialect import mavlink
from uav_firmware.modules.mavlink.wire.peers import (
    MAX_CALLERS,
    MAX_LEARNT_PEERS,
    PeerTable,
    Profile,
)

HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
SECOND_US = 1_000_000


def test_configured_peers_hear_heartbeats_unprompted() -> None:
    bench = Bench()
    bench.run(10 * SECOND_US)
    assert 10 <= len(bench.hear("HEARTBEAT")) <= 12
    assert 10 <= len(bench.hear("HEARTBEAT", at=BROKER)) <= 12


def test_a_stranger_is_learnt_from_its_heartbeat_and_gets_the_ground_stations_rates() -> None:
    bench = Bench()
    bench.run(SECOND_US)
    assert bench.hear(at=STRANGER) == []
    bench.say(HEARTBEAT, source=STRANGER)
    bench.run(10 * SECOND_US)
    assert len(bench.hear("ATTITUDE", at=STRANGER)) > 140


def test_a_stranger_without_a_heartbeat_commands_nothing() -> None:
    bench = Bench()
    arm = mavlink.MAVLink_command_long_message(7, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    bench.say(arm, source=STRANGER)
    bench.run()
    assert bench.commands() == []
    bench.say(HEARTBEAT, source=STRANGER)
    bench.say(arm, source=STRANGER)
    bench.run()
    assert len(bench.commands()) == 1


def listen_to(bench: Bench, source: Address, seconds: int) -> None:
    """Let a peer send its HEARTBEAT every second, for so long and a moment."""
    for _ in range(seconds):
        bench.say(HEARTBEAT, source=source)
        bench.run(SECOND_US)
    bench.say(HEARTBEAT, source=source)
    bench.run()


def test_a_learnt_peer_is_forgotten_after_a_minute_of_silence_and_can_come_back() -> None:
    bench = Bench()
    listen_to(bench, STRANGER, 70)
    bench.run(59 * SECOND_US)
    bench.hear(at=STRANGER)
    bench.run(SECOND_US // 2)
    assert bench.hear(at=STRANGER)
    bench.run(3 * SECOND_US)
    bench.hear(at=STRANGER)
    bench.run(2 * SECOND_US)
    assert bench.hear(at=STRANGER) == []
    assert bench.hear("HEARTBEAT", at=GROUND)
    bench.say(HEARTBEAT, source=STRANGER)
    bench.run(2 * SECOND_US)
    assert bench.hear("HEARTBEAT", at=STRANGER)


def test_who_has_called_but_once_is_spoken_to_for_ten_seconds_only() -> None:
    bench = Bench()
    bench.say(HEARTBEAT, source=STRANGER)
    bench.run(9 * SECOND_US)
    bench.hear(at=STRANGER)
    bench.run(SECOND_US // 2)
    assert bench.hear(at=STRANGER)
    bench.run(3 * SECOND_US)
    bench.hear(at=STRANGER)
    bench.run(20 * SECOND_US)
    assert bench.hear(at=STRANGER) == []


def test_a_silence_is_borne_as_long_as_the_acquaintance() -> None:
    bench = Bench()
    listen_to(bench, STRANGER, 30)
    bench.run(28 * SECOND_US)
    bench.hear(at=STRANGER)
    bench.run(SECOND_US // 2)
    assert bench.hear(at=STRANGER)
    bench.run(4 * SECOND_US)
    bench.hear(at=STRANGER)
    bench.run(SECOND_US)
    assert bench.hear(at=STRANGER) == []


def forged(number: int) -> Address:
    return (f"198.51.{number // 250 % 250}.{number % 250 + 1}", 1024 + number // 62_500)


def test_a_ground_station_finds_a_place_among_callers_that_come_but_once() -> None:
    bench = Bench()
    for step in range(400):
        for number in range(50 * step, 50 * step + 50):
            bench.say(HEARTBEAT, source=forged(number))
        if step % 50 == 25:
            bench.say(HEARTBEAT, source=STRANGER)
        bench.run()
    assert len(bench.hear("ATTITUDE", at=STRANGER)) > 10
    assert len(bench.module._peers) == MAX_LEARNT_PEERS + 2


def test_a_ground_station_that_has_spoken_keeps_its_place_in_any_flood() -> None:
    bench = Bench()
    listen_to(bench, STRANGER, 2)
    bench.say(mavlink.MAVLink_param_request_list_message(7, 1), source=STRANGER)
    for _ in range(20):
        for number in range(100):
            bench.say(HEARTBEAT, source=forged(number))
        bench.say(HEARTBEAT, source=STRANGER)
        bench.run(SECOND_US)
    bench.hear(at=STRANGER)
    bench.run(SECOND_US)
    assert len(bench.hear("ATTITUDE", at=STRANGER)) > 10


def test_the_place_of_a_silent_peer_goes_first() -> None:
    bench = Bench()
    request = mavlink.MAVLink_param_request_read_message(7, 1, b"NONE", -1)
    for number in range(MAX_LEARNT_PEERS):
        bench.say(HEARTBEAT, source=forged(number))
        bench.say(request, source=forged(number))
    for _ in range(8):
        for number in range(1, MAX_LEARNT_PEERS):
            bench.say(HEARTBEAT, source=forged(number))
        bench.run(SECOND_US)
    listen_to(bench, STRANGER, 2)
    bench.hear(at=STRANGER)
    bench.hear(at=forged(0))
    bench.run(SECOND_US)
    assert bench.hear(at=STRANGER)
    assert bench.hear(at=forged(0)) == []
    assert all(bench.hear(at=forged(number)) for number in range(1, MAX_LEARNT_PEERS))


def test_callers_without_a_place_cost_bounded_memory() -> None:
    table = PeerTable((), {Profile.GROUND_STATION: {0: SECOND_US}})
    for number in range(3 * MAX_CALLERS):
        table.learn(forged(number), number)
    assert len(table) == MAX_LEARNT_PEERS
    assert len(table._callers) == MAX_CALLERS
    assert len(table.forget_silent(3 * MAX_CALLERS)) == 0


def test_no_more_strangers_are_learnt_than_the_limit() -> None:
    bench = Bench()
    for i in range(MAX_LEARNT_PEERS + 5):
        bench.say(HEARTBEAT, source=("192.0.2.50", 20_000 + i))
    bench.run(SECOND_US)
    heard = [bool(bench.hear(at=("192.0.2.50", 20_000 + i))) for i in range(MAX_LEARNT_PEERS + 5)]
    assert heard == [True] * MAX_LEARNT_PEERS + [False] * 5


def test_each_peer_has_a_sequence_counter_without_gaps() -> None:
    bench = Bench()
    bench.run(8 * SECOND_US)
    for peer in (GROUND, BROKER):
        sequence = [message.get_seq() for message in bench.hear(at=peer)]
        assert len(sequence) > 256
        assert sequence == [i % 256 for i in range(len(sequence))]


def test_an_own_frame_that_comes_back_is_ignored() -> None:
    bench = Bench()
    arm = mavlink.MAVLink_command_long_message(7, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    bench.say(arm, system=7, component=1)
    bench.run()
    assert bench.commands() == []


def test_the_commander_hears_of_ground_station_and_broker_but_not_of_other_vehicles() -> None:
    bench = Bench()
    heard = bench.topics.ground_station_heartbeat
    for kind, expected in ((6, 1), (18, 2), (2, 2), (30, 2)):
        bench.say(mavlink.MAVLink_heartbeat_message(kind, 8, 0, 0, 0, 3))
        bench.run()
        assert heard.count == expected
    assert heard.value is not None
    assert heard.value <= bench.now_us


def test_where_nobody_listens_only_heartbeats_go() -> None:
    bench = Bench()
    bench.memory.deaf.add(BROKER)
    bench.run(2 * SECOND_US)
    bench.hear(at=BROKER)
    bench.run(5 * SECOND_US)
    told = bench.hear(at=BROKER)
    assert {message.get_type() for message in told} == {"HEARTBEAT"}
    assert len(told) >= 4
    assert len(bench.hear("ATTITUDE", at=GROUND)) > 60


def test_whoever_begins_to_listen_has_all_streams_within_seconds() -> None:
    bench = Bench()
    bench.memory.deaf.add(BROKER)
    bench.run(5 * SECOND_US)
    bench.memory.deaf.clear()
    bench.run(4 * SECOND_US)
    bench.hear(at=BROKER)
    bench.run(SECOND_US)
    assert len(bench.hear("ATTITUDE", at=BROKER)) > 50


def test_whoever_speaks_has_all_streams_at_once() -> None:
    bench = Bench()
    bench.memory.deaf.add(BROKER)
    bench.run(5 * SECOND_US)
    bench.memory.deaf.clear()
    bench.say(HEARTBEAT, source=BROKER)
    bench.hear(at=BROKER)
    bench.run(SECOND_US)
    assert len(bench.hear("ATTITUDE", at=BROKER)) > 50
