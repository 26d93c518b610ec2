"""Failures that users of other gateways have reported, each a test under the name of its report.

Where a report is about decisions, time is simulated; where it is about the network, real sockets.
"""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from edge_server.config import Config
from edge_server.outbox import gaps
from edge_server.outbox.uplink import MAXIMUM_BATCH
from edge_server.process import relay
from edge_server.process.preparation import open_database, prepare
from edge_server.services.errors import FullError
from edge_server.store.migrate import is_ready
from tests.soak import outage
from tests.support import fake_cloud
from tests.support.databases import BOTH_ENGINES
from tests.support.fake_cloud import FakeCloud, Fault, running_cloud
from tests.support.virtual_station import VirtualCloud, VirtualStation, answering, lose_answer

HOUR_S = 3600.0


@pytest.fixture
def config(tmp_path: Path, engine_name: str, database_url: str) -> Config:
    """A state folder with an empty database."""
    made = Config(
        state_dir=tmp_path, database_url=None if engine_name == "sqlite" else database_url
    )
    prepare(made)
    return made


@pytest.fixture
def small_station(config: Config) -> Iterator[VirtualStation]:
    """A station with a disk budget of 1 MiB, and a cloud that takes batches and is away."""
    station = VirtualStation(replace(config, data_budget_mib=1), VirtualCloud(MAXIMUM_BATCH))
    station.cloud.is_there = False
    yield station
    station.close()


@pytest.fixture
def station(config: Config) -> Iterator[VirtualStation]:
    """A station that works, with a cloud."""
    station = VirtualStation(config)
    yield station
    station.close()


@pytest.mark.first_case
@BOTH_ENGINES
def test_tb2157_first_seconds_of_outage(station: VirtualStation) -> None:
    for second in range(120):
        station.cloud.is_there = not 30 <= second < 90
        station.ingest("pose", second)
        station.relay_for(1.0)
    station.drain()
    assert station.cloud.stream(1, "pose") == list(range(120))


@pytest.mark.first_case
@BOTH_ENGINES
def test_tb2098_prefetch_delete_race(station: VirtualStation) -> None:
    """What is read ahead while the records before it are deleted is sent once."""
    station.cloud = VirtualCloud(MAXIMUM_BATCH)
    keys = station.ingest("pose", *range(500))
    while batches := station.send_next():
        assert station.send_next() == []
        for batch in batches:
            station.answered(batch, station.cloud.send(batch.records))
    station.drain()
    assert station.cloud.seen == keys


@pytest.mark.first_case
@BOTH_ENGINES
def test_tb2124_reconnect_keeps_store(station: VirtualStation) -> None:
    for number in range(20):
        station.cloud.is_there = number % 2 == 0
        station.ingest("pose", 2 * number, 2 * number + 1)
        station.relay_for(0.5)
        if number % 5 == 0:
            station.restart()
    station.cloud.is_there = True
    station.drain()
    assert station.cloud.stream(1, "pose") == list(range(40))


@pytest.mark.first_case
@BOTH_ENGINES
def test_tb2132_poller_survives_13h_outage(station: VirtualStation) -> None:
    station.cloud.is_there = False
    for hour in range(13):
        station.ingest("pose", hour)
        station.relay_for(HOUR_S)
    station.cloud.is_there = True
    station.relay_for(station.config.backoff_cap_s)
    assert station.waiting() == 0
    assert station.cloud.stream(1, "pose") == list(range(13))


def _flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 3000] = bytes(byte ^ 0xFF for byte in content[middle : middle + 3000])
    path.write_bytes(content)


def _truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-5000])


@pytest.mark.first_case
@pytest.mark.parametrize("spoil", [_flip, _truncate])
def test_telegraf18528_corrupt_store_starts(tmp_path: Path, spoil: Callable[[Path], None]) -> None:
    config = Config(state_dir=tmp_path)
    prepare(config)
    station = VirtualStation(config)
    station.ingest("pose", *range(200))
    station.close()
    spoil(config.database_path)
    prepare(config)
    assert is_ready(config.database)
    assert len(list((config.edge_dir / "quarantine").glob("*.sqlite3"))) == 1
    again = VirtualStation(config)
    again.ingest("pose", 1000)
    again.drain()
    kept = again.cloud.stream(1, "pose")
    assert kept == sorted(kept)
    assert kept[-1] == 1000
    again.close()


@pytest.mark.first_case
@BOTH_ENGINES
def test_telegraf16500_no_resend_after_restart(station: VirtualStation) -> None:
    station.ingest("pose", *range(10))
    station.drain()
    station.cloud.seen.clear()
    station.restart()
    station.relay_for(HOUR_S)
    assert station.cloud.seen == []


@pytest.mark.first_case
@BOTH_ENGINES
def test_telegraf16981_last_record(station: VirtualStation) -> None:
    """The last record before a restart is not sent once more, and not left behind."""
    station.ingest("pose", *range(3))
    station.drain()
    (last,) = station.ingest("pose", 3)
    station.restart()
    station.relay_for(HOUR_S)
    assert station.cloud.seen.count(last) == 1
    station.restart()
    station.relay_for(HOUR_S)
    assert station.cloud.seen.count(last) == 1
    assert station.cloud.stream(1, "pose") == [0, 1, 2, 3]


