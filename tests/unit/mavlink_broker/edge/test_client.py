"""The edge server over real HTTP: posts are retried until answered, in order."""

import json
import logging
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
import requests

from mavlink_broker import supervision
from mavlink_broker.edge.answers import is_final
from mavlink_broker.edge.bounded_http import Answer, EdgeConnection
from mavlink_broker.edge.client import EdgeClient, Pause
from mavlink_broker.edge.wire import AcceptanceResult, post_for
from mavlink_broker.effects import Acknowledgement, VehicleUpdate
from tests.support.broker_world import first_flight
from tests.support.certificates import Authority
from tests.support.fake_edge import FakeEdgeServer
from tests.support.polling import wait_until
from tests.unit.mavlink_broker.edge.clients import (
    KEY,
    NOWHERE,
    Woken,
    client_of,
    leave,
    numbers,
    pose,
    report,
    spool_in,
    work_of,
)


def test_posts_arrive_in_order(server: FakeEdgeServer, tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text(KEY + "\n")
    client = client_of(server, tmp_path)
    for number in range(20):
        client.post(pose(number))
    assert numbers(server.wait_for("/pose/", 20)) == list(range(20))
    client.stop(1.0)
    assert client.waiting == 0


def test_every_request_names_the_instance_of_the_broker(
    server: FakeEdgeServer, tmp_path: Path
) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    key_file, woken = tmp_path / "broker.key", Woken()
    client = EdgeClient(server.url, key_file, woken, instance_id="01BROKER")
    client.start()
    client.post(pose(0))
    server.plan(first_flight())
    assert numbers(server.wait_for("/pose/", 1)) == [0]
    assert woken.event.wait(10.0)
    client.stop(1.0)
    assert server.instances_seen == {("GET", "01BROKER"), ("POST", "01BROKER")}


@pytest.mark.thorough
def test_a_failed_post_is_retried_with_its_key_and_never_overtaken(
    server: FakeEdgeServer, tmp_path: Path
) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    server.failures.extend([500, 503, 429])
    client = client_of(server, tmp_path)
    client.post(pose(0))
    client.post(pose(1))
    assert numbers(server.wait_for("/pose/", 2)) == [0, 1]
    client.stop(1.0)
    keys = [key for path, key in server.keys_seen if path == "/pose/"]
    assert keys == ["key-0"] * 4 + ["key-1"]


def test_a_final_refusal_is_not_retried(server: FakeEdgeServer, tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    server.failures.append(422)
    client = client_of(server, tmp_path)
    client.post(pose(0))
    client.post(pose(1))
    assert numbers(server.wait_for("/pose/", 1)) == [1]
    client.stop(1.0)


@pytest.mark.parametrize(
    ("failures", "holds"),
    [([], True), ([404], False), ([503, 409], False), ([422], False), ([503], True)],
)
def test_the_answer_to_an_acceptance_is_passed_on(
    server: FakeEdgeServer,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    failures: list[int],
    holds: bool,
) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    server.plan(first_flight())
    server.failures.extend(failures)
    woken = Woken()
    client = client_of(server, tmp_path, woken)
    verdicts: list[AcceptanceResult] = []

    def acknowledge(status: str) -> None:
        message = Acknowledgement(1, status)
        client.post(post_for(message, vehicle_id=1, recorded_at=datetime.now(UTC), key="none"))

    def has_arrived() -> bool:
        verdicts.extend(client.take_acceptance_results())
        return bool(verdicts)

    acknowledge("accepted")
    wait_until(has_arrived)
    acknowledge("done")
    client.stop(5.0)
    sent = [*verdicts, *client.take_acceptance_results()]
    assert [(verdict.work_id, verdict.is_confirmed) for verdict in sent] == [(1, holds)]
    assert woken.event.is_set()
    errors = [one for one in caplog.records if one.levelno >= logging.ERROR]
    assert bool(errors) == (failures == [422])  # Work that ends meanwhile is none


def test_the_key_file_may_appear_later_or_change(server: FakeEdgeServer, tmp_path: Path) -> None:
    client = client_of(server, tmp_path)
    client.post(pose(0))
    assert server.wait_for("/pose/", 1, timeout_s=0.3) == []
    (tmp_path / "broker.key").write_text("of yesterday")
    (tmp_path / "broker.key").write_text(KEY)
    assert numbers(server.wait_for("/pose/", 1)) == [0]
    server.key = "of tomorrow"
    (tmp_path / "broker.key").write_text("of tomorrow")
    client.post(pose(1))
    assert numbers(server.wait_for("/pose/", 2)) == [0, 1]
    client.stop(1.0)


def test_work_wakes_the_loop(server: FakeEdgeServer, tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    woken = Woken()
    client = client_of(server, tmp_path, woken)
    server.plan(first_flight())
    assert woken.event.wait(10.0)
    assert client.take_work()[0]["mission"]["mission_id"] == 1201
    assert client.take_work() == []
    client.stop(0.1)


@pytest.mark.parametrize(
    ("status", "final"),
    [
        (200, True),
        (201, True),
        (204, True),
        (301, False),
        (400, True),
        (401, False),
        (403, False),
        (404, True),
        (408, False),
        (409, True),
        (422, True),
        (425, False),
        (429, False),
        (500, False),
        (507, False),
    ],
)
def test_final_status_codes(status: int, final: bool) -> None:
    assert is_final(status) is final


@contextmanager
def https(server: FakeEdgeServer, authority: Authority) -> Iterator[str]:
    """The same server behind TLS; gives its address."""
    certificate, _, _ = authority.certify("edge")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate)
    server.use_tls(context)
    yield server.url.replace("http://", "https://")


def test_a_certificate_of_the_farms_ca_is_accepted(tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text(KEY + "\n")
    authority = Authority(tmp_path / "farm")
    server = FakeEdgeServer(0, KEY)
    with https(server, authority) as url, server.running():
        client = EdgeClient(url, tmp_path / "broker.key", Woken(), ca_file=authority.file)
        client.start()
        client.post(pose(1))
        assert numbers(server.wait_for("/pose/", 1)) == [1]
        client.stop(within_s=1.0)


def test_nothing_is_sent_to_a_server_with_a_certificate_of_another_ca(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "mavlink_broker.edge.client")
    (tmp_path / "broker.key").write_text(KEY + "\n")
    server = FakeEdgeServer(0, KEY)
    with https(server, Authority(tmp_path / "stranger")) as url, server.running():
        ours = Authority(tmp_path / "farm").file
        client = EdgeClient(url, tmp_path / "broker.key", Woken(), ca_file=ours)
        client.start()
        client.post(pose(1))
        wait_until(lambda: "certificate verify failed" in caplog.text)
        client.stop(within_s=0.0)
        assert server.wait_for("/pose/", 1, timeout_s=0.0) == []


@pytest.mark.first_case
@pytest.mark.parametrize(
    "failure",
    [OSError("no such file"), requests.ConnectionError("gone"), RuntimeError("?"), MemoryError()],
    ids=lambda failure: type(failure).__name__,
)
def test_any_error_in_a_request_delays_the_post_and_ends_no_thread(
    server: FakeEdgeServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: Exception
) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    genuine = EdgeConnection.request
    failed: list[str] = []

    def request(self: EdgeConnection, method: str, path: str, *args: Any, **named: Any) -> Any:
        if len(failed) < 4:
            failed.append(path)
            raise failure
        return genuine(self, method, path, *args, **named)

    monkeypatch.setattr(EdgeConnection, "request", request)
    monkeypatch.setattr(supervision, "LONGEST_PAUSE_S", 0.01)
    client = client_of(server, tmp_path)
    for number in range(5):
        client.post(pose(number))
    server.plan(first_flight())
    assert numbers(server.wait_for("/pose/", 5)) == list(range(5))
    assert work_of(client)
    client.stop(1.0)


def test_the_ca_file_may_appear_later(tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text(KEY)
    authority, later = Authority(tmp_path / "farm"), tmp_path / "authority.pem"
    server = FakeEdgeServer(0, KEY)
    with https(server, authority) as url, server.running():
        client = EdgeClient(url, tmp_path / "broker.key", Woken(), ca_file=later)
        client.start()
        client.post(pose(1))
        server.plan(first_flight())
        wait_until(lambda: client.failures > 2)
        authority.file.rename(later)
        assert numbers(server.wait_for("/pose/", 1)) == [1]
        assert work_of(client)
        client.stop(within_s=1.0)


def test_the_steps_between_exchanges_need_no_thread(tmp_path: Path) -> None:
    now = [0.0]
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken(), clock=lambda: now[0])
    refused = client.next_poll()
    assert refused.wait_s == 0.0
    assert client.take_answer(refused, requests.ConnectionError("refused")) is Pause.RETRY
    work = Answer(200, b'{"cursor": 3, "commands": [{"id": 3, "vehicle_id": 1}]}')
    assert client.take_answer(client.next_poll(), work) is Pause.NONE
    assert client.take_work() == [{"id": 3, "vehicle_id": 1}]
    assert client.next_poll().path.startswith("/broker/commands?after=3&")


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ('{"commands": [], "cursor": 1e999}', "cursor"),
        ('{"commands": [], "cursor": NaN}', "cursor"),
        ('{"commands": [1e999], "cursor": 3}', "commands"),
        ("[]", "commands"),
    ],
)
def test_work_that_cannot_be_read_costs_one_poll(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, body: str, field: str
) -> None:
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken())
    assert client.take_answer(client.next_poll(), Answer(200, body.encode())) is Pause.RETRY
    assert f"the edge server's work cannot be read: its {field} cannot be used" in caplog.messages
    work = Answer(200, b'{"cursor": 3, "commands": [{"id": 3, "vehicle_id": 1}]}')
    assert client.take_answer(client.next_poll(), work) is Pause.NONE
    assert client.take_work() == [{"id": 3, "vehicle_id": 1}]


