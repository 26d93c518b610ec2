"""Health of the relay as other processes see it: one that hangs is not one that waits."""

import os
import signal
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from edge_server import relay_health
from edge_server.config import Config
from edge_server.outbox.counts import RelayCounts, UplinkState
from edge_server.outbox.relay import TICK_S
from edge_server.process import relay
from edge_server.process.preparation import prepare
from edge_server.process.relay import StateFolderLock
from edge_server.relay_health import STALLED_AFTER_S
from edge_server.store.connection.engines import SESSION
from edge_server.store.files.tally import Tally
from tests.support.process_tree import command_words, descendants
from tests.support.station import Station, station_config
from tests.support.system import wait_for
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.program import program_in


class MonotonicClock:
    """The clock of the machine, which passes by `pass_s` only."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._now = 1000.0
        fake = SimpleNamespace(monotonic=lambda: self._now)
        monkeypatch.setattr(relay_health, "time", fake)

    def pass_s(self, seconds: float) -> None:
        self._now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> MonotonicClock:
    return MonotonicClock(monkeypatch)


def uplink_of(edge: Edge) -> tuple[str, str]:
    """Return the state in `/readyz` and the value in the metrics."""
    page = edge.ask("GET", "/metrics", "operator").text
    metric = next(line for line in page.splitlines() if line.startswith("fm_uplink_state "))
    return edge.get("/readyz")["uplink"], metric.split()[1]


def test_a_relay_whose_loop_does_not_run_is_stalled(edge: Edge, clock: MonotonicClock) -> None:
    RelayCounts(Tally(edge.config.relay_tally_path)).set_uplink(UplinkState.OPEN)
    lock = StateFolderLock(edge.config)
    clock.pass_s(STALLED_AFTER_S)
    assert uplink_of(edge) == ("open", "1.0")
    clock.pass_s(0.1)
    assert uplink_of(edge) == ("stalled", "4.0")
    lock.note_activity()
    assert uplink_of(edge) == ("open", "1.0")
    clock.pass_s(STALLED_AFTER_S + 1.0)
    lock.close()
    assert uplink_of(edge) == ("stopped", "0.0")


def test_the_note_of_an_earlier_relay_or_boot_does_not_make_a_new_one_stalled(
    edge: Edge, clock: MonotonicClock
) -> None:
    for passed_s in (2.0 * STALLED_AFTER_S, -900.0):
        StateFolderLock(edge.config).close()
        clock.pass_s(passed_s)
        lock = StateFolderLock(edge.config)
        assert uplink_of(edge)[0] == "open"
        lock.close()


def test_a_relay_without_the_lock_does_not_note_that_its_holder_runs(
    edge: Edge, clock: MonotonicClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(relay, "SHARED_PATIENCE_S", 0.0)
    shared = Config(state_dir=edge.config.state_dir, database_url="postgresql+psycopg://x/edge")
    first, second = StateFolderLock(shared), StateFolderLock(shared)
    clock.pass_s(STALLED_AFTER_S + 1.0)
    second.note_activity()
    assert uplink_of(edge)[0] == "stalled"
    first.close()
    assert second.try_again()
    assert uplink_of(edge)[0] == "open"
    second.close()


def test_what_the_loop_waits_for_ends_before_it_counts_as_stalled() -> None:
    assert 1.5 * float(SESSION["statement_timeout"].removesuffix("s")) < STALLED_AFTER_S


@pytest.fixture
def silent_cloud() -> Iterator[str]:
    """Listen, and never answer a request."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"http://127.0.0.1:{server.getsockname()[1]}"


def test_the_loop_notes_that_it_runs_while_a_cloud_does_not_answer(
    tmp_path: Path, silent_cloud: str
) -> None:
    config = station_config(tmp_path, silent_cloud, read_timeout_s=60.0)
    prepare(config)
    station = Station(config)
    station.ingest("pose", 1, 2, 3)
    noted: list[float] = []
    running = relay.build(station.config, station.database, lambda: noted.append(time.monotonic()))
    thread = threading.Thread(target=running.run)
    thread.start()
    try:
        wait_for(lambda: running._schedule.batches_in_flight, "a request in flight")
        began = time.monotonic()
        wait_for(lambda: noted and noted[-1] > began + 2.0 * TICK_S, "notes of a loop that runs")
        assert running._schedule.batches_in_flight
    finally:
        running.stop()
        thread.join()
        station.close()


def test_a_relay_that_waits_for_the_database_is_not_stalled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = iter((False, False, True))
    noted: list[float] = []
    monkeypatch.setattr("edge_server.store.migrate.is_ready", lambda _: next(answers))
    assert relay._wait_for_database("sqlite://", threading.Event(), lambda: noted.append(0.0))
    assert len(noted) == 2


@pytest.mark.thorough
def test_a_relay_stopped_by_a_signal_is_stalled_until_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(relay_health, "STALLED_AFTER_S", 4.0 * TICK_S)
    config = Config(state_dir=tmp_path / "state")
    with program_in(config.state_dir) as program:
        program.start()
        assert program.process is not None
        children = descendants(program.process.pid)
        process = next(pid for pid in children if "relay" in command_words(pid))

        def state() -> UplinkState:
            return relay_health.read(config).uplink

        wait_for(lambda: state() is UplinkState.OPEN, "a relay")
        os.kill(process, signal.SIGSTOP)
        wait_for(lambda: state() is UplinkState.STALLED, "the state of a relay that hangs")
        assert relay_health.read(config).deaths == 0
        os.kill(process, signal.SIGCONT)
        wait_for(lambda: state() is UplinkState.OPEN, "the relay at work again")
        assert program.end()[0] == 0
