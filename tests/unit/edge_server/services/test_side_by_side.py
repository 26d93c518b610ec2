"""Several servers on one database at the same moment: every rule holds as if there were one.

Each test lets two servers, with connections of their own, do the same thing at once, over and over.
"""

import json
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import pytest
from sqlalchemy import text

from afarcloud.plan import Plan
from afarcloud.state import Report
from afarcloud.wire import Kind, read
from edge_server.config import Config
from edge_server.outbox import queue
from edge_server.outbox.queue import Stream
from edge_server.process.preparation import open_database
from edge_server.services import records
from edge_server.services.context import Caller, Context
from edge_server.services.errors import (
    ChangedError,
    ConflictError,
    KeyReusedError,
    NotFoundError,
)
from edge_server.services.fleet import broker_work, vehicles
from edge_server.services.fleet.broker_work import Acknowledgement
from edge_server.services.fleet.vehicles import VehicleState
from edge_server.services.planning import plans
from edge_server.services.reports import telemetry
from edge_server.services.reports.telemetry import Arrival
from tests.support.databases import BOTH_ENGINES
from tests.support.system import wait_for
from tests.unit.edge_server import documents
from tests.unit.edge_server.conftest import Clock

OPERATOR = Caller("operator")
BROKER = Caller("broker")
ROUNDS = 5


@pytest.fixture
def servers(config: Config) -> Iterator[list[Context]]:
    """Two servers that know vehicle 1, with one clock."""
    clock = Clock()
    contexts = [Context(config, open_database(config), clock) for _ in range(2)]
    vehicles.put(contexts[0], 1, VehicleState(link_state="connected"))
    yield contexts
    for context in contexts:
        context.database.close()


def at_once(
    servers: list[Context], act: Callable[[Context, int], Any], times: int = 1
) -> list[Any]:
    """Let every server act at the same moment, each so many times; gives results and refusals."""
    start = threading.Barrier(len(servers) * times)

    def run(task: tuple[Context, int]) -> Any:
        start.wait()
        try:
            return act(*task)
        except (ConflictError, ChangedError, KeyReusedError) as error:
            return type(error)

    tasks = [(context, number) for number in range(times) for context in servers]
    with ThreadPoolExecutor(len(tasks)) as together:
        return list(together.map(run, tasks))


def plan(mission_id: int = 1) -> Plan:
    found = read(Kind.PLAN, documents.plan(documents.mission(mission_id)))
    assert isinstance(found, Plan)
    return found


def _create(context: Context, _: int, document: Plan) -> Any:
    return plans.create(context, document, OPERATOR)


def _ingest(context: Context, _: int, report: Report, caller: Caller) -> Any:
    return telemetry.ingest(context, Kind.POSE, report, caller)


def pose(number: int) -> Report:
    found = read(Kind.POSE, documents.telemetry("pose", number))
    assert isinstance(found, Report)
    return found


def rows(context: Context, query: str) -> int:
    with context.database.read() as connection:
        return int(connection.execute(text(query)).scalar_one())


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_mission_of_one_name_is_taken_once(servers: list[Context]) -> None:
    for mission_id in range(1, ROUNDS + 1):
        named = plan(mission_id)
        results = at_once(servers, partial(_create, document=named))
        assert results.count(ConflictError) == 1
    assert rows(servers[0], "SELECT count(*) FROM work") == ROUNDS


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_vehicles_queue_is_never_overfilled(servers: list[Context]) -> None:
    limit = servers[0].config.queue_limit
    numbers = iter(range(1, 1000))
    results = at_once(
        servers, lambda c, _: plans.create(c, plan(next(numbers)), OPERATOR), times=limit
    )
    assert results.count(ConflictError) == limit
    assert rows(servers[0], "SELECT count(*) FROM work") == limit


@pytest.mark.first_case
@BOTH_ENGINES
def test_one_idempotency_key_has_one_effect(servers: list[Context]) -> None:
    for number in range(ROUNDS):
        caller = Caller("broker", f"key-{number}")
        results = at_once(servers, partial(_ingest, report=pose(number), caller=caller))
        assert results[0] == results[1]
    assert rows(servers[0], "SELECT count(*) FROM telemetry") == ROUNDS


