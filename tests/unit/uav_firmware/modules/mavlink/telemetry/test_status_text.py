from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.harness import BROKER, Bench
from uav_firmware.modules.mavlink.telemetry.status_text import StatusTexts
from uav_firmware.msg.status import StatusText


def test_a_text_goes_to_every_peer_with_its_severity() -> None:
    bench = Bench()
    bench.topics.status_text.publish(StatusText(0, 4, "Battery low"))
    bench.run()
    (here,) = bench.hear("STATUSTEXT")
    (there,) = bench.hear("STATUSTEXT", at=BROKER)
    assert (here.text, here.severity, here.id) == ("Battery low", 4, 0)
    assert there.text == "Battery low"


@given(st.text(alphabet=st.characters(min_codepoint=32, max_codepoint=126), max_size=390))
def test_a_long_text_comes_together_again(text: str) -> None:
    chunks = [outgoing.message for outgoing in StatusTexts().say(4, text)]
    assert "".join(chunk.text for chunk in chunks) == text
    assert [chunk.chunk_seq for chunk in chunks] == list(range(len(chunks)))
    if len(text) > 50:
        assert len(chunks[-1].text) < 50, "the last chunk must end in a NUL"
        assert {chunk.id for chunk in chunks} == {1}
    else:
        assert [chunk.id for chunk in chunks] == [0]


def test_long_texts_one_after_another_have_different_ids() -> None:
    texts = StatusTexts()
    identifiers = [texts.say(4, "x" * 60)[0].message.id for _ in range(70_000)]
    assert 0 not in identifiers
    assert all(a != b for a, b in pairwise(identifiers))


def test_a_text_without_end_is_cut() -> None:
    chunks = StatusTexts().say(4, "y" * 100_000)
    assert len(chunks) <= 8
    assert chunks[-1].message.text.endswith("...")


@given(st.text(max_size=200))
def test_any_text_can_be_sent(text: str) -> None:
    assert StatusTexts().say(4, text)
