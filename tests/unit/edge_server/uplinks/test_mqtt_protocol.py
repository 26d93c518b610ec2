"""Topics, packet sizes, answers and reason codes of MQTT."""

import itertools
import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties, VariableByteIntegers

from edge_server.config import ConfigError, load
from edge_server.outbox.answers import Answer, Outcome, Unreachable, classify
from edge_server.outbox.queue import Stream
from edge_server.uplinks.mqtt_protocol import (
    IDEMPOTENCY_KEY,
    RecordPacket,
    is_mqtt,
    read_address,
    read_answer,
    reply_to_record,
    reply_to_refusal,
)
from tests.support.cases import failures


@pytest.mark.parametrize(
    ("url", "host", "port", "tls", "root"),
    [
        ("mqtt://broker", "broker", 1883, False, "afarcloud/farm"),
        ("mqtts://broker/", "broker", 8883, True, "afarcloud/farm"),
        ("mqtts://broker:444/a/b/", "broker", 444, True, "a/b"),
        ("mqtt://[::1]:1884/s%C3%BCd", "::1", 1884, False, "süd"),
    ],
)
def test_an_address_names_broker_and_topics(
    url: str, host: str, port: int, root: str, *, tls: bool
) -> None:
    assert read_address(load({}, {"CLOUD_URL": url}).cloud_url) == (host, port, tls, root)


def test_each_stream_has_a_topic_and_none_is_anothers() -> None:
    address = read_address("mqtt://broker/farms/north")
    topics = {
        address.record_topic(Stream(7, "pose")),
        address.record_topic(Stream(7, "alarm")),
        address.record_topic(Stream(71, "pose")),
        address.batch_topic,
        address.answers_topic("7"),
        address.presence_topic("7"),
    }
    assert len(topics) == 6
    assert all(topic.startswith("farms/north/") for topic in topics)
    assert "farms/north/pose/7" in topics


@pytest.mark.parametrize(
    "url",
    [
        "mqtt://broker/a/+/b",
        "mqtt://broker/a/%23",
        "mqtt://broker/$SYS/a",
        "mqtt://broker//%24share",
        "mqtt://broker/a%00b",
        "mqtt://broker/" + "a" * 300,
        "mqtt://broker:0/a",
        "mqtt://broker:70000/a",
        "mqtt://user:secret@broker/a",
        "mqtt://broker/a?clean=1",
        "mqtt:///a",
        "ws://broker/a",
    ],
)
def test_an_address_that_names_no_topics_is_refused_without_its_secrets(url: str) -> None:
    with pytest.raises(ConfigError, match="CLOUD_URL") as refusal:
        load({}, {"CLOUD_URL": url})
    assert "secret" not in str(refusal.value)


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("MQTT_CONFIRM", "nobody"),
        ("MQTT_CLIENT_ID", "a/b"),
        ("MQTT_CLIENT_ID", "#"),
        ("MQTT_KEEP_ALIVE_S", "0"),
        ("MQTT_KEEP_ALIVE_S", "65536"),
    ],
)
def test_a_bad_setting_is_refused_by_name(variable: str, value: str) -> None:
    with pytest.raises(ConfigError, match=variable):
        load({}, {variable: value})


@pytest.mark.thorough
@given(st.text(max_size=60))
def test_whatever_path_is_accepted_is_a_topic(path: str) -> None:
    try:
        url = load({}, {"CLOUD_URL": f"mqtt://broker/{path}"}).cloud_url
    except ConfigError:
        return
    root = read_address(url).root
    assert root
    assert not root.startswith("$")
    assert not set(root) & set("+#\0")
    root.encode()


def test_only_mqtt_is_mqtt() -> None:
    assert is_mqtt("mqtt://broker")
    assert is_mqtt("mqtts://broker")
    assert not is_mqtt("https://mqtt.example/mqtt")


def on_the_wire(packet: RecordPacket) -> int:
    """Length of the PUBLISH as paho writes its properties and lengths."""
    properties: Any = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
    properties.PayloadFormatIndicator = 1
    properties.ContentType = packet.content_type
    properties.UserProperty = (IDEMPOTENCY_KEY, packet.key)
    if packet.answers_topic is not None:
        properties.ResponseTopic = packet.answers_topic
        properties.CorrelationData = packet.key.encode()
    rest = 2 + len(packet.topic.encode()) + 2 + len(properties.pack()) + len(packet.payload)
    length: bytes = VariableByteIntegers.encode(rest)  # type: ignore[no-untyped-call]
    return 1 + len(length) + rest


