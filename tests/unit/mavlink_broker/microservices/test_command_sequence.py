"""Ways to an end: in order, the first that is accepted wins."""

from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.command import Accepted, CommandLong, Refused
from mavlink_broker.microservices.command_sequence import CommandSequence, Ways
from mavlink_broker.microservices.round_trip import RoundTrip
from tests.unit.mavlink_broker.protocol.harness import ROUTE, acknowledgement

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
A, B, C = (CommandLong(command=number) for number in (300, 176, 400))


def run(ways: Ways, answers: dict[int, int]) -> tuple[CommandSequence, list[int]]:
    """Answer every command as told; gives what was sent."""
    sequence = CommandSequence(ways, ROUTE, RoundTrip())
    pending = sequence.start(0.0)
    sent = []
    while pending:
        sent.append(pending[0].command)
        pending = sequence.receive(acknowledgement(sent[-1], answers[sent[-1]]), 0.1)
    return sequence, sent


def test_all_commands_of_a_way_are_sent_in_order() -> None:
    sequence, sent = run([[B, C]], {176: ACCEPTED, 400: ACCEPTED})
    assert sent == [176, 400]
    assert sequence.outcome == Accepted()


def test_a_refusal_leads_onto_the_next_way() -> None:
    sequence, sent = run([[A], [B, C]], {300: UNSUPPORTED, 176: ACCEPTED, 400: ACCEPTED})
    assert sent == [300, 176, 400]
    assert sequence.outcome == Accepted()


def test_when_no_way_is_left_the_first_refusal_is_the_reason() -> None:
    sequence, sent = run([[A], [B]], {300: DENIED, 176: UNSUPPORTED})
    assert sent == [300, 176]
    assert sequence.outcome == Refused("MAV_CMD_MISSION_START refused: MAV_RESULT_DENIED")


def test_a_way_is_left_at_its_first_refusal() -> None:
    _, sent = run([[A, B], [C]], {300: DENIED, 400: ACCEPTED})
    assert sent == [300, 400]
