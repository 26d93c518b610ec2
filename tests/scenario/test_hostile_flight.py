"""A mission under fire is the mission in peace; `make fuzz` does the same with a million frames."""

from pathlib import Path

import pytest

from tests.support.hostile_flight import fly
from tests.support.messages import said

pytestmark = pytest.mark.scenario

FRAMES = 20_000
LARGEST_GROWTH_MB = 30.0


@pytest.mark.parametrize("is_signed", [True, False], ids=["signed", "open"])
def test_nothing_moves_that_was_not_commanded(tmp_path: Path, *, is_signed: bool) -> None:
    calm = fly(tmp_path / "calm", 0, is_signed=is_signed)
    under_fire = fly(tmp_path / "fire", FRAMES, is_signed=is_signed, calls=calm.calls)
    assert under_fire.sent.total() == FRAMES
    assert under_fire.items_reached == calm.items_reached == [0, 1, 2, 3, 4]
    assert said(under_fire.track) == said(calm.track)
    assert under_fire.growth_mb < LARGEST_GROWTH_MB
    assert under_fire.refused is not None
    if is_signed:
        assert under_fire.refused.unsigned > FRAMES / 2
        assert under_fire.refused.bad_signature > FRAMES / 50
        assert under_fire.refused.version_1 > FRAMES / 50
        assert under_fire.answered_bytes == 0
    else:
        assert under_fire.refused.malformed > FRAMES / 5
        assert under_fire.refused.unsigned == under_fire.refused.bad_signature == 0
