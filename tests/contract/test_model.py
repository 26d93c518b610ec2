"""The outbox against a model of thirty lines: what was acknowledged, and what the cloud has.

Senders post through the service, under keys of their own, and again when they got no answer. The
uplink's decisions and its writer are the real ones; the cloud is a list. A kill forgets everything
but the database and the cloud; the wall clock jumps as it likes; the disk is full for a while.
"""

import shutil
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from sqlalchemy import event
from sqlalchemy.exc import OperationalError

from afarcloud.state import Report
from afarcloud.wire import Kind, read
from edge_server.config import Config
from edge_server.outbox import queue
from edge_server.outbox.answers import Answer, Reply, Unreachable, classify
from edge_server.outbox.queue import Stream
from edge_server.outbox.result_writer import RecordResult, ResultWriter
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import Batch, Schedule
from edge_server.outbox.uplink import BatchLimit
from edge_server.process.preparation import open_database, prepare
from edge_server.services.context import Caller, Context
from edge_server.services.errors import FullError
from edge_server.services.reports import telemetry
from edge_server.store.connection.failures import is_full
from tests.support.databases import PostgresServer
from tests.unit.edge_server import documents

STREAMS = (Stream(1, "pose"), Stream(1, "alarm"), Stream(2, "battery"))
GOOD = Answer(200, "application/json", b"{}")
LOST = Unreachable("the answer was lost")
FAILURES = (Answer(500), Answer(429, retry_after_s=2.0), Answer(401), LOST)
READ_AHEAD = 3


class Model:
    """What must be true, computed as simply as possible."""

    def __init__(self) -> None:
        self.acknowledged: dict[Stream, list[str]] = defaultdict(list)  # Message ids, in order
        self.arrived: dict[Stream, list[str]] = defaultdict(list)  # Once per message id
        self.unanswered: set[Stream] = set()  # Stored perhaps; the sender will ask again

    def acknowledge(self, stream: Stream, message_id: str) -> None:
        """The sender has its 201."""
        if message_id not in self.acknowledged[stream]:
            self.acknowledged[stream].append(message_id)
        self.unanswered.discard(stream)

    def arrive(self, stream: Stream, message_id: str) -> None:
        """The cloud has it; a second time changes nothing."""
        if message_id not in self.arrived[stream]:
            self.arrived[stream].append(message_id)

    def holds(self) -> bool:
        """Whether the cloud has the beginning of each stream, in order and nothing else."""
        for stream, arrived in self.arrived.items():
            known = self.acknowledged[stream]
            beyond = arrived[len(known) :]
            if arrived[: len(known)] != known[: len(arrived)]:
                return False
            if len(beyond) > (stream in self.unanswered):
                return False
        return True