def edge_times(client: EdgeClient, *times: object) -> list[object]:
    """Let work arrive in answers that name these times; gives the time with each piece of work."""
    found = []
    for time in times:
        body = {"cursor": 3, "commands": [{"id": 3, "vehicle_id": 1}], "time": time}
        client.take_answer(client.next_poll(), Answer(200, json.dumps(body).encode()))
        (work,) = client.take_work()
        found.append(work.get("edge_time"))
    return found


def test_work_comes_with_the_time_of_the_edge_server(tmp_path: Path) -> None:
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken(), clock=lambda: 5.0)
    noon = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
    assert edge_times(client, "2026-11-21T12:00:00.000Z") == [noon]


@pytest.mark.parametrize("held_s", [1.5, 5.0, 30.0])
def test_work_in_a_first_answer_that_was_long_on_its_way_is_asked_for_again(
    tmp_path: Path, held_s: float
) -> None:
    """The edge server was just starting: an abort in it is younger than the request."""
    now = [100.0]
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken(), clock=lambda: now[0])
    noon = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
    poll = client.next_poll()
    for after_s in (held_s, 0.02):
        assert client.take_work() == []
        now[0] += after_s
        body = {
            "cursor": 3,
            "commands": [{"id": 3, "vehicle_id": 1}],
            "time": (noon + timedelta(seconds=now[0] - 100.0)).isoformat(),
        }
        assert client.take_answer(poll, Answer(200, json.dumps(body).encode())) is Pause.NONE
        poll = client.next_poll()
    (work,) = client.take_work()
    assert work["edge_time"] == noon + timedelta(seconds=held_s + 0.02)


