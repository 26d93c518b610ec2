"""An edge server's outbox and relay without its HTTP surface, over any uplink."""

import threading
import time
from pathlib import Path
from typing import Any

from sqlalchemy import text

from afarcloud.state import Report
from afarcloud.wire import Kind, read
from edge_server.config import Config
from edge_server.outbox.relay import Relay
from edge_server.process import relay
from edge_server.process.preparation import open_database
from edge_server.services.context import Caller, Context
from edge_server.services.reports import telemetry
from tests.support.polling import wait_until
from tests.unit.edge_server import documents

BROKER = Caller("broker")


def station_config(state_dir: Path, cloud_url: str, **settings: Any) -> Config:
    """Settings of a relay that is quick to try again."""
    quick: dict[str, Any] = {
        "backoff_base_s": 0.02,
        "backoff_cap_s": 0.1,
        "probe_interval_s": 0.05,
        "read_timeout_s": 0.6,
    }
    return Config(state_dir=state_dir, cloud_url=cloud_url, **quick | settings)


class Station:
    """Keeps records as the API does, and relays them in a thread."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self.database = open_database(config)
        self.context = Context(config, self.database, time.time)
        self._relay: Relay | None = None
        self._thread: threading.Thread | None = None

    def ingest(self, kind: str, *sequence_numbers: int, vehicle_id: int = 1) -> list[int]:
        """Keep records; returns their ids."""
        return [self.ingest_document(kind, number, vehicle_id) for number in sequence_numbers]

    def ingest_document(
        self, kind: str, sequence_number: int, vehicle_id: int = 1, **fields: Any
    ) -> int:
        """Keep a record with some fields of its own; returns its id."""
        document = documents.telemetry(kind, sequence_number, vehicle_id) | fields
        report = read(Kind(kind), document)
        assert isinstance(report, Report)
        identifier: int = telemetry.ingest(self.context, Kind(kind), report, BROKER)["id"]
        return identifier

    def relay(self) -> None:
        self._relay = relay.build(self.config, self.database)
        self._thread = threading.Thread(target=self._relay.run)
        self._thread.start()

    def stop(self) -> None:
        if self._relay is not None and self._thread is not None:
            self._relay.stop()
            self._thread.join()
            self._relay = None

    def close(self) -> None:
        self.stop()
        self.database.close()

    def rows(self, table: str, where: str = "1 = 1") -> int:
        query = text(f"SELECT count(*) FROM {table} WHERE {where}")
        with self.database.read() as connection:
            return int(connection.execute(query).scalar_one())

    def wait_empty(self) -> None:
        wait_until(lambda: self.rows("outbox") == 0)
