"""The logs of vehicles: sent by a broker in parts, downloaded with their flights."""

import shutil
import sqlite3
from collections import namedtuple
from contextlib import closing
from dataclasses import replace
from typing import Any, Final

import pytest
from werkzeug.test import TestResponse

from edge_server.config import Config
from edge_server.services.context import show_time
from tests.unit.edge_server.archive.flown import FINISHED, arm, begin, report, serve
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import VEHICLE_LOG

LOG: Final = "/vehicles/1/logs/01K9Z4T1W8F6Q2M3N5P7R9S0VX"
OTHER: Final = "/vehicles/1/logs/01K9Z4T1W8F6Q2M3N5P7R9S0VY"
MIB: Final = 1024 * 1024
CONTENTS: Final = b"ULog\x01\x122345"


def declare(edge: Edge, path: str = LOG, **fields: Any) -> TestResponse:
    return edge.ask("PUT", path, "broker", json=VEHICLE_LOG | fields)


def send(
    edge: Edge, offset: int, data: bytes, path: str = LOG, *, is_last: bool = False
) -> TestResponse:
    query = f"?offset={offset}" + ("&is_last=true" if is_last else "")
    media_type = "application/octet-stream"
    return edge.ask("PATCH", path + query, "broker", data=data, content_type=media_type)


def store(edge: Edge, data: bytes, path: str = LOG, **fields: Any) -> None:
    """Send a whole log in parts of a MiB."""
    assert declare(edge, path, size_bytes=len(data), **fields).status_code == 201
    for offset in range(0, len(data), MIB):
        is_last = offset + MIB >= len(data)
        answer = send(edge, offset, data[offset : offset + MIB], path, is_last=is_last)
        assert answer.status_code == 200, answer.json


@pytest.fixture
def flown(edge: Edge) -> Edge:
    """An edge server with flight 1 of vehicle 1, from 12:00 to 12:10."""
    begin(edge)
    edge.clock.pass_s(600.0)
    report(edge, FINISHED)
    return edge


def test_a_log_is_sent_in_parts_and_downloaded_with_its_flight(flown: Edge) -> None:
    begun = declare(flown)
    assert begun.status_code == 201
    assert (begun.json or {})["received_bytes"] == 0
    assert (send(flown, 0, b"ULog\x01").json or {})["received_bytes"] == 5
    assert (send(flown, 5, b"\x122345", is_last=True).json or {})["is_complete"]
    answer = flown.ask("GET", "/flights/1/log", "farmer")
    assert (answer.status_code, answer.data) == (200, b"ULog\x01\x122345")
    assert answer.content_type == "application/octet-stream"
    assert answer.content_length == 10
    name = "flight-1-vehicle-1-2026-11-21T12-00-00Z.ulg"
    assert answer.headers["Content-Disposition"] == f'attachment; filename="{name}"'
    (listed,) = flown.get("/flights/1/logs")
    assert (listed["file_name"], listed["size_bytes"], listed["is_complete"]) == (name, 10, True)
    assert flown.ask("GET", listed["url"], "farmer").data == answer.data


def test_a_range_of_a_log_over_several_parts_is_given(flown: Edge) -> None:
    data = bytes(range(256)) * 10
    assert declare(flown, size_bytes=len(data)).status_code == 201
    for offset in range(0, len(data), 100):
        send(flown, offset, data[offset : offset + 100], is_last=offset + 100 >= len(data))
    headers = {"Range": "bytes=150-1234"}
    answer = flown.ask("GET", "/flights/1/log", "farmer", headers=headers)
    assert (answer.status_code, answer.data) == (206, data[150:1235])
    assert answer.headers["Content-Range"] == f"bytes 150-1234/{len(data)}"
    beyond = {"Range": "bytes=2560-"}
    assert flown.ask("GET", "/flights/1/log", "farmer", headers=beyond).status_code == 416
    tag = {"If-None-Match": answer.headers["ETag"]}
    assert flown.ask("GET", "/flights/1/log", "farmer", headers=tag).status_code == 304


