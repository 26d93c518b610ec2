"""The size of a packet as we count it and as paho writes it."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties, VariableByteIntegers

from edge_server.uplinks.mqtt_messages import IDEMPOTENCY_KEY, RecordPacket


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