@pytest.mark.first_case
@BOTH_ENGINES
def test_one_key_for_two_records_is_one_record_and_one_refusal(servers: list[Context]) -> None:
    for number in range(ROUNDS):
        bodies = {id(context): index for index, context in enumerate(servers)}

        def send(context: Context, _: int, n: int = number, of: dict[int, int] = bodies) -> Any:
            kind = (Kind.POSE, Kind.BATTERY)[of[id(context)]]
            report = read(kind, documents.telemetry(kind.value, n))
            assert isinstance(report, Report)
            return telemetry.ingest(context, kind, report, Caller("broker", f"key-{n}"))

        assert at_once(servers, send).count(KeyReusedError) == 1


@BOTH_ENGINES
def test_a_batch_that_comes_twice_at_once_is_kept_once(servers: list[Context]) -> None:
    arrivals = [Arrival(Kind.POSE, pose(number), f"key-{number}") for number in range(20)]
    forwards, backwards = at_once(
        servers,
        lambda context, _: telemetry.ingest_all(
            context, arrivals if context is servers[0] else arrivals[::-1], "broker"
        ),
    )
    assert forwards == backwards[::-1]
    assert rows(servers[0], "SELECT count(*) FROM telemetry") == len(arrivals)


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_mission_is_either_taken_or_cancelled(servers: list[Context]) -> None:
    for mission_id in range(1, ROUNDS + 1):
        stored = plans.create(servers[0], plan(mission_id), OPERATOR)
        (item,) = broker_work.poll(servers[0], 0, 0.0, "broker")["commands"]

        def act(
            context: Context, _: int, plan_id: int = stored["id"], work_id: int = item["id"]
        ) -> Any:
            if context is servers[0]:
                return plans.remove(context, plan_id)
            try:
                return broker_work.acknowledge(context, work_id, Acknowledgement.ACCEPTED, None)[
                    "state"
                ]
            except NotFoundError:
                return ConflictError

        results = at_once(servers, act)
        assert results.count(ConflictError) == 1
        if "accepted" in results:
            broker_work.acknowledge(servers[0], item["id"], Acknowledgement.REFUSED, "done")


@pytest.mark.first_case
@BOTH_ENGINES
def test_an_end_that_is_reported_twice_at_once_is_told_once(servers: list[Context]) -> None:
    for mission_id in range(1, ROUNDS + 1):
        plans.create(servers[0], plan(mission_id), OPERATOR)
        item = broker_work.poll(servers[0], 0, 0.0, BROKER.broker)["commands"][-1]
        broker_work.acknowledge(servers[0], item["id"], Acknowledgement.ACCEPTED, None)
        body = documents.mission_report(3, 3, 3, 3, mission_id=mission_id, work_id=item["id"])
        report = read(Kind.MISSION_REPORT, body)
        assert isinstance(report, Report)

        def send(context: Context, number: int, said: Report = report) -> Any:
            if number == 0:
                return telemetry.ingest(context, Kind.MISSION_REPORT, said, BROKER)["message_id"]
            arrival = Arrival(Kind.MISSION_REPORT, said, None)
            (answer,) = telemetry.ingest_all(context, [arrival], BROKER.owner)
            return answer["message_id"] if isinstance(answer, dict) else answer

        assert len(set(at_once(servers, send, times=2))) == 1
    assert rows(servers[0], "SELECT count(*) FROM outbox") == ROUNDS


@pytest.mark.first_case
@BOTH_ENGINES
def test_what_expires_is_told_once(servers: list[Context]) -> None:
    plans.create(servers[0], plan(), OPERATOR)
    clock = servers[0].clock
    assert isinstance(clock, Clock)
    clock.pass_s(servers[0].config.plan_lifetime_s + 1)
    at_once(servers, lambda context, _: broker_work.expire_if_due(context), times=3)
    assert rows(servers[0], "SELECT count(*) FROM telemetry WHERE kind = 'mission_report'") == 1


