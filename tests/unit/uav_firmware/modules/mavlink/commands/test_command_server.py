from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    GROUND,
    SYSTEM,
    Bench,
    command_int,
    command_long,
    mission_count,
    mission_item,
)
from uav_firmware.bus import Queue
from uav_firmware.modules.mavlink.commands.command_server import CommandServer
from uav_firmware.modules.mavlink.commands.commands import FORWARDED
from uav_firmware.modules.mavlink.wire.addressing import Sender
from uav_firmware.modules.mavlink.wire.dialect import frame, mavlink, pack, parse
from uav_firmware.modules.mavlink.wire.dialect_extensions import MAV_RESULT_CANCELLED, CommandCancel
from uav_firmware.msg.status import VehicleCommand, VehicleCommandAck

ARM, TAKEOFF, MODE, CURRENT = 400, 22, 176, 224
ACCEPTED, BUSY, DENIED, UNSUPPORTED, FAILED, RUNNING = 0, 1, 2, 3, 4, 5
SECOND_US = 1_000_000


def received(message: Any) -> Any:
    """A message as it comes out of the codec."""
    return parse(frame(pack(message), 0, 255, 190)).messages[0]


def results(answers: list[Any]) -> list[int]:
    return [answer.result for answer in answers]


def test_a_command_reaches_the_commander_and_its_answer_the_sender() -> None:
    bench = Bench()
    assert bench.ask(command_long(ARM, 1.0), "COMMAND_ACK", system=201, component=5) == []
    (command,) = bench.commands()
    assert (command.command, command.param1, command.source_system) == (ARM, 1.0, 201)
    bench.answer(command, ACCEPTED)
    bench.run()
    (ack,) = bench.hear("COMMAND_ACK")
    assert (ack.command, ack.result, ack.target_system, ack.target_component) == (ARM, 0, 201, 5)
    assert bench.hear("COMMAND_ACK", at=BROKER) == []


def test_long_and_int_mean_the_same() -> None:
    bench = Bench()
    bench.say(command_long(192, -1, 1, 0, 0, 40.5, -3.25, 700))
    bench.say(command_int(192, -1, 1, 0, 0, 405_000_000, -32_500_000, 700, frame=5), system=254)
    bench.run()
    one, other = bench.commands()
    assert one[1:10] == other[1:10]


@pytest.mark.parametrize("number", [0, 2, 241, 2600, 31_000, 65_535])
@pytest.mark.parametrize("message", [command_long, command_int])
def test_what_is_not_known_is_refused_at_once(message: Any, number: int) -> None:
    bench = Bench()
    assert results(bench.ask(message(number), "COMMAND_ACK")) == [UNSUPPORTED]
    assert bench.commands() == []


def test_a_frame_that_is_not_flown_in_is_refused_as_such() -> None:
    bench = Bench()
    assert results(bench.ask(command_int(192, frame=1), "COMMAND_ACK")) == [9]
    assert bench.commands() == []


@pytest.mark.parametrize(
    "target",
    [
        {"target_system": SYSTEM + 1},
        {"target_component": 100},
        {"target_system": 0},
        {"target_system": 0, "target_component": 0},
    ],
)
def test_a_command_for_somebody_else_is_ignored(target: dict[str, int]) -> None:
    bench = Bench()
    assert bench.ask(command_long(ARM, 1.0, **target), "COMMAND_ACK") == []
    assert bench.commands() == []


def test_a_command_for_all_components_is_taken() -> None:
    bench = Bench()
    bench.say(command_long(ARM, 1.0, target_component=0))
    bench.run()
    assert len(bench.commands()) == 1


def test_progress_is_told_and_the_answer_comes_once() -> None:
    bench = Bench()
    bench.say(command_long(TAKEOFF))
    bench.run()
    (command,) = bench.commands()
    bench.answer(command, RUNNING, progress=40)
    bench.run()
    (ack,) = bench.hear("COMMAND_ACK")
    assert (ack.result, ack.progress) == (RUNNING, 40)
    bench.run(5 * SECOND_US)
    told = bench.hear("COMMAND_ACK")
    assert len(told) >= 5, "a sender may take a second of silence for a loss"
    assert {(ack.result, ack.progress) for ack in told} == {(RUNNING, 40)}
    bench.answer(command, ACCEPTED)
    bench.answer(command, FAILED)
    bench.run(20 * SECOND_US)
    assert results(bench.hear("COMMAND_ACK")) == [ACCEPTED]


def test_a_commander_that_stays_silent_is_a_failure_after_two_seconds() -> None:
    bench = Bench()
    bench.say(command_long(ARM, 1.0))
    bench.run(1_900_000)
    assert bench.hear("COMMAND_ACK") == []
    (command,) = bench.commands()
    bench.run(200_000)
    assert results(bench.hear("COMMAND_ACK")) == [FAILED]
    bench.answer(command, ACCEPTED)
    bench.run(SECOND_US)
    assert bench.hear("COMMAND_ACK") == []


