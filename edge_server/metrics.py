"""Metrics of this edge server for Prometheus.

Three sources: requests of this process, counts of server and relay in their tallies, and the
database. Counting a large backlog scans an index; the result is cached for a hundred times the
duration of the scan, so that scrapes cost one percent of the time at most, and the count of a small
backlog is current.

`prometheus_client.multiprocess` does not replace the tallies: on a full disk its sparse files kill
the process that counts (SIGBUS), while a tally allocates its blocks first.
"""

import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import accumulate
from typing import Final

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Histogram,
    PlatformCollector,
    ProcessCollector,
    generate_latest,
)
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector
from sqlalchemy import text

from edge_server import relay_health
from edge_server.archive.writer import FlightArchive
from edge_server.config import Config
from edge_server.connections.counts import COUNTS
from edge_server.outbox import counts
from edge_server.outbox.counts import DELIVERY_BUCKETS_S, Waiting
from edge_server.outbox.queue import PRIORITY
from edge_server.store.connection.database import Database
from edge_server.store.files import tally
from edge_server.store.files.tally import Labels, Tally

CACHE_FACTOR: Final = 100.0
"""A count is cached for this multiple of its duration."""
_REQUEST_BUCKETS_S: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 5, 30)
_COUNTED: Final = {
    "fm_delivered": ("Records that the cloud has confirmed", ["kind"]),
    "fm_retries": ("Attempts without confirmation or rejection", ["reason"]),
    "fm_rejected": ("Records that the cloud has rejected: dead letters made", ["kind", "status"]),
    "fm_dropped": ("Records dropped to keep within the disk budget", ["kind", "reason"]),
    "fm_part_deaths": ("Times that a process of the edge server exited by itself", ["part"]),
    "fm_ingest_rejected": ("Reports that were refused, by the status of the answer", ["code"]),
}
"""Name of a count, as in the tallies, its description and its labels."""

_Counts = Mapping[str, Mapping[Labels, float]]


class Metrics:
    """Metrics of one edge server; made once per process."""

    def __init__(
        self,
        config: Config,
        database: Database,
        archive: FlightArchive,
        clock: Callable[[], float],
    ) -> None:
        self.registry = CollectorRegistry()
        self._tally = Tally(config.server_tally_path)
        self._requests = Counter(
            "fm_http_requests",
            "Requests answered",
            ["method", "route", "status"],
            registry=self.registry,
        )
        self._durations = Histogram(
            "fm_http_request_seconds",
            "Time from a request's head to its answer",
            ["method", "route"],
            buckets=_REQUEST_BUCKETS_S,
            registry=self.registry,
        )
        self.registry.register(_EdgeCollector(config, database, archive, clock))
        ProcessCollector(registry=self.registry)
        PlatformCollector(registry=self.registry)

    def answered(self, method: str, route: str, status: int, duration_s: float) -> None:
        """Count an answered request."""
        self._requests.labels(method, route, str(status)).inc()
        self._durations.labels(method, route).observe(duration_s)

    def rejected(self, status: int, records: int = 1) -> None:
        """Count refused reports."""
        self._tally.add("fm_ingest_rejected", str(status), amount=records)

    def dropped(self, kind: str, reason: str, records: int) -> None:
        """Count dropped records."""
        self._tally.add("fm_dropped", kind, reason, amount=records)

    def close(self) -> None:
        """Close the file of the counts; nothing may be counted any more."""
        self._tally.close()

    def page(self) -> bytes:
        """Write the page, in Prometheus' text format."""
        return generate_latest(self.registry)


