import json
import sys
from pathlib import Path

import pytest
from flask.testing import FlaskClient
from werkzeug.test import TestResponse

from sim.cloud.__main__ import main
from sim.cloud.app import create_app
from sim.cloud.store import KINDS, Store

POSE = {"sequence_number": 1, "vehicle_id": 1}


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    return tmp_path / "cloud" / "records.ndjson"


@pytest.fixture
def cloud(journal: Path) -> FlaskClient:
    return create_app(Store(journal)).test_client()


def send(cloud: FlaskClient, kind: str, key: str, body: dict[str, int]) -> int:
    return cloud.post(f"/{kind}", json=body, headers={"Idempotency-Key": key}).status_code


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_kept_in_order(cloud: FlaskClient, kind: str) -> None:
    for number in range(5):
        assert send(cloud, kind, f"key-{number}", {"sequence_number": number}) == 200
    held = [record["body"]["sequence_number"] for record in cloud.get(f"/{kind}").json or []]
    assert held == [0, 1, 2, 3, 4]


def test_the_same_message_twice_has_one_effect(cloud: FlaskClient) -> None:
    assert send(cloud, "pose", "key", POSE) == 200
    assert send(cloud, "pose", "key", POSE) == 200
    assert len(cloud.get("/pose").json or []) == 1


def test_one_key_for_two_bodies_is_a_conflict(cloud: FlaskClient) -> None:
    assert send(cloud, "pose", "key", POSE) == 200
    assert send(cloud, "pose", "key", {**POSE, "vehicle_id": 2}) == 409
    assert send(cloud, "battery", "key", POSE) == 409
    assert [r["body"] for r in cloud.get("/records").json or []] == [POSE]


def test_a_restarted_cloud_holds_and_recognises_what_it_confirmed(
    cloud: FlaskClient, journal: Path
) -> None:
    send(cloud, "pose", "key", POSE)
    again = create_app(Store(journal)).test_client()
    assert send(again, "pose", "key", POSE) == 200
    assert len(again.get("/pose").json or []) == 1


def test_a_record_cut_off_by_a_kill_is_taken_again(cloud: FlaskClient, journal: Path) -> None:
    send(cloud, "pose", "first", POSE)
    send(cloud, "pose", "second", POSE)
    journal.write_bytes(journal.read_bytes()[:-7])
    again = create_app(Store(journal)).test_client()
    assert [r["message_id"] for r in again.get("/pose").json or []] == ["first"]
    assert send(again, "pose", "second", POSE) == 200
    third = create_app(Store(journal)).test_client()
    assert [r["message_id"] for r in third.get("/pose").json or []] == ["first", "second"]


@pytest.mark.parametrize("body", [b"", b"{", b"[1]", b"null"])
def test_what_is_no_object_is_refused(cloud: FlaskClient, body: bytes) -> None:
    assert cloud.post("/pose", data=body, content_type="application/json").status_code == 400
    assert cloud.get("/records").json == []


def test_records_are_filtered_by_vehicle_and_number(cloud: FlaskClient) -> None:
    for vehicle_id in (1, 2, 1):
        cloud.post("/pose/", json={"vehicle_id": vehicle_id})
    first_vehicle = cloud.get("/pose?vehicle_id=1").json or []
    assert [record["number"] for record in first_vehicle] == [1, 3]
    later = cloud.get("/records?after=2").json or []
    assert [record["number"] for record in later] == [3]


def test_a_full_disk_is_told_and_nothing_is_kept(cloud: FlaskClient, journal: Path) -> None:
    journal.parent.rmdir()
    assert send(cloud, "pose", "key", POSE) == 507
    assert cloud.get("/records").json == []


@pytest.fixture
def batching(journal: Path) -> FlaskClient:
    return create_app(Store(journal), batch_records=3).test_client()


def line(kind: str, key: str, number: int = 0) -> str:
    record = {"sequence_number": number, "vehicle_id": 1, "message_id": key}
    return json.dumps({"kind": kind, "record": record})


def send_batch(cloud: FlaskClient, *lines: str) -> TestResponse:
    return cloud.post("/batch", data="\n".join(lines), content_type="application/x-ndjson")


def test_batches_are_announced_only_where_they_are_offered(
    cloud: FlaskClient, batching: FlaskClient
) -> None:
    assert "Accept-Batch" not in cloud.post("/pose", json=POSE).headers
    assert batching.post("/pose", json=POSE).headers["Accept-Batch"] == "3"
    assert send_batch(cloud, line("pose", "a")).status_code == 404


def test_a_batch_is_kept_in_its_order_with_a_result_for_each(batching: FlaskClient) -> None:
    send_batch(batching, line("pose", "b", 1))
    answer = send_batch(batching, line("pose", "a"), line("pose", "b", 2), line("plan", "c"))
    assert [(r["message_id"], r["status"]) for r in (answer.json or {})["results"]] == [
        ("a", 200),
        ("b", 409),
        ("c", 404),
    ]
    again = send_batch(batching, line("pose", "a"), line("alarm", "d"))
    assert [r["outcome"] for r in (again.json or {})["results"]] == ["duplicate", "stored"]
    assert [r["message_id"] for r in batching.get("/records").json or []] == ["b", "a", "d"]


def test_what_a_batch_holds_twice_is_kept_once(batching: FlaskClient) -> None:
    answer = send_batch(batching, line("pose", "a"), line("pose", "a"))
    assert [r["outcome"] for r in (answer.json or {})["results"]] == ["stored", "duplicate"]
    assert len(batching.get("/records").json or []) == 1


def test_a_batch_that_is_too_long_is_refused_whole(batching: FlaskClient) -> None:
    assert send_batch(batching, *(line("pose", str(n)) for n in range(4))).status_code == 413
    assert batching.get("/records").json == []


@pytest.mark.parametrize("bad", ["{", "[]", '{"kind": "pose"}', '{"kind": "pose", "record": 5}'])
def test_a_line_that_names_no_record_spoils_the_batch(batching: FlaskClient, bad: str) -> None:
    assert send_batch(batching, line("pose", "a"), bad).status_code == 400
    assert batching.get("/records").json == []


def test_a_port_that_does_not_exist_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["sim.cloud", "--port", "99999"])
    with pytest.raises(SystemExit):
        main()
    assert "--port: 99999 is not from 0 to 65535" in capsys.readouterr().err
