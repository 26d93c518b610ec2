"""The real edge server and its relay, without threads: WSGI called in process, SQLite on a disk."""

import io
import json
import shutil
import sqlite3
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, suppress
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final, NamedTuple

from sqlalchemy import select
from sqlalchemy.exc import DBAPIError, SQLAlchemyError

from dst.scheduler import Clock, Event, Scheduler
from dst.world import http_wire
from dst.world.disk import Disk
from dst.world.memory import held_bytes
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
from edge_server.store.migrate import StoreError
from edge_server.store.rows.keys import Role
from edge_server.store.rows.tables import event, work
from edge_server.uplinks.cloud_http import HttpUplink

BATCH_SHARE: Final = 0.5
"""Of the clouds that take many records in one request."""
RELAY_PERIOD_S: Final = 2.0
RELAY_LOOK_S: Final = 120.0
"""How often the relay looks for records while nobody writes any and none is due."""
HOUSEKEEPING_S: Final = 5.0
RESTART_S: Final = 1.0
"""After which a process is started again that has ended by itself."""
BREAK_HOUSEKEEPING_S: Final = 120.0
"""While every vehicle is switched off."""


def _nothing() -> None:
    """Do nothing."""


_STATES: Final = select(
    event.c.id, work.c.plan, work.c.id, work.c.state, work.c.status_id, work.c.message
).select_from(work.outerjoin(event))


class Response(NamedTuple):
    """An answer of the edge server."""

    status: int
    body: bytes

    def json(self) -> Any:
        """The body."""
        return json.loads(self.body)


def _call(app: Any, method: str, path: str, headers: Mapping[str, str], body: Any) -> Response:
    """Call a WSGI application as a server does, with a body as JSON; None is no body."""
    data = b"" if body is None else json.dumps(body).encode()
    path, _, query = path.partition("?")
    environ = {
        "REQUEST_METHOD": method,
        "SCRIPT_NAME": "",
        "PATH_INFO": path,
        "QUERY_STRING": query,
        "SERVER_NAME": "edge",
        "SERVER_PORT": "8000",
        "SERVER_PROTOCOL": "HTTP/1.1",
        "REMOTE_ADDR": "192.0.2.2",
        "CONTENT_TYPE": "" if body is None else "application/json",
        "CONTENT_LENGTH": str(len(data)),
        **{f"HTTP_{name.upper().replace('-', '_')}": text for name, text in headers.items()},
        "wsgi.version": (1, 0),
        "wsgi.url_scheme": "http",
        "wsgi.input": io.BytesIO(data),
        "wsgi.errors": sys.stderr,
        "wsgi.multithread": False,
        "wsgi.multiprocess": False,
        "wsgi.run_once": False,
    }
    started: list[str] = []
    answer: Any = app(environ, lambda status, _headers, _failure=None: started.append(status))
    with closing(answer):
        content = b"".join(answer)
    return Response(int(started[-1].partition(" ")[0]), content)


class EdgeDownError(ConnectionError):
    """Nothing listens at the edge server's port."""


def prepared_folder(folder: Path) -> Path:
    """Make a state folder with an empty database and keys, to be copied for each world."""
    prepare(Config(state_dir=folder))
    return folder