@pytest.mark.parametrize(
    ("last", "given"), [(4, b"2345"), (10, CONTENTS), (99_999_999_999, CONTENTS)]
)
def test_the_last_bytes_of_a_log_are_at_most_the_whole_log(
    flown: Edge, last: int, given: bytes
) -> None:
    declare(flown)
    send(flown, 0, CONTENTS, is_last=True)
    headers = {"Range": f"bytes=-{last}"}
    answer = flown.ask("GET", "/flights/1/log", "farmer", headers=headers)
    assert (answer.status_code, answer.data) == (206, given)
    assert answer.headers["Content-Range"] == f"bytes {10 - len(given)}-9/10"


def test_a_download_goes_on_if_the_log_is_the_same(flown: Edge) -> None:
    declare(flown)
    send(flown, 0, CONTENTS, is_last=True)
    tag = flown.ask("GET", "/flights/1/log", "farmer").headers["ETag"]

    def ask(condition: str) -> tuple[int, bytes]:
        headers = {"Range": "bytes=4-", "If-Range": condition}
        answer = flown.ask("GET", "/flights/1/log", "farmer", headers=headers)
        return answer.status_code, answer.data

    assert ask(tag) == (206, CONTENTS[4:])
    for other in (
        '"of a former file"',
        f"W/{tag}",
        tag.strip('"'),
        "Sat, 21 Nov 2026 12:00:00 GMT",
    ):
        assert ask(other) == (200, CONTENTS)


def test_a_flight_without_a_log_says_why(flown: Edge) -> None:
    answer = flown.ask("GET", "/flights/1/log", "farmer")
    assert answer.status_code == 404
    assert "flight 1 has no log" in (answer.json or {})["message"]
    assert flown.get("/flights/1/logs") == []
    assert flown.ask("GET", "/flights/1/logs/1", "farmer").status_code == 404
    declare(flown)
    send(flown, 0, b"ULog")
    (listed,) = flown.get("/flights/1/logs")
    assert (listed["url"], listed["received_bytes"], listed["size_bytes"]) == (None, 4, 10)
    answer = flown.ask("GET", "/flights/1/log", "farmer")
    assert answer.status_code == 404
    assert "4 of 10 bytes" in (answer.json or {})["message"]
    assert flown.ask("GET", "/flights/2/log", "farmer").status_code == 404


def test_a_part_that_does_not_follow_changes_nothing(flown: Edge) -> None:
    declare(flown)
    send(flown, 0, b"ULog")
    for offset in (0, 3, 5):
        answer = send(flown, offset, b"x")
        assert answer.status_code == 409
        assert "continues at offset 4" in (answer.json or {})["message"]
    again = declare(flown)
    assert (again.status_code, (again.json or {})["received_bytes"]) == (200, 4)
    send(flown, 4, b"123456", is_last=True)
    answer = send(flown, 4, b"123456", is_last=True)  # Its answer was lost
    assert answer.status_code == 409
    assert (declare(flown).json or {})["is_complete"]
    assert flown.ask("GET", "/flights/1/log", "farmer").data == b"ULog123456"


def test_a_log_may_end_before_its_size(flown: Edge) -> None:
    declare(flown)
    send(flown, 0, b"ULog")
    assert send(flown, 4, b"", is_last=True).status_code == 200
    answer = flown.ask("GET", "/flights/1/log", "farmer")
    assert (answer.data, answer.content_length) == (b"ULog", 4)


def test_a_restarted_broker_finds_what_it_has_begun(flown: Edge) -> None:
    declare(flown)
    store(flown, b"ULog", OTHER)
    (found,) = flown.get("/vehicles/1/logs", "broker")
    assert found == {**VEHICLE_LOG, **found}
    assert found["name"] == LOG.rpartition("/")[2]
    assert flown.ask("DELETE", LOG, "broker").status_code == 204
    assert flown.get("/vehicles/1/logs", "broker") == []
    assert flown.ask("DELETE", LOG, "broker").status_code == 404
    assert send(flown, 0, b"ULog").status_code == 404


