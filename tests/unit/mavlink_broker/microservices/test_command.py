"""One command: exactly one final outcome, whatever the link does."""

import pytest

from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.command import (
    ATTEMPTS,
    JUDGED_WITHIN_S,
    REJECTIONS,
    Accepted,
    CommandAlternatives,
    CommandInt,
    CommandLong,
    CommandSequence,
    CommandTransaction,
    Refused,
    RoundTrip,
)
from tests.unit.mavlink_broker.microservices.harness import ROUTE, acknowledgement, tick_until

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


def transaction(round_trip: RoundTrip | None = None) -> CommandTransaction:
    return CommandTransaction(CommandLong(command=ARM), ROUTE, round_trip or RoundTrip())


def test_an_accepted_command_is_over() -> None:
    command = transaction()
    command.start(0.0)
    command.receive(acknowledgement(ARM, ACCEPTED), 0.1)
    assert command.outcome == Accepted()
    assert tick_until(command, 0.1, 20.0) == []


def test_an_unanswered_command_is_repeated_with_rising_confirmation_then_given_up() -> None:
    command = transaction()
    sent = command.start(0.0) + tick_until(command, 0.0, 60.0)
    assert [message.confirmation for message in sent] == list(range(ATTEMPTS))
    assert isinstance(command.outcome, Refused)
    assert "no answer to MAV_CMD_COMPONENT_ARM_DISARM" in command.outcome.reason


def test_an_answer_to_a_repetition_counts_but_teaches_no_round_trip() -> None:
    round_trip = RoundTrip()
    command = transaction(round_trip)
    command.start(0.0)
    tick_until(command, 0.0, 1.5)
    command.receive(acknowledgement(ARM, ACCEPTED), 1.6)
    assert command.outcome == Accepted()
    assert round_trip.timeout_s == RoundTrip().timeout_s


def test_progress_extends_the_wait() -> None:
    command = transaction()
    command.start(0.0)
    for second in range(1, 30):
        command.receive(acknowledgement(ARM, mavlink.MAV_RESULT_IN_PROGRESS), float(second))
        assert tick_until(command, second, second + 0.9) == []
    command.receive(acknowledgement(ARM, ACCEPTED), 30.0)
    assert command.outcome == Accepted()


@pytest.mark.parametrize(
    ("result", "name"),
    [(2, "DENIED"), (3, "UNSUPPORTED"), (4, "FAILED"), (6, "CANCELLED"), (10, "NOT_IN_CONTROL")],
)
def test_a_refusal_is_named(result: int, name: str) -> None:
    command = transaction()
    command.start(0.0)
    command.receive(acknowledgement(ARM, result), 0.1)
    assert command.outcome == Refused(f"MAV_CMD_COMPONENT_ARM_DISARM refused: MAV_RESULT_{name}")


def test_a_temporary_rejection_is_tried_again_after_a_while() -> None:
    command = transaction()
    command.start(0.0)
    command.receive(acknowledgement(ARM, mavlink.MAV_RESULT_TEMPORARILY_REJECTED), 0.1)
    again = tick_until(command, 0.1, 1.3)
    assert [message.confirmation for message in again] == [0]
    command.receive(acknowledgement(ARM, ACCEPTED), 1.4)
    assert command.outcome == Accepted()