class EdgeProcess:
    """The edge server's process; killed and started at any time, its state folder stays."""

    def __init__(
        self, scheduler: Scheduler, prepared: Path, folder: Path, disk: Disk, clock: Clock
    ) -> None:
        """Copy a prepared state folder and start; `disk` has the folder."""
        shutil.copytree(prepared, folder)
        self.config = Config(state_dir=folder)
        self.disk = disk
        self._clock = clock
        self._scheduler = scheduler
        self._keys = {
            role.value: key_files.read(key_files.path_of(self.config.keys_dir, role))
            for role in Role
        }
        self._app: Any = None
        self._context: Any = None
        self._generation = 0
        self.housekeeping_s = HOUSEKEEPING_S
        self.on_write: Callable[[], None] = lambda: None
        """Called when a request that may write was served."""
        self.start()

    @property
    def is_up(self) -> bool:
        """Whether it runs."""
        return self._app is not None

    @property
    def held_bytes(self) -> int:
        """What it holds in memory, without its libraries; 0 if it does not run."""
        return held_bytes([self._context, self._app and self._app.extensions])

    @property
    def work_count(self) -> int:
        """A number that changes with new work; a long poll waits for it."""
        return self._context.work_signal.count if self.is_up else -1

    def states(self) -> dict[str, object]:
        """Give the state of each plan's mission and each event, by its path; none without access.

        It costs a hundredth of the requests, which give the same again while it is equal.
        """
        if self._context is None:
            return {}
        try:
            with self._context.database.read() as connection:
                rows = connection.execute(_STATES).all()
        except SQLAlchemyError:
            return {}
        return {
            f"/events/{event_id}" if plan_id is None else f"/plans/{plan_id}": tuple(state)
            for event_id, plan_id, *state in rows
        }

    def start(self) -> None:
        """Start on what is on the disk; again after a while where that fails."""
        self._generation += 1
        generation = self._generation
        try:
            prepare(self.config)
            clock = self._clock
            app = create_app(self.config, clock=clock.epoch_s, monotonic=clock.monotonic)
        except (DBAPIError, sqlite3.Error, StoreError, OSError) as error:
            self._scheduler.note("edge server", "-", f"does not start: {type(error).__name__}")
            self._scheduler.after(RESTART_S, lambda: self._start_again(generation))
            return
        self._context = context_of(app)
        self._app = app
        self._run_housekeeping(generation)

    def _start_again(self, generation: int) -> None:
        if generation == self._generation:
            self.start()

    def kill(self) -> None:
        """Lose everything that is not on the disk."""
        self._generation += 1
        if self._context is not None:
            self._context.close()  # Else whenever Python collects it
        self._app = self._context = None

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
        if self._app is None:
            raise EdgeDownError("connection refused")
        all_headers = {"Authorization": f"Bearer {self._keys[role]}", **(headers or {})}
        response = _call(self._app, method, path, all_headers, body)
        if self.disk.is_dead:
            raise EdgeDownError("the machine has lost power")
        if method in {"POST", "DELETE"}:  # A PUT updates a vehicle, which no cloud receives
            self.on_write()
        return response

    def _run_housekeeping(self, generation: int) -> None:
        """Run the periodic tasks of this start of the process."""
        if generation == self._generation and self.is_up:
            with suppress(SQLAlchemyError, OSError):  # Retried, as by the program
                broker_work.expire_if_due(self._context)
                self._context.space.maintain(self._clock.monotonic())
            self._scheduler.after(self.housekeeping_s, lambda: self._run_housekeeping(generation))


class Cloud:
    """A mock cloud behind the real uplink, and a network that may lose requests and answers."""

    def __init__(self, scheduler: Scheduler, config: Config, disk: Disk, clock: Clock) -> None:
        """`disk` and `clock` are those of the relay's machine."""
        self._scheduler = scheduler
        self._disk = disk
        self._random = scheduler.random("cloud")
        self._uplink = HttpUplink(config, monotonic=clock.monotonic)
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
        """Store a record, or many, and answer."""
        random = self._random
        if not self.is_up or self._disk.is_dead or random.random() < self.request_loss:
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

    def __init__(self, scheduler: Scheduler, config: Config, cloud: Cloud, clock: Clock) -> None:
        """Start."""
        self._scheduler = scheduler
        self._clock = clock
        self._config = config
        self._cloud = cloud
        self._close: Callable[[], None] = _nothing
        self._relay: Relay | None = None
        self._starts = 0
        self._next: Event | None = None
        self.start()

    @property
    def is_up(self) -> bool:
        """Whether it runs."""
        return self._relay is not None

    def start(self) -> None:
        """Start on what is on the disk; again after a while where that fails."""
        self._starts += 1
        try:
            self._open()
        except (SQLAlchemyError, OSError) as error:
            self._end(error)

    def _open(self) -> None:
        config = self._config
        database = Database(open_engine(config.database))
        self._close = database.close
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
            wall_clock=self._clock.epoch_s,
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
        self._starts += 1
        close, self._close = self._close, _nothing
        close()
        self._relay = None

    def _end(self, error: Exception) -> None:
        """End with an error, and be started again."""
        self._scheduler.note("relay", "-", f"ends: {type(error).__name__}")
        self.kill()
        starts = self._starts
        self._scheduler.after(RESTART_S, lambda: self.start() if self._starts == starts else None)

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
        now = self._clock.monotonic()
        try:
            self._relay.step(now)
        except SQLAlchemyError as error:
            self._end(error)
            return
        due = self._relay.next_due(now)
        self._step_after(RELAY_LOOK_S if due is None else max(RELAY_PERIOD_S, due - now))
