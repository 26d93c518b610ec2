"""The promise as a state machine: whatever cloud, clock and crashes do, order and effect hold.

The database and the decisions are the real ones; the cloud is a list. Its effect is what it has
kept once per key; a crash forgets everything but the database and the cloud. On a disk that fills
the oldest poses go, each in a gap that reaches the cloud too.
"""

import json
from collections import defaultdict
from collections.abc import Collection
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from sqlalchemy import text

from edge_server.outbox import gaps, queue, thinning
from edge_server.outbox.answers import Answer, Reply, Unreachable, classify
from edge_server.outbox.queue import OutboxRecord, Stream
from edge_server.outbox.result_writer import RecordResult, ResultWriter
from edge_server.outbox.retry import Backoff
from edge_server.outbox.schedule import Batch, Schedule
from edge_server.outbox.uplink import HELD_BACK, BatchLimit
from edge_server.store.connection.database import Database
from edge_server.store.connection.engines import open_engine, sqlite_url
from edge_server.store.rows import telemetry
from edge_server.store.rows.tables import METADATA
from tests.support.databases import PostgresServer

STREAMS = st.sampled_from(
    [Stream(1, "pose"), Stream(2, "pose"), Stream(1, "alarm"), Stream(1, "image")]
)
GOOD = Answer(200, "application/json", b"{}")
FAILURES = st.sampled_from(
    [
        Answer(500),
        Answer(429, retry_after_s=2.0),
        Answer(202),
        Answer(302),
        Answer(401),
        Answer(200, "text/html", b"<html>"),
        Unreachable("refused"),
    ]
)


