from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import BROKER, MavlinkHarness
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.status import StatusText


def test_a_text_goes_to_every_peer_with_its_severity() -> None:
    harness = MavlinkHarness()
    harness.topics.status_text.publish(StatusText(0, 4, "Battery low"))
    harness.run()
    (here,) = harness.received("STATUSTEXT")
    (there,) = harness.received("STATUSTEXT", at=BROKER)
    assert (here.text, here.severity, here.id) == ("Battery low", 4, 0)
    assert there.text == "Battery low"


@given(st.text(alphabet=st.characters(min_codepoint=32, max_codepoint=126), max_size=390))
def test_a_long_text_is_reassembled_from_chunks(text: str) -> None:
    chunks = [outgoing.message for outgoing in StatusTexts().encode(4, text)]
    assert "".join(chunk.text for chunk in chunks) == text
    assert [chunk.chunk_seq for chunk in chunks] == list(range(len(chunks)))
    if len(text) > 50:
        assert len(chunks[-1].text) < 50, "the last chunk must end in a NUL"
        assert {chunk.id for chunk in chunks} == {1}
    else:
        assert [chunk.id for chunk in chunks] == [0]


def test_consecutive_long_texts_have_different_ids() -> None:
    texts = StatusTexts()
    identifiers = [texts.encode(4, "x" * 60)[0].message.id for _ in range(70_000)]
    assert 0 not in identifiers
    assert all(a != b for a, b in pairwise(identifiers))


def test_a_too_long_text_is_truncated() -> None:
    chunks = StatusTexts().encode(4, "y" * 100_000)
    assert len(chunks) <= 8
    assert chunks[-1].message.text.endswith("...")


@given(st.text(max_size=200))
def test_any_text_can_be_sent(text: str) -> None:
    assert StatusTexts().encode(4, text)
