"""What the mock cloud answers over MQTT: the store that HTTP fills, the same words."""

import json
from pathlib import Path
from typing import Any

import pytest

from sim.cloud.mqtt_requests import Request, answer
from sim.cloud.store import KINDS, Store


def publish(store: Store, topic: str, key: str, body: Any) -> dict[str, Any]:
    return answer(store, Request(topic, key, json.dumps(body).encode()), 1.0)


def line(kind: str, key: str, vehicle_id: Any = 1) -> bytes:
    record = {"message_id": key, "vehicle_id": vehicle_id}
    return json.dumps({"kind": kind, "record": record}).encode() + b"\n"


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_kept_under_its_key(kind: str) -> None:
    store = Store(None)
    answered = publish(store, f"{kind}/7", "key", {"vehicle_id": 7})
    assert answered == {"message_id": "key", "status": 200, "outcome": "stored"}
    (record,) = store.records(kind)
    assert (record.message_id, record.body) == ("key", {"vehicle_id": 7})


def test_the_same_message_twice_has_one_effect_and_another_body_none() -> None:
    store = Store(None)
    assert publish(store, "pose/1", "key", {"vehicle_id": 1})["outcome"] == "stored"
    assert publish(store, "pose/1", "key", {"vehicle_id": 1})["status"] == 200
    assert publish(store, "pose/1", "key", {"vehicle_id": 2})["status"] == 409
    assert len(store.records()) == 1


@pytest.mark.parametrize("payload", [b"", b"[]", b"{", b"\xff", b"[" * 100_000])
def test_what_is_no_record_is_refused(payload: bytes) -> None:
    store = Store(None)
    assert answer(store, Request("pose/1", "key", payload), 1.0)["status"] == 400
    assert answer(store, Request("batch", "key", payload + b"\n1"), 1.0)["status"] == 400
    assert publish(store, "fish/1", "key", {})["status"] == 404
    assert store.records() == []


def test_a_batch_is_answered_line_by_line() -> None:
    store = Store(None)
    lines = line("pose", "1") + line("fish", "2") + line("pose", "3", [1]) + line("pose", "1")
    answered = answer(store, Request("batch", "batch-1", lines), 1.0)
    assert answered["status"] == 200
    found = [(result["message_id"], result["status"]) for result in answered["results"]]
    assert found == [("1", 200), ("2", 404), ("3", 200), ("1", 200)]
    assert len(store.records()) == 2


def test_a_full_disk_confirms_nothing(tmp_path: Path) -> None:
    (tmp_path / "records").mkdir()
    store = Store(None)
    store._journal = tmp_path / "records"  # A folder: no line can be written
    assert publish(store, "pose/1", "1", {"vehicle_id": 1})["status"] == 507
    lines = line("pose", "1") + line("pose", "2")
    assert answer(store, Request("batch", "batch-1", lines), 1.0)["status"] == 507
    assert store.records() == []