def test_work_is_taken_though_the_edge_server_names_its_time_only_once(tmp_path: Path) -> None:
    now = [100.0]
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken(), clock=lambda: now[0])
    for number, time in enumerate(("2026-11-21T12:00:00Z", None)):
        poll = client.next_poll()
        now[0] += 5.0
        body = {"cursor": 3, "commands": [{"id": 3, "vehicle_id": 1}], "time": time}
        client.take_answer(poll, Answer(200, json.dumps(body).encode()))
        assert len(client.take_work()) == number


@pytest.mark.parametrize(
    "time",
    [
        *(None, "", "noon", 12, [], {}, "2026-11-21T12:00:00", "9" * 5000),
        *("9999-12-31T23:59:59.9-14:00", "0001-01-01T00:00:00+14:00"),
    ],
)
def test_a_time_that_cannot_be_used_costs_no_work(tmp_path: Path, time: object) -> None:
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken(), clock=lambda: 5.0)
    noon = "2026-11-21T12:00:00Z"
    assert edge_times(client, time, noon) == [None, datetime(2026, 11, 21, 12, 0, tzinfo=UTC)]
    edge_times(client, time, time)
    assert edge_times(client, noon) == [datetime(2026, 11, 21, 12, 0, tzinfo=UTC)]