@given(
    st.text(st.characters(codec="ascii", exclude_categories=["C"]), min_size=1, max_size=40),
    st.sampled_from(["afarcloud/farm/pose/1", "äcker/süd/pose/12"]),
    st.sampled_from([0, 1, 60, 127, 128, 16_200, 16_383, 16_384, 2_097_152]),
    st.none() | st.text(st.characters(codec="utf-8", exclude_characters="+#\0"), max_size=100),
)
def test_a_packets_size_is_what_goes_over_the_wire(
    key: str, topic: str, length: int, answers_topic: str | None
) -> None:
    packet = RecordPacket(key, topic, topic, b"x" * length, "application/json", answers_topic)
    assert packet.size_bytes() == on_the_wire(packet)


KEY = "01K9Z4T1W8F6Q2M3N5P7R9S0VX"


def test_a_status_is_what_http_would_have_said() -> None:
    answer = {"message_id": KEY, "status": 503, "retry_after_s": 30}
    reply = read_answer(KEY, json.dumps(answer).encode())
    assert isinstance(reply, Answer)
    assert (reply.status, reply.retry_after_s) == (503, 30.0)


def test_a_duplicate_that_the_cloud_has_is_confirmed() -> None:
    answer = {"message_id": KEY, "status": 409, "outcome": "duplicate"}
    assert classify(read_answer(KEY, json.dumps(answer).encode())).outcome is Outcome.CONFIRMED
    answer["outcome"] = "conflict"
    assert classify(read_answer(KEY, json.dumps(answer).encode())).outcome is Outcome.REJECTED


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"200",
        b'"200"',
        b"[200]",
        b"null",
        b"{}",
        b'{"status": true}',
        b'{"status": 200.0}',
        b'{"status": "200"}',
        b'{"status": 99}',
        b'{"status": 600}',
        b'{"status": NaN}',
        b'{"status": 200, "message_id": "another"}',
        b'{"status": 200, "message_id": null}',
        b'{"status": 200',
        b'{"status": 503, "status": 200}',
        b'\xef\xbb\xbf{"status": 200}',
        b"\xff\xfe",
        b"<html>",
        b"[" * 60_000,
        b'{"status": 200}' + b" " * 70_000,
    ],
)
def test_what_is_no_answer_confirms_nothing(payload: bytes) -> None:
    assert isinstance(read_answer(KEY, payload), Unreachable)


@given(st.binary(max_size=200))
def test_no_bytes_break_it(payload: bytes) -> None:
    reply = read_answer(KEY, payload)
    assert not isinstance(reply, Answer) or reply.status


@pytest.mark.parametrize("wish", [None, "soon", True, -1, math.nan, math.inf, 1e300, [], 10**400])
def test_a_strange_wish_is_harmless(wish: object) -> None:
    reply = read_answer(KEY, json.dumps({"status": 503, "retry_after_s": wish}).encode())
    assert isinstance(reply, Answer)
    assert reply.retry_after_s is None or 0.0 <= reply.retry_after_s <= 1e9


NEVER = {0x90, 0x95, 0x99}


def check_acknowledgement(code: int) -> None:
    outcome = classify(reply_to_record(code)).outcome
    if code in NEVER:
        assert outcome is Outcome.REJECTED
    elif code == 0x87:
        assert outcome is Outcome.NO_ACCESS
    elif code == 0x10:
        assert outcome is Outcome.NO_CLOUD
    elif code == 0:
        assert outcome is Outcome.CONFIRMED
    else:
        assert outcome is Outcome.TRY_LATER


def test_every_reason_code_of_an_acknowledgement_has_its_outcome() -> None:
    assert failures(check_acknowledgement, itertools.product(range(256))) == []


@pytest.mark.parametrize("code", [0x84, 0x85, 0x86, 0x87, 0x8A, 0x8C, 0x9B])
def test_a_broker_that_does_not_want_us_is_an_operators_work(code: int) -> None:
    assert classify(reply_to_refusal(code, "no")).outcome is Outcome.NO_ACCESS


@pytest.mark.parametrize("code", [0x80, 0x88, 0x89, 0x97, 0x9C, 0x9D, 0x9F])
def test_a_broker_that_cannot_now_is_waited_for(code: int) -> None:
    reply = reply_to_refusal(code, "no")
    assert isinstance(reply, Unreachable)
    assert reply.reason
