"""Within the disk budget: what is thinned, refused and dropped, and that all of it is reported."""

import base64
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Connection, text

from afarcloud.state import Report
from afarcloud.wire import Kind, read
from edge_server.config import Config
from edge_server.outbox import gaps, queue, thinning
from edge_server.outbox.budget import Level
from edge_server.outbox.gaps import DroppedRecord, Reason
from edge_server.outbox.queue import Delivered, Stream
from edge_server.outbox.steady_clock import STEADY_S
from edge_server.process.preparation import open_database
from edge_server.services.context import Caller, Context, show_time
from edge_server.services.errors import FullError
from edge_server.services.reports import telemetry
from edge_server.services.reports.telemetry import Arrival
from edge_server.store.connection.database import Database
from edge_server.store.rows import telemetry as stored
from edge_server.store.rows.tables import METADATA
from tests.support.databases import BOTH_ENGINES
from tests.unit.edge_server import documents
from tests.unit.edge_server.conftest import Clock

DAY_S = 86_400.0


class Farm:
    """An edge server with a small budget whose cloud is away."""

    def __init__(self, config: Config, **settings: Any) -> None:
        self.clock = Clock()
        self.monotonic = 0.0
        self.database: Database = open_database(config)
        self.context = Context(
            replace(config, **{"data_budget_mib": 1} | settings), self.database, self.clock
        )
        self.space = self.context.space
        self.dropped: list[tuple[str, str, int]] = []
        self.space.count = lambda *what: self.dropped.append(what)
        self.numbers = count()
        self.message_ids: dict[str, str] = {}

    def keep(self, kind: str, vehicle_id: int = 1, **fields: Any) -> str:
        """Keep one report; returns its message_id."""
        body = documents.telemetry(kind, next(self.numbers), vehicle_id) | fields
        report = read(Kind(kind), body)
        assert isinstance(report, Report)
        kept = telemetry.ingest(self.context, Kind(kind), report, Caller("broker"))
        self.message_ids[kept["message_id"]] = kind
        return str(kept["message_id"])

    def keep_many(self, kind: str, number: int, every_s: float = 1.0) -> None:
        """Keep reports that were taken at an interval; what has no room is left out."""
        arrivals = []
        for _ in range(number):
            self.pass_s(every_s)
            body = documents.telemetry(kind, next(self.numbers))
            body["recorded_at"] = show_time(self.clock.now)
            report = read(Kind(kind), body)
            assert isinstance(report, Report)
            arrivals.append(Arrival(Kind(kind), report, None))
        for receipt in telemetry.ingest_all(self.context, arrivals, "broker"):
            if isinstance(receipt, dict):
                self.message_ids[receipt["message_id"]] = kind

    def pass_s(self, seconds: float) -> None:
        self.clock.pass_s(seconds)
        self.monotonic += seconds

    def turn(self) -> None:
        self.space.maintain(self.monotonic)

    def here(self, kind: str, vehicle_id: int = 1) -> list[dict[str, Any]]:
        with self.database.read() as connection:
            queued = queue.read_queued(connection, Stream(vehicle_id, kind), 0, 10**6)
        return [json.loads(record.payload) for record in queued]

    def check_declared(self) -> None:
        """Whatever is not here any more lies in a gap of its stream, and the counts agree."""
        reported: dict[str, int] = {}
        for kind in set(self.message_ids.values()):
            here = {body["message_id"] for body in self.here(kind)}
            lost = {key for key, of in self.message_ids.items() if of == kind} - here
            found = [gap for gap in self.here(gaps.KIND) if gap["kind"] == kind]
            assert sum(gap["count"] for gap in found) == len(lost)
            for key in lost:
                assert any(g["from_message_id"] <= key <= g["to_message_id"] for g in found), key
            reported[kind] = len(lost)
        counted: dict[str, int] = {}
        for kind, _, number in self.dropped:
            counted[kind] = counted.get(kind, 0) + number
        assert counted == {kind: number for kind, number in reported.items() if number}


@pytest.fixture
def sqlite(prepared: Path, tmp_path: Path) -> Config:
    """A SQLite database of its own: only there what is in use is known to the byte."""
    shutil.copytree(prepared, tmp_path / "state")
    return Config(state_dir=tmp_path / "state")


