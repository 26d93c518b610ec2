"""PostgreSQL goes away and comes back: nothing is lost, and no process has to be restarted."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import requests

from edge_server.process.exit_codes import WRONG_SETUP
from edge_server.store import migrate
from tests.support.databases import PostgresServer, running_server
from tests.support.fake_cloud import FakeCloud, running_cloud
from tests.support.system import wait_for
from tests.unit.edge_server import documents
from tests.unit.edge_server.program import Program, program_in


@pytest.fixture
def server() -> Iterator[PostgresServer]:
    """A server of this test alone, to be stopped."""
    with running_server() as server:
        yield server


@pytest.fixture
def cloud() -> Iterator[FakeCloud]:
    """A cloud that is there."""
    with running_cloud() as cloud:
        yield cloud


@pytest.fixture
def program(tmp_path: Path, server: PostgresServer, cloud: FakeCloud) -> Iterator[Program]:
    """Server and relay on PostgreSQL."""
    url = server.url(server.create(name="edge"))
    migrate.prepare(url)
    with program_in(tmp_path / "state", cloud.url) as program:
        program.environment["DATABASE_URL"] = url
        program.start()
        yield program


def post(program: Program, number: int) -> requests.Response:
    return requests.post(
        f"{program.url}/pose/",
        json=documents.telemetry("pose", number),
        headers={"X-API-Key": program.key("broker"), "Idempotency-Key": f"pose-{number}"},
        timeout=60.0,
    )


@pytest.mark.thorough
def test_it_answers_503_while_the_database_is_away_and_goes_on_afterwards(
    program: Program, server: PostgresServer, cloud: FakeCloud
) -> None:
    assert post(program, 0).status_code == 201
    cloud.store.wait_for(1)
    server.stop()
    for _ in range(3):
        refused = post(program, 1)
        assert refused.status_code == 503
        assert int(refused.headers["Retry-After"]) >= 1
        assert "database" in refused.json()["message"]
    assert requests.get(f"{program.url}/healthz", timeout=60.0).json()["database"] == "unavailable"
    assert requests.get(f"{program.url}/readyz", timeout=60.0).status_code == 503
    assert program.process is not None
    supervisor = program.process.pid
    server.start()
    wait_for(lambda: post(program, 1).status_code == 201, "an acknowledgement")
    assert post(program, 2).status_code == 201
    cloud.store.wait_for(3)
    assert cloud.store.stream(1, "pose") == [0, 1, 2]
    assert program.process.poll() is None
    assert program.process.pid == supervisor
    _, errors = program.end()
    assert "giving up" not in errors
    assert "Traceback" not in errors


@pytest.mark.thorough
def test_it_waits_for_a_database_that_is_not_up_yet(
    program: Program, server: PostgresServer, cloud: FakeCloud
) -> None:
    program.end()
    server.stop()
    program.begin()
    wait_for(lambda: "waiting for the database" in program.log(), "the log of the wait")
    server.start()
    program.wait_ready()
    assert post(program, 0).status_code == 201
    cloud.store.wait_for(1)


@pytest.mark.thorough
def test_a_server_that_refuses_the_login_is_named_in_one_sentence(program: Program) -> None:
    program.end()
    program.environment["DATABASE_URL"] = program.environment["DATABASE_URL"].replace(
        "/edge?", "/nowhere?"
    )
    program.begin("serve")
    code, errors = program.wait()
    assert code == WRONG_SETUP
    assert "nowhere" in errors
    assert "Traceback" not in errors