class OutboxAgainstModel(RuleBasedStateMachine):
    """Ingest, answers, lost answers, kills, a full disk, a jumping clock."""

    template: ClassVar[Path]

    @initialize()
    def begin(self) -> None:
        self._folder = TemporaryDirectory()
        self._config = self._make_config(Path(self._folder.name) / "state")
        self.model = Model()
        self._numbers: dict[Stream, int] = defaultdict(int)
        self._wall_s = 1_795_262_400.0
        self._now_s = 0.0
        self._disk_is_full = False
        self._start()

    def _make_config(self, state_dir: Path) -> Config:
        shutil.copytree(self.template, state_dir)
        return Config(state_dir=state_dir)

    def _start(self) -> None:
        self._database = open_database(self._config)
        event.listen(self._database.engine, "checkout", self._limit)
        self._context = Context(self._config, self._database, lambda: self._wall_s)
        self._schedule = Schedule(
            backoff=Backoff(1.0, 10.0), probe_interval_s=5.0, workers=3, random=Random(1)
        )
        self._writer = ResultWriter(self._database)
        self._flying: list[Batch] = []
        self._newest_row = 0

    def _limit(self, connection: Any, _record: object, _proxy: object) -> None:
        """Let the database grow no more while the disk is full."""
        pages = connection.execute("PRAGMA page_count").fetchone()[0]
        most = pages if self._disk_is_full else 1_000_000
        connection.execute(f"PRAGMA max_page_count={most}").close()

    @rule(stream=st.sampled_from(STREAMS), again=st.booleans(), killed=st.booleans())
    def post(self, stream: Stream, *, again: bool, killed: bool) -> None:
        """Post the next report, or once more the last one; perhaps the answer gets lost."""
        if self._numbers[stream] == 0 or not (again or stream in self.model.unanswered):
            self._numbers[stream] += 1
        known = len(self.model.acknowledged[stream])
        is_new = self._numbers[stream] > known
        message_id = self._ingest(stream, self._numbers[stream])
        if message_id is None:
            self._numbers[stream] -= is_new and stream not in self.model.unanswered
        elif killed:
            if is_new:
                self.model.unanswered.add(stream)
            self.kill()
        else:
            self.model.acknowledge(stream, message_id)
            assert len(self.model.acknowledged[stream]) == self._numbers[stream]

    def _ingest(self, stream: Stream, number: int) -> str | None:
        report = read(
            Kind(stream.kind), documents.telemetry(stream.kind, number, stream.vehicle_id)
        )
        assert isinstance(report, Report)
        caller = Caller("broker", f"{stream.kind}-{stream.vehicle_id}-{number}")
        try:
            stored = telemetry.ingest(self._context, Kind(stream.kind), report, caller)
        except FullError:
            return None
        except OperationalError as error:
            if not is_full(error):
                raise
            return None
        return str(stored["message_id"])

    @rule()
    def look_and_send(self) -> None:
        with self._database.read() as connection:
            streams, self._newest_row = queue.streams_after(connection, self._newest_row)
            self._schedule.announce(streams)
            for stream, after_id, _ in self._schedule.to_read():
                records = queue.read_queued(connection, stream, after_id, READ_AHEAD)
                self._schedule.feed(stream, records, READ_AHEAD)
        self._flying += self._schedule.take(self._now_s, BatchLimit(4, 10_000))

    @precondition(lambda self: self._flying)
    @rule(data=st.data(), answered=st.booleans())
    def the_cloud_stores(self, data: Any, *, answered: bool) -> None:
        """It stores; its answer comes, or we have given up waiting for it."""
        batch: Batch = data.draw(st.sampled_from(self._flying))
        self._deliver(batch, GOOD if answered else LOST)

    @precondition(lambda self: self._flying)
    @rule(data=st.data(), failure=st.sampled_from(FAILURES))
    def the_cloud_does_not_store(self, data: Any, failure: Reply) -> None:
        self._take_answer(data.draw(st.sampled_from(self._flying)), failure)

    def _deliver(self, batch: Batch, reply: Reply) -> None:
        for record in batch.records:
            self.model.arrive(record.stream, record.message_id)
        self._take_answer(batch, reply)

    def _take_answer(self, batch: Batch, reply: Reply) -> None:
        self._flying.remove(batch)
        results = [classify(reply)] * len(batch.records)
        triggers = self._schedule.settle(batch, results, self._now_s)
        for entry in map(RecordResult, batch.records, triggers, results):
            self._writer.add(entry, self._now_s)

    @rule()
    def write_what_was_answered(self) -> None:
        self._writer.write(self._now_s, self._wall_s)

    @rule()
    def kill(self) -> None:
        self._database.close()
        self._start()

    @rule(full=st.booleans())
    def fill_or_free_the_disk(self, *, full: bool) -> None:
        self._disk_is_full = full

    @rule(seconds=st.floats(-1e9, 1e9))
    def jump_the_clock(self, seconds: float) -> None:
        self._wall_s = max(self._wall_s + seconds, 0.0)

    @rule(seconds=st.floats(0.0, 30.0))
    def wait(self, seconds: float) -> None:
        self._now_s += seconds
        self._wall_s += seconds

    @invariant()
    def the_model_holds(self) -> None:
        if hasattr(self, "model"):
            assert self.model.holds(), (self.model.acknowledged, self.model.arrived)

    def teardown(self) -> None:
        """The disk is free, the senders ask again, the cloud behaves: everything arrives."""
        if not hasattr(self, "_database"):
            return
        self._disk_is_full = False
        for stream in list(self.model.unanswered):
            message_id = self._ingest(stream, self._numbers[stream])
            assert message_id is not None
            self.model.acknowledge(stream, message_id)
        for _ in range(10 * sum(self._numbers.values()) + 10):
            self._now_s += 20.0
            self.look_and_send()
            for batch in list(self._flying):
                self._deliver(batch, GOOD)
            self.write_what_was_answered()
        assert self.model.arrived == {s: ids for s, ids in self.model.acknowledged.items() if ids}
        with self._database.read() as connection:
            assert all(queue.read_queued(connection, stream, 0, 1) == [] for stream in STREAMS)
        self._database.close()
        self._folder.cleanup()


class OnPostgresql(OutboxAgainstModel):
    """The same on the other engine, whose disk is its own affair."""

    server: ClassVar[PostgresServer]
    name: ClassVar[str]

    def _make_config(self, state_dir: Path) -> Config:
        shutil.copytree(self.template, state_dir)
        self.server.renew(self.name)
        return Config(state_dir=state_dir, database_url=self.server.url(self.name))

    _limit: Callable[..., None] = staticmethod(lambda *_: None)


@pytest.fixture(scope="module", autouse=True)
def _places(
    tmp_path_factory: pytest.TempPathFactory, postgres: PostgresServer, empty_on_postgres: str
) -> None:
    template = tmp_path_factory.mktemp("template") / "state"
    prepare(Config(state_dir=template))
    OutboxAgainstModel.template = template
    OnPostgresql.server = postgres
    OnPostgresql.name = empty_on_postgres


OutboxAgainstModel.TestCase.settings = settings(
    max_examples=25, stateful_step_count=40, deadline=None
)
TestOutboxAgainstModel = OutboxAgainstModel.TestCase
OnPostgresql.TestCase.settings = settings(max_examples=8, stateful_step_count=40, deadline=None)
TestOnPostgresql = OnPostgresql.TestCase
