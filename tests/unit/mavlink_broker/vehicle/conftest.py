"""Settings of the tests of one vehicle."""

import pytest

from mavlink_broker.microservices import log_download
from tests.support.log_air import PART_BYTES


@pytest.fixture
def _small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs of several parts take an eighth of the time; `tests/contract` has whole parts."""
    monkeypatch.setattr(log_download, "PART_BYTES", PART_BYTES)
