from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import (
    BROKER,
    GROUND,
    SYSTEM,
    MavlinkHarness,
    command_int,
    command_long,
    mission_count,
    mission_item,
)
from uav_firmware.bus import Queue
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.commands.command_server import CommandServer
from uav_firmware.modules.mavlink.commands.commands import FORWARDED
from uav_firmware.modules.mavlink.wire.addressing import Sender
from uav_firmware.modules.mavlink.wire.dialect import frame, mavlink, pack, parse
from uav_firmware.modules.mavlink.wire.dialect_extensions import CommandCancel
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.status import CommandResult, VehicleCommand, VehicleCommandAck

ARM, TAKEOFF, MODE, CURRENT = 400, 22, 176, 224
ACCEPTED, BUSY, DENIED, UNSUPPORTED, FAILED, RUNNING = 0, 1, 2, 3, 4, 5
SECOND_US = 1_000_000


def decoded(message: Any) -> Any:
    """A message after encoding and decoding."""
    return parse(frame(pack(message), 0, 255, 190)).messages[0]


def results(answers: list[Any]) -> list[int]:
    return [answer.result for answer in answers]


def test_a_command_reaches_the_commander_and_its_answer_everybody() -> None:
    """Whoever watches the vehicle sees whose order it obeys."""
    harness = MavlinkHarness()
    assert harness.request(command_long(ARM, 1.0), "COMMAND_ACK", system=201, component=5) == []
    (command,) = harness.commands()
    assert (command.command, command.param1, command.source_system) == (ARM, 1.0, 201)
    harness.answer(command, ACCEPTED)
    harness.run()
    for peer in (GROUND, BROKER):
        (ack,) = harness.received("COMMAND_ACK", at=peer)
        answered = (ack.command, ack.result, ack.target_system, ack.target_component)
        assert answered == (ARM, 0, 201, 5)


def test_long_and_int_mean_the_same() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(192, -1, 1, 0, 0, 40.5, -3.25, 700))
    harness.send(command_int(192, -1, 1, 0, 0, 405_000_000, -32_500_000, 700, frame=5), system=254)
    harness.run()
    one, other = harness.commands()
    assert one[1:10] == other[1:10]


@pytest.mark.parametrize("number", [0, 2, 241, 2600, 31_000, 65_535])
@pytest.mark.parametrize("message", [command_long, command_int])
def test_unknown_commands_are_refused_at_once(message: Any, number: int) -> None:
    harness = MavlinkHarness()
    assert results(harness.request(message(number), "COMMAND_ACK")) == [UNSUPPORTED]
    assert harness.commands() == []


def test_an_unsupported_frame_has_its_own_result() -> None:
    harness = MavlinkHarness()
    assert results(harness.request(command_int(192, frame=1), "COMMAND_ACK")) == [9]
    assert harness.commands() == []


@pytest.mark.parametrize(
    "target",
    [
        {"target_system": SYSTEM + 1},
        {"target_component": 100},
        {"target_system": 0},
        {"target_system": 0, "target_component": 0},
    ],
)
def test_a_command_for_another_system_is_ignored(target: dict[str, int]) -> None:
    harness = MavlinkHarness()
    assert harness.request(command_long(ARM, 1.0, **target), "COMMAND_ACK") == []
    assert harness.commands() == []


def test_a_command_for_all_components_is_accepted() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(ARM, 1.0, target_component=0))
    harness.run()
    assert len(harness.commands()) == 1


def test_progress_is_reported_and_answered_once() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(TAKEOFF))
    harness.run()
    (command,) = harness.commands()
    harness.answer(command, RUNNING, progress=40)
    harness.run()
    (ack,) = harness.received("COMMAND_ACK")
    assert (ack.result, ack.progress) == (RUNNING, 40)
    harness.run(5 * SECOND_US)
    reported = harness.received("COMMAND_ACK")
    assert len(reported) >= 5, "a sender may take a second of silence for a loss"
    assert {(ack.result, ack.progress) for ack in reported} == {(RUNNING, 40)}
    harness.answer(command, ACCEPTED)
    harness.answer(command, FAILED)
    harness.run(20 * SECOND_US)
    assert results(harness.received("COMMAND_ACK")) == [ACCEPTED]


def test_a_command_without_an_answer_fails_after_two_seconds() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(ARM, 1.0))
    harness.run(1_900_000)
    assert harness.received("COMMAND_ACK") == []
    (command,) = harness.commands()
    harness.run(200_000)
    assert results(harness.received("COMMAND_ACK")) == [FAILED]
    harness.answer(command, ACCEPTED)
    harness.run(SECOND_US)
    assert harness.received("COMMAND_ACK") == []


def test_a_repetition_while_waiting_is_neither_executed_nor_answered_twice() -> None:
    harness = MavlinkHarness()
    for confirmation in range(4):
        harness.send(command_long(ARM, 1.0, confirmation=confirmation))
    harness.run()
    (command,) = harness.commands()
    harness.answer(command, ACCEPTED)
    harness.run(SECOND_US)
    assert results(harness.received("COMMAND_ACK")) == [ACCEPTED]