def test_temporary_rejections_have_an_end() -> None:
    command = transaction()
    command.start(0.0)
    rejection = acknowledgement(ARM, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    for second in range(REJECTIONS):
        command.receive(rejection, second + 0.05)
        tick_until(command, second + 0.05, second + 1.2)
    assert isinstance(command.outcome, Refused)
    assert "TEMPORARILY_REJECTED" in command.outcome.reason


def test_a_duplicated_rejection_counts_once() -> None:
    command = transaction()
    command.start(0.0)
    rejection = acknowledgement(ARM, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    for _ in range(2 * REJECTIONS):
        command.receive(rejection, 0.1)
    assert command.outcome is None


def early(round_trip: RoundTrip | None = None) -> CommandTransaction:
    command = CommandLong(command=ARM)
    return CommandTransaction(command, ROUTE, round_trip or RoundTrip(), is_accepted_early=True)


def test_of_a_command_that_is_accepted_early_the_second_answer_counts() -> None:
    command = early()
    command.start(0.0)
    command.receive(acknowledgement(ARM, ACCEPTED), 0.1)
    assert command.outcome is None
    command.receive(acknowledgement(ARM, mavlink.MAV_RESULT_DENIED), 0.12)
    assert command.outcome == Refused("MAV_CMD_COMPONENT_ARM_DISARM refused: MAV_RESULT_DENIED")


def test_a_second_acceptance_counts_at_once_and_a_missing_one_after_a_while() -> None:
    twice, once = early(), early()
    for command in (twice, once):
        command.start(0.0)
        command.receive(acknowledgement(ARM, ACCEPTED), 0.1)
    twice.receive(acknowledgement(ARM, ACCEPTED), 0.12)
    assert twice.outcome == Accepted()
    assert once.tick(0.05 + JUDGED_WITHIN_S) == []
    assert once.outcome is None
    assert once.tick(0.1 + JUDGED_WITHIN_S) == []
    assert once.outcome == Accepted()


@pytest.mark.parametrize("is_judged_first", [False, True])
def test_what_is_accepted_early_and_rejected_for_now_is_refused_in_the_end(
    *, is_judged_first: bool
) -> None:
    command = early()
    command.start(0.0)
    rejection = acknowledgement(ARM, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
    answers = [acknowledgement(ARM, ACCEPTED), rejection]
    for second in range(REJECTIONS):
        for answer in reversed(answers) if is_judged_first else answers:
            command.receive(answer, second + 0.05)
        assert isinstance(command.outcome, Refused) == (second == REJECTIONS - 1)
        tick_until(command, second + 0.05, second + 1.2)


def test_answers_to_others_and_to_other_commands_are_not_ours() -> None:
    command = transaction()
    command.start(0.0)
    command.receive(acknowledgement(ARM, ACCEPTED, target_system=255), 0.1)
    command.receive(acknowledgement(ARM + 1, ACCEPTED), 0.1)
    assert command.outcome is None


def test_a_position_travels_as_integers() -> None:
    command = CommandInt(command=192, latitude_deg=40.4434, longitude_deg=-3.7382, altitude_m=5.0)
    message = command.message(ROUTE, 3)
    assert (message.x, message.y, message.z) == (404434000, -37382000, 5.0)


DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
A, B, C = (CommandLong(command=number) for number in (300, 176, 400))


def run(
    alternatives: CommandAlternatives, answers: dict[int, int]
) -> tuple[CommandSequence, list[int]]:
    """Answer every command with the given results; returns what was sent."""
    sequence = CommandSequence(alternatives, ROUTE, RoundTrip())
    pending = sequence.start(0.0)
    sent = []
    while pending:
        sent.append(pending[0].command)
        pending = sequence.receive(acknowledgement(sent[-1], answers[sent[-1]]), 0.1)
    return sequence, sent


def test_all_commands_of_an_alternative_are_sent_in_order() -> None:
    sequence, sent = run([[B, C]], {176: ACCEPTED, 400: ACCEPTED})
    assert sent == [176, 400]
    assert sequence.outcome == Accepted()


def test_a_refusal_starts_the_next_alternative() -> None:
    sequence, sent = run([[A], [B, C]], {300: UNSUPPORTED, 176: ACCEPTED, 400: ACCEPTED})
    assert sent == [300, 176, 400]
    assert sequence.outcome == Accepted()


def test_without_further_alternatives_the_first_refusal_is_the_reason() -> None:
    sequence, sent = run([[A], [B]], {300: DENIED, 176: UNSUPPORTED})
    assert sent == [300, 176]
    assert sequence.outcome == Refused("MAV_CMD_MISSION_START refused: MAV_RESULT_DENIED")


def test_an_alternative_ends_at_its_first_refusal() -> None:
    _, sent = run([[A, B], [C]], {300: DENIED, 400: ACCEPTED})
    assert sent == [300, 400]


LATE = CommandLong(command=400, wait_s=4.5)


def test_a_command_waits_as_long_as_it_asks_behind_the_one_before() -> None:
    sequence = CommandSequence([[B, LATE]], ROUTE, RoundTrip())
    sequence.start(0.0)
    assert sequence.receive(acknowledgement(176, ACCEPTED), 0.1) == []
    assert tick_until(sequence, 0.1, 4.5) == []
    (sent,) = tick_until(sequence, 4.5, 4.7)
    assert (sent.command, sent.confirmation) == (400, 0)
    sequence.receive(acknowledgement(400, ACCEPTED), 4.8)
    assert sequence.outcome == Accepted()


def test_an_answer_to_an_earlier_command_does_not_count_while_one_waits() -> None:
    sequence = CommandSequence([[B, LATE]], ROUTE, RoundTrip())
    sequence.start(0.0)
    sequence.receive(acknowledgement(176, ACCEPTED), 0.1)
    assert sequence.receive(acknowledgement(400, ACCEPTED), 0.2) == []
    assert sequence.outcome is None
    assert [message.command for message in tick_until(sequence, 0.2, 4.8)] == [400]


def test_an_alternative_without_waiting_follows_a_refusal_at_once() -> None:
    sequence = CommandSequence([[A, LATE], [C]], ROUTE, RoundTrip())
    sequence.start(0.0)
    (sent,) = sequence.receive(acknowledgement(300, DENIED), 0.1)
    assert sent.command == 400
