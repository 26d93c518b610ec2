"""What tests of the edge server's client share."""

from collections.abc import Iterator

import pytest

from tests.support.fake_edge import FakeEdgeServer
from tests.unit.mavlink_broker.edge.clients import KEY


@pytest.fixture
def server() -> Iterator[FakeEdgeServer]:
    with FakeEdgeServer(0, KEY).running() as running:
        yield running