@BOTH_ENGINES
def test_what_two_say_of_a_vehicle_is_both_kept(servers: list[Context]) -> None:
    def say(context: Context, _: int) -> Any:
        if context is servers[0]:
            return vehicles.put(context, 1, VehicleState(link_state="connected", armed=True))
        return vehicles.put(context, 1, VehicleState(link_state="connected", mode="hold"))

    at_once(servers, say, times=3)
    shown = vehicles.find(servers[0], 1)
    assert (shown["armed"], shown["mode"]) == (True, "hold")


@BOTH_ENGINES
def test_of_two_corrections_with_one_tag_one_is_refused(servers: list[Context]) -> None:
    kept = telemetry.ingest(servers[0], Kind.POSE, pose(0), Caller("broker"))

    def correct(context: Context, number: int) -> Any:
        def unchanged(shown: dict[str, Any]) -> None:
            if shown["message_id"] != kept["message_id"]:
                raise ChangedError("it is another one by now")

        return telemetry.replace(context, Kind.POSE, kept["id"], pose(number + 1), unchanged)

    results = at_once(servers, correct, times=2)
    assert Counter(result is ChangedError for result in results) == {True: 3, False: 1}


@pytest.mark.parametrize("engine_name", ["postgresql"], indirect=True)
def test_a_row_waits_for_the_one_before_it_in_its_stream(servers: list[Context]) -> None:
    first, second = servers
    with first.database.write() as connection:
        records.store(connection, Kind.POSE, documents.telemetry("pose", 0), 0.0)
        later = threading.Thread(target=_ingest, args=(second, 0, pose(1), Caller("broker")))
        later.start()
        waiting = "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND NOT granted"
        wait_for(lambda: rows(second, waiting) == 1, "the second one at the lock")
        assert rows(second, "SELECT count(*) FROM outbox") == 0
    later.join()
    with second.database.read() as reading:
        sent = [json.loads(p.payload) for p in queue.read_queued(reading, Stream(1, "pose"), 0, 10)]
    assert [body["sequence_number"] for body in sent] == [0, 1]


@pytest.mark.first_case
@BOTH_ENGINES
def test_rows_of_a_stream_become_visible_in_the_order_of_their_ids(servers: list[Context]) -> None:
    """A relay that has seen row n has seen every row of the stream that was there before."""
    stopped = threading.Event()
    seen: list[int] = []

    def watch() -> None:
        while not stopped.is_set() or len(seen) < len(expected()):
            with servers[0].database.read() as connection:
                queued = queue.read_queued(
                    connection, Stream(1, "pose"), seen[-1] if seen else 0, 1000
                )
            seen.extend(record.outbox_id for record in queued)

    def expected() -> list[int]:
        with servers[0].database.read() as connection:
            return [p.outbox_id for p in queue.read_queued(connection, Stream(1, "pose"), 0, 1000)]

    watcher = threading.Thread(target=watch)
    watcher.start()
    at_once(
        servers, lambda c, n: telemetry.ingest(c, Kind.POSE, pose(n), Caller("broker")), times=20
    )
    wait_for(lambda: len(expected()) == 40, "all that was posted")
    stopped.set()
    watcher.join()
    assert seen == expected()


@pytest.mark.parametrize("engine_name", ["postgresql"], indirect=True)
def test_a_broker_that_waits_at_one_server_is_woken_by_the_other(
    servers: list[Context], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(broker_work, "POLL_INTERVAL_S", 3600.0)  # It does not read by itself
    waiting, posting = servers
    waiting.database.listen(waiting.receive_notice)
    found: list[dict[str, Any]] = []
    thread = threading.Thread(
        target=lambda: found.append(broker_work.poll(waiting, 0, 60.0, "broker"))
    )
    thread.start()
    wait_for(lambda: waiting.work_signal.count > 0, "a listening server")
    plans.create(posting, plan(), OPERATOR)
    thread.join()
    assert [item["kind"] for item in found[0]["commands"]] == ["mission"]