@pytest.mark.first_case
@BOTH_ENGINES
def test_greengrass21_full_then_reconnect_drains(small_station: VirtualStation) -> None:
    station = small_station
    number = 0
    with suppress(FullError):
        while True:
            station.ingest("observation", *range(number, number + 20))
            number += 20
    number = station.waiting()
    station.cloud.is_there = True
    station.drain()
    assert station.cloud.stream(1, "observation") == list(range(number))
    station.context.space.maintain(station.passed_s)
    station.ingest("observation", number)
    station.drain()
    assert station.cloud.stream(1, "observation")[-1] == number


@pytest.mark.first_case
@BOTH_ENGINES
@pytest.mark.parametrize("status", [500, 503, 429, 408, 401, 302, 202])
def test_edgex_order_kept_after_failure(station: VirtualStation, status: int) -> None:
    station.cloud.faults.extend([answering(status)] * 7)
    station.ingest("pose", *range(20))
    station.ingest("pose", *range(20), vehicle_id=2)
    station.drain()
    for vehicle_id in (1, 2):
        assert station.cloud.stream(vehicle_id, "pose") == list(range(20))


@pytest.mark.first_case
@BOTH_ENGINES
def test_mosquitto_drop_is_counted(small_station: VirtualStation) -> None:
    station = small_station
    number = 0
    while not station.dropped:
        try:
            station.ingest("battery", number)
            number += 1
        except FullError:  # A shared database makes room in its turn, not while somebody waits
            station.context.space.maintain(station.passed_s)
    station.cloud.is_there = True
    station.drain()
    arrived = station.cloud.stream(1, "battery")
    gap = [json.loads(p.payload) for p in station.cloud.kept.values() if p.stream.kind == gaps.KIND]
    lost = number - len(arrived)
    assert station.dropped == {("battery", "budget"): lost}
    assert gap[-1]["count"] == lost
    assert (gap[-1]["from_sequence_number"], gap[-1]["to_sequence_number"]) == (0, lost - 1)
    assert arrived == list(range(lost, number))


@pytest.mark.first_case
@BOTH_ENGINES
def test_200_lost(station: VirtualStation) -> None:
    station.cloud.faults.extend([lose_answer, lose_answer])
    (key, *others) = station.ingest("alarm", 0, 1, 2)
    station.drain()
    assert station.cloud.seen == [key, key, key, *others]
    assert station.cloud.stream(1, "alarm") == [0, 1, 2]


@pytest.mark.first_case
@BOTH_ENGINES
def test_200_lost_with_the_relay(station: VirtualStation) -> None:
    """The cloud has stored it, the relay dies before it can say so here: again, once in effect."""
    (key,) = station.ingest("alarm", 0)
    (batch,) = station.send_next()
    station.cloud.send(batch.records)
    station.restart()
    station.drain()
    assert station.cloud.seen == [key, key]
    assert list(station.cloud.kept) == [key]


class _Relayed:
    """A real relay to a cloud over real sockets."""

    def __init__(self, config: Config, cloud: FakeCloud) -> None:
        self.cloud = cloud
        quick = replace(
            config,
            cloud_url=cloud.url,
            backoff_base_s=0.02,
            backoff_cap_s=0.1,
            probe_interval_s=0.05,
        )
        self.station = VirtualStation(quick)
        self.database = open_database(quick)
        self._relay = relay.build(quick, self.database)
        self._thread = threading.Thread(target=self._relay.run)

    def run(self, kind: str, fault: Fault) -> None:
        """Meet the fault three times, then a cloud that works."""
        self.cloud.store.faults.extend([fault] * 3)
        self.station.ingest(kind, 0, 1)
        self._thread.start()
        self.cloud.store.wait_for(2)
        self._relay.stop()
        self._thread.join()
        self.database.close()
        self.station.close()


@pytest.fixture
def relayed(config: Config) -> Iterator[_Relayed]:
    """A relay with a cloud."""
    with running_cloud() as cloud:
        yield _Relayed(config, cloud)


def check_nothing_was_believed(relayed: _Relayed) -> None:
    store = relayed.cloud.store
    assert store.stream(1, "pose") == [0, 1]
    assert [received.key for received in store.seen[:4]] == [store.kept[0].key] * 4


def test_200_with_garbage_body(relayed: _Relayed) -> None:
    relayed.run("pose", fake_cloud.garbage)
    check_nothing_was_believed(relayed)


@pytest.mark.thorough
def test_200_from_captive_portal(relayed: _Relayed) -> None:
    relayed.run("pose", fake_cloud.html)
    check_nothing_was_believed(relayed)


@pytest.mark.thorough
def test_301_not_followed_to_other_host(relayed: _Relayed) -> None:
    with running_cloud() as stranger:
        relayed.run("pose", fake_cloud.status(301, {"Location": f"{stranger.url}/pose"}))
        assert stranger.store.seen == []
    check_nothing_was_believed(relayed)


@pytest.mark.thorough
def test_outage_of_72_hours(tmp_path: Path) -> None:
    outcome = outage.run(Config(state_dir=tmp_path, data_budget_mib=1), burst_s=11)
    assert outcome.taken > 8000
    assert outcome.declared > outcome.taken / 4
    assert outcome.reasons == {"thinned", "budget"}
    assert outcome.largest_share <= 1.05
