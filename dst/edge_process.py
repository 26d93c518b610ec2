"""The real edge server and its relay, without threads: WSGI called in process, SQLite on a disk."""

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final, NamedTuple

from sqlalchemy.exc import SQLAlchemyError

from dst import http_wire
from dst.scheduler import Event, Scheduler
from edge_server.app import context_of, create_app
from edge_server.config import Config
from edge_server.outbox import wakeup
from edge_server.outbox.answers import Reply
from edge_server.outbox.queue import OutboxRecord
from edge_server.outbox.relay import Relay
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import Schedule
from edge_server.outbox.streams import AllStreams
from edge_server.outbox.uplink import BatchLimit
from edge_server.process import key_files
from edge_server.process.preparation import prepare
from edge_server.services.fleet import broker_work
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine
from edge_server.store.rows.keys import Role
from edge_server.uplinks.cloud_http import HttpUplink

BATCH_SHARE: Final = 0.5
"""Of the clouds that take many records in one request."""
RELAY_PERIOD_S: Final = 2.0
RELAY_LOOK_S: Final = 120.0
"""How often the relay looks for records while nobody writes any and none is due."""
HOUSEKEEPING_S: Final = 5.0
BREAK_HOUSEKEEPING_S: Final = 120.0
"""While every vehicle is switched off."""


class Response(NamedTuple):
    """An answer of the edge server."""

    status: int
    body: bytes

    def json(self) -> Any:
        """The body."""
        return json.loads(self.body)


class EdgeDownError(ConnectionError):
    """Nothing listens at the edge server's port."""


def prepared_folder(folder: Path) -> Path:
    """Make a state folder with an empty database and keys, to be copied for each world."""
    prepare(Config(state_dir=folder))
    return folder


class EdgeProcess:
    """The edge server's process; killed and started at any time, its state folder stays."""

    def __init__(self, scheduler: Scheduler, prepared: Path, folder: Path) -> None:
        """Copy a prepared state folder and start."""
        shutil.copytree(prepared, folder)
        self.config = Config(state_dir=folder)
        self._scheduler = scheduler
        self._keys = {
            role.value: key_files.read(key_files.path_of(self.config.keys_dir, role))
            for role in Role
        }
        self._client: Any = None
        self._context: Any = None
        self._generation = 0
        self.housekeeping_s = HOUSEKEEPING_S
        self.on_write: Callable[[], None] = lambda: None
        """Called when a request that may write was served."""
        self.start()

    @property
    def is_up(self) -> bool:
        """Whether it runs."""
        return self._client is not None

    @property
    def work_count(self) -> int:
        """A number that changes with new work; a long poll waits for it."""
        return self._context.work_signal.count if self.is_up else -1

    def start(self) -> None:
        """Start on what is on the disk."""
        app = create_app(self.config, clock=self._scheduler.epoch_s)
        self._context = context_of(app)
        self._client = app.test_client()
        self._generation += 1
        self._keep_house(self._generation)

    def kill(self) -> None:
        """Lose everything that is not on the disk."""
        self._context.database.close()
        self._client = self._context = None

    def request(
        self,
        method: str,
        path: str,
        role: str,
        body: Any = None,
        headers: Mapping[str, str] | None = None,
    ) -> Response:
        """Serve one request.

        Raises:
            EdgeDownError: if it does not run.
        """
        if self._client is None:
            raise EdgeDownError("connection refused")
        all_headers = {"Authorization": f"Bearer {self._keys[role]}", **(headers or {})}
        answer = self._client.open(path, method=method, headers=all_headers, json=body)
        if method != "GET":
            self.on_write()
        return Response(answer.status_code, answer.data)

    def _keep_house(self, generation: int) -> None:
        """Run the periodic tasks of this start of the process."""
        if generation == self._generation and self.is_up:
            broker_work.expire_if_due(self._context)
            self._context.space.maintain(self._scheduler.monotonic())
            self._scheduler.after(self.housekeeping_s, lambda: self._keep_house(generation))


