"""The databases of these tests are closed behind each test, as the end of a program does it."""

from collections.abc import Iterator

import pytest

from mavlink_broker.database import Database
from tests.support.descriptors import closed_afterwards


@pytest.fixture(autouse=True)
def _no_open_databases() -> Iterator[None]:
    """A broker that is killed closes nothing: what its test leaves open would stay so."""
    with closed_afterwards(Database):
        yield
