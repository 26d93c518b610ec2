"""Broker and topics from the cloud's address; what the configuration accepts can be read."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge_server.config import ConfigError, load
from edge_server.outbox.queue import Stream
from edge_server.uplinks.mqtt_topics import is_mqtt, read_address


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