def test_a_repetition_of_a_running_command_gets_progress() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(TAKEOFF))
    harness.run()
    (command,) = harness.commands()
    harness.answer(command, RUNNING)
    harness.run()
    again = harness.request(command_long(TAKEOFF, confirmation=1), "COMMAND_ACK")
    assert results(again) == [RUNNING]
    other = harness.request(command_long(TAKEOFF, 0, 0, 0, 0, 0, 0, 700), "COMMAND_ACK")
    assert results(other) == [BUSY]
    assert harness.commands() == []


def test_a_repetition_after_a_lost_answer_is_not_executed() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(ARM, 1.0))
    harness.run()
    (command,) = harness.commands()
    harness.answer(command, DENIED)
    harness.run()
    harness.received()
    again = harness.request(command_long(ARM, 1.0, confirmation=1), "COMMAND_ACK")
    assert results(again) == [DENIED]
    assert harness.commands() == []
    harness.send(command_long(ARM, 1.0))
    harness.run()
    assert len(harness.commands()) == 1


def executed(harness: MavlinkHarness, message: Any, **options: Any) -> list[float]:
    """First parameters of the commands that a message has the commander execute."""
    harness.send(message, **options)
    harness.run()
    commands = harness.commands()
    for command in commands:
        harness.answer(command, ACCEPTED)
    harness.run()
    return [command.param1 for command in commands]


@pytest.mark.parametrize("between", [GROUND, BROKER], ids=["same station", "same ids"])
def test_a_repetition_behind_another_command_is_executed(between: Address) -> None:
    """Pause, continue, and pause again, of which the first datagram is lost."""
    harness = MavlinkHarness()
    pause, resume = command_long(193, 0.0), command_long(193, 1.0)
    assert executed(harness, pause) == [0.0]
    assert executed(harness, resume, source=between) == [1.0]
    again = command_long(193, 0.0, confirmation=1)
    assert executed(harness, again) == [0.0]
    assert executed(harness, command_long(193, 0.0, confirmation=2)) == []
    assert len(harness.received("COMMAND_ACK")) == 4


def test_a_repetition_that_the_network_has_delayed_is_not_executed() -> None:
    harness = MavlinkHarness()
    assert executed(harness, command_long(193, 0.0), sequence=10) == [0.0]
    assert executed(harness, command_long(193, 1.0), sequence=12) == [1.0]
    assert executed(harness, command_long(193, 0.0, confirmation=1), sequence=11) == []


def twice(harness: MavlinkHarness, message: Any, between: Any = None) -> None:
    """A datagram duplicated by the network, with another one between if given."""
    harness.send(message)
    frame = harness.memory.incoming[-1]
    harness.run()
    for command in harness.commands():
        harness.answer(command, ACCEPTED)
    harness.run()
    if between is not None:
        harness.send(between)
    harness.memory.incoming.append(frame)
    harness.run()


@pytest.mark.parametrize("message", [command_long, command_int])
@pytest.mark.parametrize("between", [None, command_long(MODE, 1, 4, 3)])
def test_a_duplicated_datagram_is_answered_again_and_not_executed(
    message: Any, between: Any
) -> None:
    harness = MavlinkHarness()
    twice(harness, message(115, 30, 10, 1, 1), between)
    assert 115 not in {command.command for command in harness.commands()}
    acks = [ack for ack in harness.received("COMMAND_ACK") if ack.command == 115]
    assert results(acks) == [ACCEPTED, ACCEPTED]


def test_commands_of_a_sender_that_does_not_count_frames_are_all_executed() -> None:
    harness = MavlinkHarness()
    executed = []
    for arm in (1.0, 0.0, 1.0, 0.0):
        harness.send(command_long(ARM, arm), sequence=0)
        harness.run()
        for command in harness.commands():
            executed.append(command.param1)
            harness.answer(command, ACCEPTED)
    assert executed == [1.0, 0.0, 1.0, 0.0]


def test_a_repeated_command_int_is_executed_again() -> None:
    harness = MavlinkHarness()
    for _ in range(2):
        harness.send(command_int(115, 30, 10, 1, 1))
        harness.run()
        (command,) = harness.commands()
        harness.answer(command, ACCEPTED)
        harness.run()


def test_a_cancellation_is_passed_to_payload() -> None:
    ended: list[int] = []
    queue: Queue[VehicleCommand] = Queue()
    server = CommandServer(
        system_id=SYSTEM,
        local_handlers=(),
        commander=queue,
        mission_length=lambda: 0,
        texts=StatusTexts(),
        cancel=ended.append,
    )
    sender = Sender(255, 190, GROUND)
    server.handle(decoded(command_long(TAKEOFF)), sender, 0)
    (command,) = queue.drain()
    cancel = CommandCancel(target_system=SYSTEM, target_component=1, command=TAKEOFF)
    assert server.cancel(cancel, sender, 0) == []
    assert ended == [], "nothing is known to be running yet"
    server.answers([VehicleCommandAck(0, TAKEOFF, RUNNING, 10, command.token)], 0)
    foreign = CommandCancel(target_system=SYSTEM + 1, target_component=1, command=TAKEOFF)
    server.cancel(foreign, sender, 0)
    assert ended == []
    server.cancel(cancel, sender, 0)
    assert ended == [command.token]
    cancelled = VehicleCommandAck(0, TAKEOFF, CommandResult.CANCELLED, 255, command.token)
    (final,) = server.answers([cancelled], 0)
    assert final.message.result == CommandResult.CANCELLED


