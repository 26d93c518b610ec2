"""Every reason code has its meaning for a record, and for the way."""

import pytest

from edge_server.outbox.answers import Meaning, Unreachable, judge
from edge_server.uplinks.mqtt_reasons import of_record, of_refusal

NEVER = {0x90, 0x95, 0x99}


@pytest.mark.parametrize("code", range(256))
def test_what_an_acknowledgement_means(code: int) -> None:
    meaning = judge(of_record(code)).meaning
    if code in NEVER:
        assert meaning is Meaning.REJECTED
    elif code == 0x87:
        assert meaning is Meaning.NO_ACCESS
    elif code == 0x10:
        assert meaning is Meaning.NO_CLOUD
    elif code == 0:
        assert meaning is Meaning.CONFIRMED
    else:
        assert meaning is Meaning.TRY_LATER


@pytest.mark.parametrize("code", [0x84, 0x85, 0x86, 0x87, 0x8A, 0x8C, 0x9B])
def test_a_broker_that_does_not_want_us_is_an_operators_work(code: int) -> None:
    assert judge(of_refusal(code, "no")).meaning is Meaning.NO_ACCESS


@pytest.mark.parametrize("code", [0x80, 0x88, 0x89, 0x97, 0x9C, 0x9D, 0x9F])
def test_a_broker_that_cannot_now_is_waited_for(code: int) -> None:
    reply = of_refusal(code, "no")
    assert isinstance(reply, Unreachable)
    assert reply.reason