def test_a_log_survives_the_edge_server(flown: Edge) -> None:
    declare(flown)
    send(flown, 0, b"ULog")
    flown.context.archive.close()
    again = serve(flown.config, flown.clock)
    assert (declare(again).json or {})["received_bytes"] == 4
    send(again, 4, b"123456", is_last=True)
    assert again.ask("GET", "/flights/1/log", "farmer").data == b"ULog123456"
    again.context.database.close()


@pytest.mark.parametrize(
    ("fields", "place"),
    [
        ({"size_bytes": 0}, "size_bytes"),
        ({"size_bytes": 2**32}, "size_bytes"),
        ({"size_bytes": 1.5}, "size_bytes"),
        ({"format": "exe"}, "format"),
        ({"ended_at": "2026-11-21T11:00:00Z"}, "ended_at"),
        ({"started_at": "noon"}, "started_at"),
        ({"listed_at": 1e300}, "listed_at"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_log_that_is_described_badly_is_refused(
    flown: Edge, fields: dict[str, Any], place: str
) -> None:
    answer = declare(flown, **fields)
    assert answer.status_code == 422
    assert place in str((answer.json or {})["detail"])


def test_a_part_that_is_sent_badly_is_refused(flown: Edge) -> None:
    declare(flown)
    media_type = "application/octet-stream"
    for query in ("", "?offset=", "?offset=-1", "?offset=x", f"?offset={2**32}"):
        answer = flown.ask("PATCH", LOG + query, "broker", data=b"x", content_type=media_type)
        assert answer.status_code == 422, query
        assert "offset" in str((answer.json or {})["detail"])
    answer = flown.ask(
        "PATCH", f"{LOG}?offset=0&is_last=1", "broker", data=b"x", content_type=media_type
    )
    assert answer.status_code == 422
    assert flown.ask("PATCH", f"{LOG}?offset=0", "broker", json={}).status_code == 415
    assert send(flown, 0, bytes(MIB + 1)).status_code == 413
    assert send(flown, 0, bytes(11)).status_code == 413  # It was said to have 10
    assert (declare(flown).json or {})["received_bytes"] == 0


def test_a_name_belongs_to_one_log(flown: Edge) -> None:
    declare(flown)
    assert declare(flown, size_bytes=11).status_code == 409


def test_a_log_of_no_flight_is_refused(flown: Edge) -> None:
    at = {"started_at": "2026-11-21T13:00:00Z", "ended_at": "2026-11-21T13:10:00Z"}
    assert declare(flown, **at).status_code == 404
    assert declare(flown, "/vehicles/2/logs/x").status_code == 404


def test_one_log_belongs_to_all_flights_that_it_overlaps(edge: Edge) -> None:
    begin(edge, 1)
    edge.clock.pass_s(300.0)
    report(edge, FINISHED, mission_id=1)
    begin(edge, 2)
    edge.clock.pass_s(300.0)
    report(edge, FINISHED, mission_id=2)
    store(edge, b"ULog")
    assert edge.ask("GET", "/flights/1/log", "farmer").data == b"ULog"
    assert edge.ask("GET", "/flights/2/log", "farmer").data == b"ULog"
    edge.clock.pass_s(100.0)
    arm(edge, armed=True)
    assert edge.get("/flights/3/logs") == []


def test_a_flight_with_a_landing_has_several_logs(flown: Edge) -> None:
    store(flown, b"ULog1", ended_at="2026-11-21T12:03:00Z")
    store(flown, b"ULog second", OTHER, started_at="2026-11-21T12:05:00Z")
    first, second = flown.get("/flights/1/logs")
    assert flown.ask("GET", first["url"], "farmer").data == b"ULog1"
    assert flown.ask("GET", second["url"], "farmer").data == b"ULog second"
    assert flown.ask("GET", "/flights/1/log", "farmer").data == b"ULog second"


def rows(edge: Edge, table: str) -> int:
    with closing(sqlite3.connect(edge.config.archive_path)) as connection:
        return int(connection.execute(f"SELECT count(*) FROM {table}").fetchone()[0])


def test_a_log_goes_with_the_last_of_its_flights(flown: Edge) -> None:
    store(flown, bytes(2 * MIB))
    flown.clock.pass_s(31 * 86_400.0)
    for _ in range(3):
        flown.context.archive.maintain(trusts_clock=True)
    assert flown.get("/flights/") == []
    assert (rows(flown, "log"), rows(flown, "log_part")) == (0, 0)


def test_the_oldest_logs_go_before_flights_when_logs_use_half_of_the_budget(
    config: Config,
) -> None:
    edge = serve(replace(config, archive_mib=8))
    for number in range(1, 5):
        begin(edge, number)
        store(
            edge,
            bytes(3 * MIB // 2),
            f"/vehicles/1/logs/{number}",
            started_at=show_time(edge.clock()),
            ended_at=show_time(edge.clock() + 60.0),
        )
        edge.clock.pass_s(60.0)
        report(edge, FINISHED, mission_id=number)
        edge.clock.pass_s(100.0)
        edge.context.archive.maintain(trusts_clock=False)
    assert len(edge.get("/flights/")) == 4
    kept = [one for one in range(1, 5) if edge.get(f"/flights/{one}/logs")]
    assert kept == [3, 4]
    assert rows(edge, "log_part") == 4
    edge.context.database.close()


def test_a_log_that_nobody_continues_is_deleted(flown: Edge) -> None:
    declare(flown)
    send(flown, 0, b"ULog")
    flown.clock.pass_s(2 * 86_400.0)
    flown.context.archive.maintain(trusts_clock=False)
    assert flown.get("/flights/1/logs") == []
    assert flown.get("/vehicles/1/logs", "broker") == []
    assert len(flown.get("/flights/")) == 1


def test_a_log_beyond_the_share_of_logs_is_too_large(config: Config) -> None:
    edge = serve(replace(config, archive_mib=8))
    begin(edge)
    assert declare(edge, size_bytes=4 * MIB).status_code == 201
    answer = declare(edge, OTHER, size_bytes=4 * MIB + 1)
    assert answer.status_code == 413
    assert str(4 * MIB) in (answer.json or {})["message"]
    edge.context.database.close()


def test_nothing_is_kept_without_an_archive(config: Config) -> None:
    edge = serve(replace(config, archive_mib=0))
    begin(edge)
    answer = declare(edge)
    assert (answer.status_code, "EDGE_ARCHIVE_MIB" in (answer.json or {})["message"]) == (409, True)
    assert edge.get("/vehicles/1/logs", "broker") == []
    assert edge.ask("GET", "/flights/1/log", "farmer").status_code == 404
    edge.context.database.close()


def test_records_come_before_logs_on_a_disk_that_is_nearly_full(
    flown: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    declare(flown)
    usage = namedtuple("usage", "total used free")  # noqa: PYI024  # as shutil's
    arm(flown, armed=True)  # A flight that has not ended is kept
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage(100_000 * MIB, 0, 40 * MIB))
    flown.context.archive.maintain(trusts_clock=False)
    assert send(flown, 0, b"ULog").status_code == 507
    assert declare(flown, OTHER).status_code == 507


def test_a_locked_archive_refuses_for_now(flown: Edge) -> None:
    declare(flown)
    with closing(sqlite3.connect(flown.config.archive_path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        answer = send(flown, 0, b"ULog")
    assert (answer.status_code, "Retry-After" in answer.headers) == (503, True)
    assert send(flown, 0, b"ULog").status_code == 200


def test_an_archive_of_an_older_version_has_no_logs(flown: Edge) -> None:
    flown.context.archive.close()
    with closing(sqlite3.connect(flown.config.archive_path, isolation_level=None)) as older:
        older.executescript("DROP TABLE log; DROP TABLE log_part;")
    assert flown.get("/flights/1/logs") == []
    assert flown.get("/vehicles/1/logs", "broker") == []
    assert declare(flown).status_code == 201