@pytest.fixture
def farm(sqlite: Config) -> Iterator[Farm]:
    """A farm with 1 MiB for its records."""
    farm = Farm(sqlite)
    yield farm
    farm.database.close()


@pytest.fixture
def either(config: Config) -> Iterator[Farm]:
    """A farm with room on either engine."""
    farm = Farm(config, data_budget_mib=100, dead_letter_budget_mib=1)
    yield farm
    farm.database.close()


def fill(farm: Farm, kind: str, level: Level, every_s: float = 1.0) -> None:
    while farm.space.level() < level:
        farm.keep_many(kind, 50, every_s)
        farm.space.measure()


def test_with_room_nothing_is_touched(farm: Farm) -> None:
    farm.keep_many("pose", 200)
    farm.turn()
    assert len(farm.here("pose")) == 200
    assert farm.here("gap") == []


def test_at_80_percent_poses_are_thinned_oldest_first_until_it_is_less(farm: Farm) -> None:
    fill(farm, "pose", Level.THINNING)
    farm.turn()
    assert farm.space.level() < Level.THINNING
    times = [body["sequence_number"] for body in farm.here("pose")]
    steps = [later - earlier for earlier, later in pairwise(times)]
    assert steps[1:3] == [10, 10]
    assert steps[-1] == 1
    farm.check_declared()
    assert {reason for _, reason, _ in farm.dropped} == {"thinned"}


@pytest.mark.first_case
@BOTH_ENGINES
def test_thinning_again_takes_no_more_than_one_per_interval_needs(either: Farm) -> None:
    either.keep_many("pose", 200)
    intervals: thinning.Intervals = {}
    bookmark, survivors = 0, len(either.here("pose"))
    for _ in range(2):
        with either.database.write() as connection:
            found = thinning.to_thin(connection, bookmark, 10**6, intervals)
            gaps.drop(connection, found.to_drop, Reason.THINNED, 0.0)
        bookmark = found.bookmark
        assert found.at_end
        survivors -= len(found.to_drop)
        assert len(either.here("pose")) == survivors
    assert found.to_drop == []
    for_anew: thinning.Intervals = {}
    with either.database.read() as connection:
        assert thinning.to_thin(connection, 0, 10**6, for_anew).to_drop == []


@BOTH_ENGINES
def test_what_was_delivered_or_changed_since_it_was_chosen_is_not_declared_lost(
    either: Farm,
) -> None:
    either.keep_many("pose", 4)
    with either.database.read() as connection:
        going = thinning.oldest(connection, 4)
    with either.database.write() as connection:
        stored.remove(connection, "pose", going[0].record_id)
        stored.replace(connection, going[1].record_id, message_id="another", payload="{}")
        assert gaps.drop(connection, going, Reason.BUDGET, 0.0) == {"pose": 2}
    (gap,) = either.here("gap")
    assert (gap["count"], gap["from_sequence_number"], gap["to_sequence_number"]) == (2, 2, 3)


def drop_oldest(connection: Connection, number: int, now: float) -> dict[str, int]:
    return gaps.drop(connection, thinning.oldest(connection, number), Reason.BUDGET, now)


def test_batteries_observations_and_alarms_are_not_thinned(farm: Farm) -> None:
    for kind in ("battery", "observation", "alarm", "mission_report"):
        farm.keep_many(kind, 30, every_s=0.1)
    fill(farm, "pose", Level.THINNING)
    farm.turn()
    for kind in ("battery", "observation", "alarm", "mission_report"):
        assert len(farm.here(kind)) == 30


@pytest.mark.thorough
def test_at_100_percent_the_oldest_go_and_new_ones_come_in(farm: Farm) -> None:
    farm.keep_many("alarm", 20)
    farm.keep_many("observation", 20)
    for _ in range(40):
        farm.keep_many("battery", 100)
    assert farm.space.level() < Level.FULL
    numbers = [body["sequence_number"] for body in farm.here("battery")]
    assert numbers == list(range(numbers[0], 4040))
    assert numbers[0] > 40
    assert len(farm.here("alarm")) == len(farm.here("observation")) == 20
    farm.check_declared()
    assert {reason for _, reason, _ in farm.dropped} == {"budget"}


