from tests.unit.uav_firmware.modules.mavlink.harness import BROKER, GROUND, STRANGER, Bench
from uav_firmware.modules.mavlink.dialect import mavlink
from uav_firmware.modules.mavlink.peers import MAX_LEARNT_PEERS

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


def test_a_learnt_peer_is_forgotten_after_a_minute_of_silence_and_can_come_back() -> None:
    bench = Bench()
    bench.say(HEARTBEAT, source=STRANGER)
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