@pytest.mark.parametrize("body", [b"<html>Please sign in</html>", b"", b"null", b"[]", b'{"id": 1'])
@pytest.mark.parametrize("status", [200, 201, 204, 302, 400, 404, 409, 422])
def test_an_answer_of_somebody_else_settles_nothing(
    tmp_path: Path, status: int, body: bytes
) -> None:
    now = [0.0]
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken(), clock=lambda: now[0])
    message = Acknowledgement(5, "accepted")
    client.post(post_for(message, vehicle_id=1, recorded_at=datetime.now(UTC), key="key"))
    post = client.take_post()
    assert post is not None
    client.settle(post, Answer(status, body))
    assert client.take_acceptance_results() == []
    now[0] += 10.0
    assert client.take_post() is post
    client.settle(post, Answer(200, b"{}"))
    assert client.take_acceptance_results() == [AcceptanceResult(5, is_confirmed=True)]


@pytest.mark.parametrize(
    ("header", "interval_s"),
    [
        ("0.4", 0.4),
        ("0", 0.2),
        (None, None),
        ("nan", None),
        ("-1", None),
        ("1e9", None),
        ("9999", None),
        ("٤", None),
        ("", None),
    ],
)
def test_the_answer_to_an_update_sets_the_interval_of_the_next_ones(
    tmp_path: Path, header: str | None, interval_s: float | None
) -> None:
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken(), clock=lambda: 0.0)

    def update(answer: Answer | Exception) -> float | None:
        message = VehicleUpdate(1, {"link_state": "connected"})
        client.post(post_for(message, vehicle_id=1, recorded_at=datetime.now(UTC), key="key"))
        post = client.take_post()
        assert post is not None
        client.settle(post, answer)
        return client.update_interval_of(1)

    assert update(Answer(200, b"{}", header)) == interval_s
    assert client.update_interval_of(2) is None
    assert update(Answer(200, b"{}", "1.5")) == 1.5
    assert update(requests.ConnectionError("cut off")) is None


def test_a_post_without_an_answer_is_taken_again_after_its_pause(tmp_path: Path) -> None:
    now = [0.0]
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken(), clock=lambda: now[0])
    message = Acknowledgement(5, "accepted")
    client.post(post_for(message, vehicle_id=1, recorded_at=datetime.now(UTC), key="key"))
    post = client.take_post()
    assert post is not None
    client.settle(post, requests.ConnectionError("cut off"))
    assert client.take_post() is None
    now[0] += 10.0
    assert client.take_post() is post
    client.settle(post, Answer(200, b"{}"))
    assert client.take_acceptance_results() == [AcceptanceResult(5, is_confirmed=True)]


def test_no_work_is_said_to_wait_for_reports_that_were_sent_meanwhile(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    leave(tmp_path, report(1201, 2))
    client = EdgeClient(NOWHERE, tmp_path / "key", Woken(), spool=spool_in(tmp_path))
    poll = client.next_poll()
    inherited = client.take_post()
    assert inherited is not None
    client.settle(inherited, Answer(201, b'{"id": 7}'))
    work = Answer(200, b'{"cursor": 3, "commands": [{"id": 3, "vehicle_id": 1}]}')
    assert client.take_answer(poll, work) is Pause.REPORTS
    assert "waits until" not in caplog.text
    assert client.take_answer(client.next_poll(), work) is Pause.NONE
