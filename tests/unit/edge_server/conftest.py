"""An edge server without a network: the application, a fake clock, keys of all roles."""

import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from argon2 import PasswordHasher
from flask.testing import FlaskClient
from sqlalchemy import text
from werkzeug.test import TestResponse

from edge_server.app import close, context_of, create_app
from edge_server.config import Config
from edge_server.process import key_files
from edge_server.process.preparation import prepare
from edge_server.services.administration import passwords
from edge_server.services.context import Context
from edge_server.store.rows.keys import Role
from tests.support.databases import PostgresServer
from tests.unit.edge_server import signing

NOON = 1_795_262_400.0  # 2026-11-21T12:00:00Z
CLOUD_JWS = "cloud-jws.json"


class Clock:
    """Epoch seconds that pass by `pass_s` only; who sets `now` sets the clock, in no time."""

    def __init__(self, now: float = NOON) -> None:
        self.now = now
        self._passed_s = 0.0

    def __call__(self) -> float:
        return self.now

    def monotonic(self) -> float:
        return time.monotonic() + self._passed_s

    def pass_s(self, seconds: float) -> None:
        self.now += seconds
        self._passed_s += seconds


class Edge:
    """Requests of a test to the edge server."""

    def __init__(self, client: FlaskClient, context: Context, clock: Clock) -> None:
        self.client = client
        self.context = context
        self.clock = clock
        self.config = context.config
        self._keys = {
            role: key_files.read(key_files.path_of(self.config.keys_dir, role)) for role in Role
        }

    def key(self, role: str) -> str:
        key = self._keys[Role(role)]
        assert key is not None
        return key

    def ask(self, method: str, path: str, role: str | None, **options: Any) -> TestResponse:
        headers = dict(options.pop("headers", {}))
        if role is not None:
            headers["Authorization"] = f"Bearer {self.key(role)}"
        if role == "cloud" and method != "GET" and path.startswith(("/plan", "/event")):
            self._sign(path, headers, options)
        return self.client.open(path, method=method, headers=headers, **options)

    def _sign(self, path: str, headers: dict[str, Any], options: dict[str, Any]) -> None:
        """Sign as the cloud does, unless the test sets the signature (None: without one)."""
        if "json" in options:
            options["data"] = json.dumps(options.pop("json"))
            options["content_type"] = "application/json"
        body = str(options.get("data", "")).encode()
        header = signing.claims(self.clock(), htu=path.partition("?")[0])
        headers.setdefault("X-JWS-Signature", signing.sign(body, header))
        if headers["X-JWS-Signature"] is None:
            del headers["X-JWS-Signature"]

    def get(self, path: str, role: str = "operator") -> Any:
        return self.ask("GET", path, role).json

    def post(self, path: str, body: Any, role: str, key: str | None = None) -> TestResponse:
        headers = {"Idempotency-Key": key} if key else {}
        return self.ask("POST", path, role, json=body, headers=headers)

    def post_plan(self, body: Any, key: str | None = None) -> TestResponse:
        return self.post("/plans/", body, "operator", key)

    def report(self, kind: str, body: Any, key: str | None = None) -> TestResponse:
        return self.post(f"/{kind}/", body, "broker", key)

    def register(self, *vehicle_ids: int) -> None:
        for vehicle_id in vehicle_ids:
            path = f"/vehicles/{vehicle_id}"
            answer = self.ask("PUT", path, "broker", json={"link_state": "connected"})
            assert answer.status_code in {200, 201}

    def work(self, after: int = 0) -> list[dict[str, Any]]:
        answer = self.get(f"/broker/commands?after={after}", "broker")
        commands: list[dict[str, Any]] = answer["commands"]
        return commands

    def accept(self) -> None:
        """Accept every mission that is handed out, as the broker does when its turn comes."""
        for item in self.work():
            if item["kind"] == "mission" and item["state"] == "queued":
                assert self.acknowledge(item["id"], "accepted").status_code == 200

    def acknowledge(
        self, identifier: int, status: str, message: str | None = None, **more: str
    ) -> TestResponse:
        body = {"status": status, **more} | ({"message": message} if message else {})
        return self.post(f"/broker/commands/{identifier}/ack", body, "broker")

    def count(self, table: str) -> int:
        with self.context.database.read() as connection:
            return int(connection.execute(text(f"SELECT count(*) FROM {table}")).scalar_one())


@pytest.fixture(autouse=True, scope="session")
def quick_hashes() -> Iterator[None]:
    """Hash the passwords of tests with the least effort; how a hash is used is the same."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(passwords, "_HASHER", PasswordHasher(1, 64, 1))
        yield


@pytest.fixture
def engine_name(request: pytest.FixtureRequest) -> str:
    """The kind of database: SQLite, unless a module or a test is marked with `BOTH_ENGINES`.

    HTTP and decisions are the same on every database; what rests on transactions is so marked.
    """
    return str(getattr(request, "param", "sqlite"))


@pytest.fixture(scope="session")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A state folder with an empty database and keys, to be copied."""
    folder = tmp_path_factory.mktemp("prepared")
    prepare(Config(state_dir=folder))
    signing_key = folder / CLOUD_JWS
    signing_key.write_text(json.dumps(signing.SECRET_JWK), encoding="ascii")
    signing_key.chmod(0o600)
    return folder


@pytest.fixture(scope="session")
def prepared_on_postgres(prepared: Path, postgres: PostgresServer) -> str:
    """Name of a PostgreSQL database with the keys of that folder."""
    name = postgres.create(name="prepared")
    prepare(Config(state_dir=prepared, database_url=postgres.url(name)))
    postgres.keep(name)
    return name


@pytest.fixture
def config(
    engine_name: str, prepared: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> Iterator[Config]:
    """A configuration with a state folder and a database of its own, once per engine."""
    folder = tmp_path / "state"
    shutil.copytree(prepared, folder)
    if engine_name == "sqlite":
        yield Config(
            state_dir=folder,
            console_dir=tmp_path / "console",
            cloud_jws_key_file=folder / CLOUD_JWS,
        )
        return
    server: PostgresServer = request.getfixturevalue("postgres")
    name = request.getfixturevalue("prepared_on_postgres")
    server.renew(name)
    yield Config(
        state_dir=folder,
        console_dir=tmp_path / "console",
        database_url=server.url(name),
        cloud_jws_key_file=folder / CLOUD_JWS,
    )


@pytest.fixture
def edge(config: Config) -> Iterator[Edge]:
    """An edge server with vehicles 1 and 2."""
    clock = Clock()
    app = create_app(config, clock=clock, monotonic=clock.monotonic)
    context = context_of(app)
    edge = Edge(app.test_client(), context, clock)
    edge.register(1, 2)
    yield edge
    close(app)