class _EdgeCollector(Collector):
    """Reads database, tallies and disk at each scrape."""

    def __init__(
        self,
        config: Config,
        database: Database,
        archive: FlightArchive,
        clock: Callable[[], float],
    ) -> None:
        self._archive = archive
        self._config = config
        self._database = database
        self._clock = clock
        self._waiting = Waiting({}, {})
        self._cached_until = float("-inf")

    def describe(self) -> Iterable[Metric]:
        """Describe nothing: registration must not read the database."""
        return ()

    def collect(self) -> Iterator[Metric]:
        """Give the current metrics."""
        counts = _sum(
            tally.read(path)
            for path in (
                self._config.server_tally_path,
                self._config.relay_tally_path,
                self._config.supervisor_tally_path,
            )
        )
        yield from self._outbox()
        yield from _counters(counts)
        yield _delivery_seconds(counts)
        yield _gauge(
            "fm_uplink_state",
            "0 no relay runs, 1 open, 2 blocked: the cloud is away, 3 paused: it refuses the key, "
            "4 stalled: the relay hangs",
            relay_health.read(self._config).uplink,
        )
        yield from self._storage()
        yield from self._archived()
        yield from _connections()

    def _outbox(self) -> Iterator[Metric]:
        with self._database.read() as connection:
            if time.monotonic() >= self._cached_until:
                began = time.monotonic()
                self._waiting = counts.count_waiting(connection)
                ended = time.monotonic()
                self._cached_until = ended + CACHE_FACTOR * (ended - began)
            oldest = counts.oldest_received_at(connection)
        depth = GaugeMetricFamily("fm_outbox_depth", "Records to be sent", labels=["kind"])
        for kind in {**dict.fromkeys(PRIORITY, 0), **self._waiting.queued}:
            depth.add_metric([kind], self._waiting.queued.get(kind, 0))
        yield depth
        age = 0.0 if oldest is None else max(self._clock() - oldest, 0.0)
        yield _gauge("fm_outbox_oldest_seconds", "Age of the oldest record to be sent", age)
        dead = GaugeMetricFamily(
            "fm_dead_letters", "Dead letters that are kept", labels=["kind", "status"]
        )
        for (kind, status), number in self._waiting.dead.items():
            dead.add_metric([kind, status], number)
        yield dead

    def _storage(self) -> Iterator[Metric]:
        size = self._database_bytes()
        yield _gauge("fm_db_bytes", "Size of the database and its log of changes", size)
        free = shutil.disk_usage(self._config.edge_dir).free
        yield _gauge("fm_disk_free_bytes", "Free space on the disk of the database", free)
        quarantined = len(list((self._config.edge_dir / "quarantine").glob("*.sqlite3")))
        yield _gauge("fm_quarantined_databases", "Broken databases in quarantine", quarantined)

    def _archived(self) -> Iterator[Metric]:
        figures = self._archive.figures()
        working = float(figures.is_working)
        yield _gauge("fm_archive_working", "Whether flights are archived", working)
        yield _gauge("fm_archive_bytes", "Size of the flight archive", figures.size_bytes)
        yield _gauge("fm_archive_flights", "Flights in the archive", figures.flights)
        lost = "Reports that are stored and could not be archived"
        yield CounterMetricFamily("fm_archive_lost", lost, value=figures.lost)

    def _database_bytes(self) -> int:
        if self._database.is_shared:
            with self._database.read() as connection:
                size = text("SELECT pg_database_size(current_database())")
                return int(connection.execute(size).scalar_one())
        path = self._config.database_path
        files = [path.with_name(path.name + end) for end in ("", "-wal")]
        return sum(file.stat().st_size for file in files if file.exists())


def _connections() -> Iterator[Metric]:
    yield _gauge("fm_http_connections", "Connections that are open", COUNTS.open)
    closed = CounterMetricFamily(
        "fm_http_connections_closed",
        "Connections closed before a request was complete, or for lack of room",
        labels=["reason"],
    )
    for reason, number in sorted(COUNTS.closed().items()):
        closed.add_metric([reason], number)
    yield closed


def _sum(parts: Iterable[_Counts]) -> dict[str, dict[Labels, float]]:
    total: dict[str, dict[Labels, float]] = {}
    for part in parts:
        for name, values in part.items():
            joined = total.setdefault(name, {})
            for labels, value in values.items():
                joined[labels] = joined.get(labels, 0.0) + value
    return total


def _counters(counts: _Counts) -> Iterator[Metric]:
    for name, (meaning, labels) in _COUNTED.items():
        family = CounterMetricFamily(name, meaning, labels=labels)
        for values, number in sorted(counts.get(name, {}).items()):
            if len(values) == len(labels):
                family.add_metric(values, number)
        yield family


def _delivery_seconds(counts: _Counts) -> Metric:
    found = counts.get("fm_delivery_seconds", {})
    bounds = [*(f"{bound:g}" for bound in DELIVERY_BUCKETS_S), "+Inf"]
    heights = accumulate(found.get((bound,), 0.0) for bound in bounds)
    total_s = counts.get("fm_delivery_seconds_sum", {}).get((), 0.0)
    return HistogramMetricFamily(
        "fm_delivery_seconds",
        "Time from a record's receipt to the cloud's confirmation",
        buckets=list(zip(bounds, heights, strict=True)),
        sum_value=total_s,
    )


def _gauge(name: str, meaning: str, value: float) -> Metric:
    return GaugeMetricFamily(name, meaning, value=value)