def test_a_repetition_while_waiting_is_neither_executed_nor_answered_twice() -> None:
    bench = Bench()
    for confirmation in range(4):
        bench.say(command_long(ARM, 1.0, confirmation=confirmation))
    bench.run()
    (command,) = bench.commands()
    bench.answer(command, ACCEPTED)
    bench.run(SECOND_US)
    assert results(bench.hear("COMMAND_ACK")) == [ACCEPTED]


def test_a_repetition_of_a_running_command_is_told_that_it_runs() -> None:
    bench = Bench()
    bench.say(command_long(TAKEOFF))
    bench.run()
    (command,) = bench.commands()
    bench.answer(command, RUNNING)
    bench.run()
    again = bench.ask(command_long(TAKEOFF, confirmation=1), "COMMAND_ACK")
    assert results(again) == [RUNNING]
    other = bench.ask(command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 700), "COMMAND_ACK")
    assert results(other) == [BUSY]
    assert bench.commands() == []


def test_a_repetition_after_a_lost_answer_is_answered_and_not_executed() -> None:
    bench = Bench()
    bench.say(command_long(ARM, 1.0))
    bench.run()
    (command,) = bench.commands()
    bench.answer(command, DENIED)
    bench.run()
    bench.hear()
    again = bench.ask(command_long(ARM, 1.0, confirmation=1), "COMMAND_ACK")
    assert results(again) == [DENIED]
    assert bench.commands() == []
    bench.say(command_long(ARM, 1.0))
    bench.run()
    assert len(bench.commands()) == 1


def twice(bench: Bench, message: Any, between: Any = None) -> None:
    """A datagram that the network duplicates, with another one between if given."""
    bench.say(message)
    frame = bench.memory.incoming[-1]
    bench.run()
    for command in bench.commands():
        bench.answer(command, ACCEPTED)
    bench.run()
    if between is not None:
        bench.say(between)
    bench.memory.incoming.append(frame)
    bench.run()


@pytest.mark.parametrize("message", [command_long, command_int])
@pytest.mark.parametrize("between", [None, command_long(MODE, 1, 4, 3)])
def test_a_duplicated_datagram_is_answered_again_and_not_executed(
    message: Any, between: Any
) -> None:
    bench = Bench()
    twice(bench, message(115, 30, 10, 1, 1), between)
    assert 115 not in {command.command for command in bench.commands()}
    acks = [ack for ack in bench.hear("COMMAND_ACK") if ack.command == 115]
    assert results(acks) == [ACCEPTED, ACCEPTED]


def test_a_sender_that_does_not_count_its_frames_is_obeyed_each_time() -> None:
    bench = Bench()
    executed = []
    for arm in (1.0, 0.0, 1.0, 0.0):
        bench.say(command_long(ARM, arm), sequence=0)
        bench.run()
        for command in bench.commands():
            executed.append(command.param1)
            bench.answer(command, ACCEPTED)
    assert executed == [1.0, 0.0, 1.0, 0.0]


def test_the_same_wish_again_is_obeyed_again() -> None:
    bench = Bench()
    for _ in range(2):
        bench.say(command_int(115, 30, 10, 1, 1))
        bench.run()
        (command,) = bench.commands()
        bench.answer(command, ACCEPTED)
        bench.run()


def test_a_cancelled_command_is_ended_by_whoever_carries_it_out() -> None:
    ended: list[int] = []
    queue: Queue[VehicleCommand] = Queue()
    server = CommandServer(
        system_id=SYSTEM,
        answerers=(),
        commander=queue,
        mission_length=lambda: 0,
        cancel=ended.append,
    )
    sender = Sender(255, 190, GROUND)
    server.handle(received(command_long(TAKEOFF)), sender, 0)
    (command,) = queue.drain()
    cancel = CommandCancel(target_system=SYSTEM, target_component=1, command=TAKEOFF)
    assert server.cancel(cancel, sender, 0) == []
    assert ended == [], "nothing is known to be running yet"
    server.answers([VehicleCommandAck(0, TAKEOFF, RUNNING, 10, command.token)], 0)
    stranger = CommandCancel(target_system=SYSTEM + 1, target_component=1, command=TAKEOFF)
    server.cancel(stranger, sender, 0)
    assert ended == []
    server.cancel(cancel, sender, 0)
    assert ended == [command.token]
    cancelled = VehicleCommandAck(0, TAKEOFF, MAV_RESULT_CANCELLED, 255, command.token)
    (final,) = server.answers([cancelled], 0)
    assert final.message.result == MAV_RESULT_CANCELLED


def test_cancelling_what_does_not_run_is_ignored() -> None:
    cancel = CommandCancel(target_system=SYSTEM, target_component=1, command=TAKEOFF)
    assert Bench().ask(cancel, "COMMAND_ACK") == []