@pytest.mark.first_case
@BOTH_ENGINES
def test_what_goes_next_is_added_to_the_gap_that_waits(either: Farm) -> None:
    for _ in range(10):
        either.keep_many("battery", 20)
        with either.database.write() as connection:
            dropped = drop_oldest(connection, 20, either.clock.now)
        either.dropped += [(kind, "budget", number) for kind, number in dropped.items()]
    (gap,) = either.here("gap")
    assert (gap["count"], gap["from_sequence_number"], gap["to_sequence_number"]) == (200, 0, 199)
    assert gap["gap_id"] != gap["message_id"]
    either.check_declared()


@BOTH_ENGINES
def test_a_gap_that_grew_in_flight_goes_again_in_its_larger_form(either: Farm) -> None:
    either.keep_many("battery", 20)
    with either.database.write() as connection:
        drop_oldest(connection, 10, either.clock.now)
        (sent,) = queue.read_queued(connection, Stream(1, "gap"), 0, 10)
        drop_oldest(connection, 10, either.clock.now)
        assert queue.delete_delivered(connection, [Delivered(sent, 200)], 0.0) == [sent]
    (gap,) = either.here("gap")
    assert gap["gap_id"] == sent.message_id
    assert gap["count"] == 20


def test_pictures_are_refused_from_95_percent_on_and_beyond_their_own_budget(
    sqlite: Config,
) -> None:
    roomy = Farm(sqlite, data_budget_mib=100, picture_budget_mib=1)
    frame = documents.JPEG + bytes(300_000)
    picture: dict[str, Any] = {"frame": base64.b64encode(frame).decode(), "image_size": len(frame)}
    roomy.keep("image", **picture)
    roomy.keep("image", **picture)
    with pytest.raises(FullError, match="pictures"):
        roomy.keep("image", **picture)
    roomy.space.measure()
    with pytest.raises(FullError, match="pictures"):
        roomy.keep("image", **picture)
    roomy.keep("pose")
    roomy.database.close()


@pytest.mark.thorough
def test_when_nothing_may_go_only_alarms_and_reports_come_in(farm: Farm) -> None:
    fill(farm, "observation", Level.DROPPING)
    with pytest.raises(FullError):
        farm.keep("pose")
    with pytest.raises(FullError):
        farm.keep("observation")
    farm.keep("alarm")
    farm.keep("mission_report")
    fill(farm, "alarm", Level.FULL)
    with pytest.raises(FullError):
        farm.keep("alarm")


@pytest.mark.thorough
def test_in_a_bulk_only_what_has_no_room_is_refused(farm: Farm) -> None:
    fill(farm, "observation", Level.DROPPING)
    arrivals = []
    for kind in ("observation", "alarm"):
        report = read(Kind(kind), documents.telemetry(kind))
        assert isinstance(report, Report)
        arrivals.append(Arrival(Kind(kind), report, None))
    refused, kept = telemetry.ingest_all(farm.context, arrivals, "broker")
    assert isinstance(refused, FullError)
    assert isinstance(kept, dict)


@pytest.mark.first_case
@BOTH_ENGINES
def test_what_is_too_old_goes_with_a_gap(either: Farm) -> None:
    either.keep_many("observation", 5)
    either.turn()
    either.pass_s(29 * DAY_S)
    either.keep_many("observation", 3)
    either.space.drop_aged(either.monotonic)
    assert len(either.here("observation")) == 8
    either.pass_s(1.1 * DAY_S)
    either.space.drop_aged(either.monotonic)
    assert [body["sequence_number"] for body in either.here("observation")] == [5, 6, 7]
    either.check_declared()
    either.pass_s(40 * DAY_S)
    either.space.drop_aged(either.monotonic)
    assert either.here("observation") == []
    assert [gap["count"] for gap in either.here("gap")] == [8]


@pytest.mark.first_case
@BOTH_ENGINES
def test_a_clock_that_jumps_makes_nothing_old(either: Farm) -> None:
    either.keep_many("pose", 5)
    either.turn()
    either.pass_s(2 * STEADY_S)
    either.space.drop_aged(either.monotonic)
    either.clock.pass_s(400 * DAY_S)
    either.space.drop_aged(either.monotonic)
    either.pass_s(60.0)
    either.space.drop_aged(either.monotonic)
    assert len(either.here("pose")) == 5
    either.clock.pass_s(-400 * DAY_S)
    either.pass_s(2 * STEADY_S)
    either.space.drop_aged(either.monotonic)
    assert len(either.here("pose")) == 5


