"""Too many requests are refused with a Retry-After; clients do not affect each other."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from edge_server.app import context_of, create_app
from edge_server.config import Config
from edge_server.connections.client_address import network_of
from tests.unit.edge_server.conftest import Clock, Edge
from tests.unit.edge_server.documents import telemetry

WRONG = {"X-API-Key": "fm_00000000_" + "0" * 64}


@pytest.fixture
def tight(config: Config) -> Iterator[Edge]:
    """An edge server with small limits."""
    strict = replace(
        config, requests_per_minute=3, broker_requests_per_minute=5, failures_per_minute=2
    )
    app = create_app(strict, clock=Clock())
    context = context_of(app)
    yield Edge(app.test_client(), context, Clock())
    context.close()


def test_too_many_requests_are_answered_with_a_retry_after(tight: Edge) -> None:
    found = [tight.ask("GET", "/plans/", "operator") for _ in range(4)]
    assert [answer.status_code for answer in found] == [200, 200, 200, 429]
    assert 1 <= int(found[-1].headers["Retry-After"]) <= 60
    assert (found[-1].json or {})["message"] == "too many requests with this key"
    assert tight.ask("GET", "/plans/", "farmer").status_code == 200


def test_the_broker_has_a_limit_of_its_own(tight: Edge) -> None:
    for _ in range(4):
        tight.ask("GET", "/plans/", "operator")
    found = [tight.report("pose", telemetry("pose", number)).status_code for number in range(6)]
    assert found == [201] * 5 + [429]
    assert tight.count("telemetry") == 5


def test_wrong_keys_are_counted_by_address(tight: Edge) -> None:
    def try_from(address: str) -> int:
        place = {"REMOTE_ADDR": address}
        return tight.ask("GET", "/plans/", None, headers=WRONG, environ_overrides=place).status_code

    assert [try_from("192.0.2.1") for _ in range(4)] == [401, 401, 429, 429]
    assert try_from("192.0.2.2") == 401
    assert [try_from(f"2001:db8::{number}") for number in range(3)] == [401, 401, 429]


def test_a_valid_key_is_never_limited_by_unknown_ones(tight: Edge) -> None:
    for _ in range(5):
        tight.ask("GET", "/plans/", None, headers=WRONG)
    assert tight.ask("GET", "/plans/", None, headers=WRONG).status_code == 429
    assert tight.ask("GET", "/plans/", "operator").status_code == 200
    assert tight.ask("GET", "/plans/", None).status_code == 401
    assert tight.ask("GET", "/healthz", None).status_code == 200


@pytest.mark.parametrize(
    ("address", "network"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2:3::4", "2001:db8:1:2::/64"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        (None, "unknown"),
        ("", "unknown"),
        ("nonsense", "unknown"),
    ],
)
def test_the_network_of_an_address(address: str | None, network: str) -> None:
    assert network_of(address) == network