def test_two_senders_of_one_command_get_an_answer_each() -> None:
    bench = Bench()
    bench.say(command_long(ARM, 1.0), system=255)
    bench.say(command_long(ARM, 1.0), system=245, source=BROKER)
    bench.run()
    first, second = bench.commands()
    bench.answer(second, DENIED)
    bench.answer(first, ACCEPTED)
    bench.run()
    assert results(bench.hear("COMMAND_ACK")) == [ACCEPTED]
    assert results(bench.hear("COMMAND_ACK", at=BROKER)) == [DENIED]


@given(
    st.lists(
        st.tuples(
            st.sampled_from([*sorted(FORWARDED), 511, 512, 520, 34, 9999]),
            st.integers(200, 203),
            st.floats(allow_nan=True, width=32),
            st.booleans(),
        ),
        max_size=12,
    ),
    st.integers(0, 4),
)
def test_every_distinct_command_gets_exactly_one_final_answer(
    sent: list[tuple[int, int, float, bool]], result: int
) -> None:
    bench = Bench()
    distinct = {(number, system): (number, system, p, i) for number, system, p, i in sent}
    for number, system, parameter, is_int in distinct.values():
        message = command_int if is_int else command_long
        bench.say(message(number, parameter), system=system)
    bench.run()
    for command in bench.commands():
        bench.answer(command, RUNNING)
        bench.answer(command, result)
        bench.answer(command, ACCEPTED)
    bench.run(13 * SECOND_US)
    final = [
        (ack.command, ack.target_system)
        for ack in bench.hear("COMMAND_ACK")
        if ack.result != RUNNING
    ]
    assert sorted(final) == sorted(distinct)


def test_a_flood_of_commands_is_refused_beyond_the_limit() -> None:
    bench = Bench()
    for system in range(1, 101):
        bench.say(command_long(ARM, 1.0), system=system)
    bench.run()
    assert len(bench.commands()) < 100
    assert set(results(bench.hear("COMMAND_ACK"))) == {BUSY}
    bench.run(3 * SECOND_US)
    assert set(results(bench.hear("COMMAND_ACK"))) == {FAILED}


def test_set_mode_is_forwarded_and_never_answered() -> None:
    bench = Bench()
    bench.say(mavlink.MAVLink_set_mode_message(SYSTEM, 29 | 128, 0x05040000))
    bench.say(mavlink.MAVLink_set_mode_message(SYSTEM + 1, 1, 0x05040000))
    bench.say(mavlink.MAVLink_set_mode_message(SYSTEM, 0, 0x05040000))
    bench.run()
    (command,) = bench.commands()
    assert command[1:5] == (MODE, 1.0, 4.0, 5.0)
    bench.answer(command, ACCEPTED)
    bench.run(SECOND_US)
    assert bench.hear("COMMAND_ACK") == []


def test_a_mode_command_is_answered_under_the_name_it_was_sent_with() -> None:
    bench = Bench()
    bench.say(command_long(262, 6.0))
    bench.run()
    (command,) = bench.commands()
    assert command[1:5] == (MODE, 1.0, 4.0, 4.0)
    bench.answer(command, ACCEPTED)
    bench.run()
    (ack,) = bench.hear("COMMAND_ACK")
    assert (ack.command, ack.result) == (262, ACCEPTED)


def test_modes_that_there_are_not_are_refused() -> None:
    bench = Bench()
    assert results(bench.ask(command_long(262, 3.0), "COMMAND_ACK")) == [FAILED]
    assert results(bench.ask(command_long(MODE, 1.0, 77.0), "COMMAND_ACK")) == [DENIED]
    assert bench.commands() == []


def upload(bench: Bench, count: int) -> None:
    bench.say(mission_count(count))
    for seq in range(count):
        bench.say(mission_item(seq))
    bench.run()
    bench.hear()


@pytest.mark.parametrize("seq", [-1.0, 0.0, 4.0])
def test_a_current_item_goes_to_the_commander(seq: float) -> None:
    bench = Bench()
    upload(bench, 5)
    bench.say(command_long(CURRENT, seq))
    bench.run()
    assert [command.param1 for command in bench.commands()] == [seq]


def test_the_deprecated_message_for_the_current_item() -> None:
    bench = Bench()
    upload(bench, 3)
    bench.say(mavlink.MAVLink_mission_set_current_message(SYSTEM, 1, 2))
    bench.say(mavlink.MAVLink_mission_set_current_message(SYSTEM, 1, 3))
    bench.run()
    (command,) = bench.commands()
    assert (command.command, command.param1) == (CURRENT, 2.0)
    assert "no item 3" in bench.hear("STATUSTEXT")[0].text
    bench.answer(command, ACCEPTED)
    bench.run(SECOND_US)
    assert bench.hear("COMMAND_ACK") == []