@pytest.mark.first_case
@BOTH_ENGINES
def test_dead_letters_have_a_budget_of_their_own(either: Farm) -> None:
    farm = either
    frame = documents.JPEG + bytes(300_000)
    picture: dict[str, Any] = {"frame": base64.b64encode(frame).decode(), "image_size": len(frame)}
    keys = [farm.keep("image", **picture) for _ in range(4)]
    with farm.database.write() as connection:
        for record in queue.read_queued(connection, Stream(1, "image"), 0, 3):
            queue.mark_dead(connection, record, 1, "422", 0.0)
    farm.space.drop_aged(0.0)
    (gap,) = farm.here("gap")
    assert (gap["reason"], gap["count"]) == (Reason.DEAD_LETTERS, 1)
    assert (gap["from_message_id"], gap["to_message_id"]) == (keys[0], keys[0])
    assert [body["message_id"] for body in farm.here("image")] == [keys[3]]


@BOTH_ENGINES
def test_a_gap_and_what_it_declares_are_one_transaction(either: Farm) -> None:
    either.keep_many("pose", 3)
    with either.database.read() as connection:
        queued = queue.read_queued(connection, Stream(1, "pose"), 0, 10)
    lost = [DroppedRecord(p.record_id, p.message_id, p.stream, 0, None, 0.0, 2) for p in queued]
    with either.database.write() as connection:
        gaps.drop(connection, lost, Reason.BUDGET, 0.0)
        connection.rollback()
    assert len(either.here("pose")) == 3
    assert either.here("gap") == []


def fill_with_receipts(farm: Farm) -> None:
    """Store the receipts of records that are delivered now."""
    with farm.database.write() as connection:
        rows = [
            {
                "message_id": f"{number:026d}",
                "kind": "pose",
                "vehicle_id": 1,
                "record_id": number,
                "http_status": 200,
                "attempts": 1,
                "delivered_at": farm.clock.now,
            }
            for number in range(12_000)
        ]
        connection.execute(METADATA.tables["tombstone"].insert(), rows)


def receipts(farm: Farm) -> int:
    with farm.database.read() as connection:
        return int(connection.execute(text("SELECT count(*) FROM tombstone")).scalar_one())


@pytest.mark.parametrize("is_restarted", [True, False])
def test_a_clock_that_was_set_forward_makes_no_receipt_old(
    sqlite: Config, farm: Farm, is_restarted: bool
) -> None:
    """Not on a full disk either: a repeated record would be stored twice."""
    farm.turn()
    fill_with_receipts(farm)
    farm.clock.pass_s(400 * DAY_S)
    here = Farm(sqlite) if is_restarted else farm
    here.clock.now = farm.clock.now
    here.turn()
    assert here.space.level() >= Level.THINNING
    assert receipts(here) == 12_000
    here.pass_s(STEADY_S + 1.0)
    for _ in range(10):
        here.turn()
    assert receipts(here) < 12_000
    here.database.close()


@pytest.mark.thorough
def test_receipts_go_before_records(farm: Farm) -> None:
    farm.keep_many("battery", 10)
    fill_with_receipts(farm)
    assert farm.space.measure().data_bytes > 1_000_000
    farm.pass_s(7200.0)
    for _ in range(10):
        farm.turn()
    assert farm.space.level() < Level.THINNING
    assert len(farm.here("battery")) == 10
    assert farm.here("gap") == []


def test_without_its_ballast_only_what_is_urgent_is_taken_in(farm: Farm) -> None:
    farm.keep("pose")
    farm.turn()
    ballast = farm.context.config.ballast_path
    assert ballast.stat().st_blocks * 512 >= 1024 * 1024
    assert farm.space.lacking_bytes == 0
    ballast.unlink()
    assert farm.space.lacking_bytes >= 2 * 1024 * 1024
    with pytest.raises(FullError, match="disk is full"):
        farm.keep("pose")
    farm.keep("alarm")
    farm.turn()
    farm.keep("pose")


def test_how_full_it_is_is_told_once(farm: Farm, caplog: pytest.LogCaptureFixture) -> None:
    fill(farm, "pose", Level.THINNING)
    for _ in range(5):
        farm.turn()
        fill(farm, "pose", Level.THINNING)
    warnings = [record.getMessage() for record in caplog.records if "disk budget" in record.message]
    assert len(warnings) == 1
    assert "80 %" in warnings[0]