class Promise(RuleBasedStateMachine):
    """Ingest, answers good and bad, lost answers, crashes, a full disk, a clock that jumps."""

    @initialize()
    def begin(self) -> None:
        self._folder = TemporaryDirectory()
        self._database = Database(open_engine(self._place()))
        self._numbers = 0
        self._now = 0.0
        self._sent: dict[Stream, list[str]] = defaultdict(list)
        self._effect: dict[Stream, list[str]] = defaultdict(list)
        self._rejected: set[str] = set()
        self._dropped = 0
        self._wall_clock = 0.0
        self._gaps: dict[str, dict[str, Any]] = {}  # As the cloud has them
        self._restart()

    def _place(self) -> str:
        """URL of an empty database with our tables."""
        url = sqlite_url(Path(self._folder.name) / "edge.sqlite3")
        engine = open_engine(url)
        METADATA.create_all(engine)
        engine.dispose()
        return url

    def _restart(self) -> None:
        self._schedule = Schedule(
            backoff=Backoff(1.0, 10.0), probe_interval_s=5.0, workers=3, random=Random(1)
        )
        self._flying: list[Batch] = []
        self._seen_row = 0

    @rule(stream=STREAMS)
    def ingest(self, stream: Stream) -> None:
        self._numbers += 1
        message_id = f"{self._numbers:026d}"
        with self._database.write() as connection:
            record_id = telemetry.add(
                connection,
                kind=stream.kind,
                vehicle_id=stream.vehicle_id,
                message_id=message_id,
                payload="{}",
                received_at=0.0,
            )
            queue.enqueue(connection, record_id, stream)
        self._sent[stream].append(message_id)

    @rule()
    def look_and_send(self) -> None:
        with self._database.read() as connection:
            streams, self._seen_row = queue.streams_after(connection, self._seen_row)
            self._schedule.announce(streams)
            for stream, after_id, _ in self._schedule.to_read():
                records = queue.read_queued(connection, stream, after_id, 3)
                self._schedule.feed(stream, records, 3)
        self._flying += self._schedule.take(self._now, BatchLimit(4, 10_000))

    @precondition(lambda self: self._flying)
    @rule(data=st.data(), stored=st.booleans(), crash=st.booleans())
    def answer_well_or_lose_the_answer(self, data: Any, *, stored: bool, crash: bool) -> None:
        batch = self._pick(data)
        for record in batch.records:
            self._keep(record)
        if crash:
            self._restart()
        else:
            reply = GOOD if stored else Unreachable("answer lost")
            self._settle(batch, [reply] * len(batch.records))

    @precondition(lambda self: self._flying)
    @rule(data=st.data(), failure=FAILURES)
    def answer_badly(self, data: Any, failure: Reply) -> None:
        batch = self._pick(data)
        self._settle(batch, [failure] * len(batch.records))

    @precondition(lambda self: self._flying)
    @rule(data=st.data(), failure=FAILURES)
    def take_a_part_of_it(self, data: Any, failure: Reply) -> None:
        batch = self._pick(data)
        failing = data.draw(st.integers(0, len(batch.records) - 1))
        replies: list[Reply] = []
        for number, record in enumerate(batch.records):
            if number == failing:
                replies.append(failure)
            elif number > failing and record.stream == batch.records[failing].stream:
                replies.append(HELD_BACK)
            else:
                self._keep(record)
                replies.append(GOOD)
        self._settle(batch, replies)

    @precondition(lambda self: self._flying)
    @rule(data=st.data())
    def reject(self, data: Any) -> None:
        batch = self._pick(data)
        if all(p.message_id not in self._effect[p.stream] for p in batch.records):
            self._rejected.update(record.message_id for record in batch.records)
            self._settle(batch, [Answer(422)] * len(batch.records))

    @rule()
    def crash(self) -> None:
        self._restart()

    @rule(most=st.integers(1, 5))
    def fill_the_disk(self, most: int) -> None:
        with self._database.write() as connection:
            going = thinning.oldest(connection, most)
            gone = gaps.drop(connection, going, gaps.Reason.BUDGET, 0.0)
        self._dropped += sum(gone.values())
        self._schedule.rewind()

    @rule(seconds=st.floats(-1e9, 1e9))
    def set_the_clock(self, seconds: float) -> None:
        self._wall_clock += seconds

    @rule(seconds=st.floats(0.0, 30.0))
    def wait(self, seconds: float) -> None:
        self._now += seconds

    def _pick(self, data: Any) -> Batch:
        batch: Batch = data.draw(st.sampled_from(self._flying))
        return batch

    def _keep(self, record: OutboxRecord) -> None:
        kept = self._effect[record.stream]
        if record.message_id not in kept:
            kept.append(record.message_id)
            if record.stream.kind == "gap":
                body = json.loads(record.payload)
                self._gaps[body["gap_id"]] = body

    def _settle(self, batch: Batch, replies: list[Reply]) -> None:
        self._flying.remove(batch)
        results = [classify(reply) for reply in replies]
        triggers = self._schedule.settle(batch, results, self._now)
        writer = ResultWriter(self._database)
        for entry in map(RecordResult, batch.records, triggers, results):
            writer.add(entry, self._now)
        if writer.write(self._now, self._wall_clock):
            self._schedule.rewind()

    def _here(self) -> dict[str, str]:
        """Payloads in the database by message_id."""
        with self._database.read() as connection:
            rows = connection.execute(text("SELECT message_id, payload FROM telemetry"))
            return {row[0]: row[1] for row in rows}

    def _lost(self, stream: Stream, here: Collection[str]) -> set[str]:
        """What was dropped; one that was on its way just then may have arrived nonetheless."""
        return set(self._sent[stream]) - set(here) - set(self._effect[stream])

    def _expected(self, stream: Stream) -> list[str]:
        gone = self._rejected | self._lost(stream, self._here())
        return [key for key in self._sent[stream] if key not in gone]

    @invariant()
    def the_cloud_has_the_beginning_of_each_stream_in_order(self) -> None:
        for stream in getattr(self, "_sent", {}):
            kept = self._effect[stream]
            assert kept == self._expected(stream)[: len(kept)]

    @invariant()
    def what_is_lost_is_declared(self) -> None:
        if not hasattr(self, "_database"):
            return
        here = self._here()
        bodies = [json.loads(payload) for payload in here.values()]
        gaps = self._gaps | {body["gap_id"]: body for body in bodies if "gap_id" in body}
        assert sum(gap["count"] for gap in gaps.values()) == self._dropped
        for stream in self._sent:
            for key in self._lost(stream, here) - self._rejected:
                name = f"{stream.vehicle_id}/{stream.kind}"
                assert any(
                    gap["from_message_id"] <= key <= gap["to_message_id"]
                    for gap in gaps.values()
                    if gap["stream"] == name
                )

    def teardown(self) -> None:
        """When the cloud behaves at last, everything arrives."""
        if not hasattr(self, "_database"):
            return
        for _ in range(10 * (self._numbers + self._dropped) + 10):
            self._now += 20.0
            self.look_and_send()
            for batch in list(self._flying):
                for record in batch.records:
                    self._keep(record)
                self._settle(batch, [GOOD] * len(batch.records))
        for stream in self._sent:
            assert self._effect[stream] == self._expected(stream)
        self._database.close()
        self._folder.cleanup()


class PromiseOnPostgresql(Promise):
    """The same promise on the other engine."""

    server: ClassVar[PostgresServer]
    name: ClassVar[str]

    def _place(self) -> str:
        self.server.renew(self.name)
        return self.server.url(self.name)


@pytest.fixture(scope="module", autouse=True)
def _server(postgres: PostgresServer, empty_on_postgres: str) -> None:
    PromiseOnPostgresql.server = postgres
    PromiseOnPostgresql.name = empty_on_postgres


Promise.TestCase.settings = settings(max_examples=25, stateful_step_count=40, deadline=None)
TestPromise = Promise.TestCase
PromiseOnPostgresql.TestCase.settings = settings(
    max_examples=10, stateful_step_count=40, deadline=None
)
TestPromiseOnPostgresql = PromiseOnPostgresql.TestCase