def test_cancelling_a_command_that_does_not_run_is_ignored() -> None:
    cancel = CommandCancel(target_system=SYSTEM, target_component=1, command=TAKEOFF)
    assert MavlinkHarness().request(cancel, "COMMAND_ACK") == []


def test_two_senders_of_a_command_both_get_an_answer() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(ARM, 1.0), system=255)
    harness.send(command_long(ARM, 1.0), system=245, source=BROKER)
    harness.run()
    first, second = harness.commands()
    harness.answer(second, DENIED)
    harness.answer(first, ACCEPTED)
    harness.run()
    for peer in (GROUND, BROKER):
        answers = harness.received("COMMAND_ACK", at=peer)
        assert {ack.target_system: ack.result for ack in answers} == {255: ACCEPTED, 245: DENIED}


@pytest.mark.thorough
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
    harness = MavlinkHarness()
    distinct = {(number, system): (number, system, p, i) for number, system, p, i in sent}
    for number, system, parameter, is_int in distinct.values():
        message = command_int if is_int else command_long
        harness.send(message(number, parameter), system=system)
    harness.run()
    for command in harness.commands():
        harness.answer(command, RUNNING)
        harness.answer(command, result)
        harness.answer(command, ACCEPTED)
    harness.run(13 * SECOND_US)
    final = [
        (ack.command, ack.target_system)
        for ack in harness.received("COMMAND_ACK")
        if ack.result != RUNNING
    ]
    assert sorted(final) == sorted(distinct)


def test_a_flood_of_commands_is_refused_beyond_the_limit() -> None:
    harness = MavlinkHarness()
    for system in range(1, 101):
        harness.send(command_long(ARM, 1.0), system=system)
    harness.run()
    assert len(harness.commands()) < 100
    assert set(results(harness.received("COMMAND_ACK"))) == {BUSY}
    harness.run(3 * SECOND_US)
    assert set(results(harness.received("COMMAND_ACK"))) == {FAILED}


def test_set_mode_is_forwarded_and_never_answered() -> None:
    harness = MavlinkHarness()
    harness.send(mavlink.MAVLink_set_mode_message(SYSTEM, 29 | 128, 0x05040000))
    harness.send(mavlink.MAVLink_set_mode_message(SYSTEM + 1, 1, 0x05040000))
    harness.send(mavlink.MAVLink_set_mode_message(SYSTEM, 0, 0x05040000))
    harness.run()
    (command,) = harness.commands()
    assert command[1:5] == (MODE, 1.0, 4.0, 5.0)
    harness.answer(command, ACCEPTED)
    harness.run(SECOND_US)
    assert harness.received("COMMAND_ACK") == []


def test_a_mode_command_is_acknowledged_by_its_own_number() -> None:
    harness = MavlinkHarness()
    harness.send(command_long(262, 6.0))
    harness.run()
    (command,) = harness.commands()
    assert command[1:5] == (MODE, 1.0, 4.0, 4.0)
    harness.answer(command, ACCEPTED)
    harness.run()
    (ack,) = harness.received("COMMAND_ACK")
    assert (ack.command, ack.result) == (262, ACCEPTED)


def test_unknown_modes_are_refused() -> None:
    harness = MavlinkHarness()
    assert results(harness.request(command_long(262, 3.0), "COMMAND_ACK")) == [FAILED]
    assert results(harness.request(command_long(MODE, 1.0, 77.0), "COMMAND_ACK")) == [DENIED]
    assert harness.commands() == []


def upload(harness: MavlinkHarness, count: int) -> None:
    harness.send(mission_count(count))
    for seq in range(count):
        harness.send(mission_item(seq))
    harness.run()
    harness.received()


@pytest.mark.parametrize("seq", [-1.0, 0.0, 4.0])
def test_set_current_is_forwarded_to_the_commander(seq: float) -> None:
    harness = MavlinkHarness()
    upload(harness, 5)
    harness.send(command_long(CURRENT, seq))
    harness.run()
    assert [command.param1 for command in harness.commands()] == [seq]


def test_the_deprecated_message_for_the_current_item() -> None:
    harness = MavlinkHarness()
    upload(harness, 3)
    harness.send(mavlink.MAVLink_mission_set_current_message(SYSTEM, 1, 2))
    harness.send(mavlink.MAVLink_mission_set_current_message(SYSTEM, 1, 3))
    harness.run()
    (command,) = harness.commands()
    assert (command.command, command.param1) == (CURRENT, 2.0)
    assert "no item 3" in harness.received("STATUSTEXT")[0].text
    harness.answer(command, ACCEPTED)
    harness.run(SECOND_US)
    assert harness.received("COMMAND_ACK") == []