class Cloud:
    """A mock cloud behind the real uplink, and a network that may lose requests and answers."""

    def __init__(self, scheduler: Scheduler, config: Config) -> None:
        self._scheduler = scheduler
        self._random = scheduler.random("cloud")
        self._uplink = HttpUplink(config, monotonic=scheduler.monotonic)
        self._accepts_batches = scheduler.random("cloud batches").random() < BATCH_SHARE
        self._sent: dict[str, OutboxRecord] = {}  # By message id: what the uplink is sending
        self.is_up = True
        self.request_loss = 0.0
        self.answer_loss = 0.0
        self.received: dict[str, OutboxRecord] = {}
        """By message id."""

    def batch_limit(self) -> BatchLimit:
        """What the cloud has stated."""
        return self._uplink.batch_limit()

    def send(self, records: Sequence[OutboxRecord]) -> list[Reply]:
        """Send records."""
        self._sent = {record.message_id: record for record in records}
        with http_wire.serving(self._serve):
            return self._uplink.send(records)

    def close(self) -> None:
        """Close the uplink's connections."""
        self._uplink.close()

    def _serve(self, request: bytes) -> tuple[bytes, bool]:
        """Take a record, or many, and answer."""
        random = self._random
        if not self.is_up or random.random() < self.request_loss:
            raise ConnectionRefusedError(111, "Connection refused")
        head, _, body = request.partition(b"\r\n\r\n")
        is_batch = head.split(b" ", 2)[1].endswith(b"/batch")
        lines = [json.loads(line) for line in body.splitlines()] if is_batch else []
        ids = [line["record"]["message_id"] for line in lines]
        if not is_batch:
            ids = [one for one in self._sent if one.encode() in head]
        for message_id in ids:
            record = self._sent[message_id]
            self._scheduler.note("relay", "cloud", f"{record.stream.kind} {record.record_id}")
            self.received.setdefault(message_id, record)
        results = [{"message_id": one, "status": int(HTTPStatus.OK)} for one in ids]
        document = {"results": results} if is_batch else {}
        headers = {"Accept-Batch": "20"} if self._accepts_batches else {}
        answer = http_wire.answer_bytes(HTTPStatus.OK, json.dumps(document).encode(), headers)
        if random.random() < self.answer_loss:
            return http_wire.broken(answer, random)
        return answer, False


class RelayProcess:
    """The relay's process, stepped by the scheduler."""

    def __init__(self, scheduler: Scheduler, config: Config, cloud: Cloud) -> None:
        """Start."""
        self._scheduler = scheduler
        self._config = config
        self._cloud = cloud
        self._close: Callable[[], None] = lambda: None
        self._relay: Relay | None = None
        self._starts = 0
        self._next: Event | None = None
        self.start()

    @property
    def is_up(self) -> bool:
        """Whether it runs."""
        return self._relay is not None

    def start(self) -> None:
        """Start on what is on the disk."""
        self._starts += 1
        config = self._config
        database = Database(open_engine(config.database))
        schedule = Schedule(
            backoff=Backoff(config.backoff_base_s, config.backoff_cap_s),
            probe_interval_s=config.probe_interval_s,
            workers=config.relay_workers,
            random=self._scheduler.random(f"relay/{self._starts}"),
        )
        relay = self._relay = Relay(
            database=database,
            schedule=schedule,
            uplink=self._cloud,
            streams=AllStreams(database, config.database_path),
            wake=wakeup.open_for_reading(config.wake_path),
            workers=0,
            wall_clock=self._scheduler.epoch_s,
        )

        def close() -> None:
            relay.close()
            database.close()

        self._close = close
        self.wake()

    def wake(self) -> None:
        """Have it look for new records soon."""
        self._step_after(RELAY_PERIOD_S)

    def kill(self) -> None:
        """Lose the answers that are not written yet."""
        self._close()
        self._relay = None

    def _step_after(self, delay_s: float) -> None:
        """Be stepped after a delay [s], or before if that is planned already."""
        if self._next is not None:
            if self._next.time_s <= self._scheduler.now_s + delay_s:
                return
            self._next.cancel()
        self._next = self._scheduler.after(delay_s, self._step)

    def _step(self) -> None:
        self._next = None
        if self._relay is None:
            return
        now = self._scheduler.monotonic()
        try:
            self._relay.step(now)
        except SQLAlchemyError as error:
            self._scheduler.note("relay", "-", f"ends: {type(error).__name__}")
            self.kill()
            self._scheduler.after(1.0, self.start)
            return
        due = self._relay.next_due(now)
        self._step_after(RELAY_LOOK_S if due is None else max(RELAY_PERIOD_S, due - now))
