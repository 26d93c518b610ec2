"""The mock cloud as an MQTT 5 client: stores the messages of its topics and answers them.

A message is acknowledged to the broker only after it has been stored and answered, and the session
expires after an hour, so that a cloud that is killed receives the messages sent meanwhile.
"""

import json
import logging
import socket
import ssl
import time
from typing import Any, Final
from urllib.parse import unquote, urlsplit

from paho.mqtt.client import Client, ConnectFlags, MQTTMessage, MQTTv5
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from sim.cloud.mqtt_requests import BATCH, MOST_RECORDS, Request, answer
from sim.cloud.store import KINDS, Store

LOG = logging.getLogger(__name__)
SESSION_KEPT_S: Final = 3600
KEEP_ALIVE_S: Final = 30
_PORTS: Final = {"mqtt": 1883, "mqtts": 8883}
_QOS: Final = 1


class MqttReceiver:
    """Receives records from a broker until it is closed."""

    def __init__(self, store: Store, url: str, login: str | None = None) -> None:
        """Set the broker's address and a login as `user:password` if it requires one."""
        parts = urlsplit(url)
        self._store = store
        self._root = unquote(parts.path).strip("/") or "afarcloud/farm"
        self._client = Client(
            CallbackAPIVersion.VERSION2, "mock-cloud", protocol=MQTTv5, manual_ack=True
        )
        self._client.reconnect_delay_set(1, 5)
        if login is not None:
            user, _, password = login.partition(":")
            self._client.username_pw_set(user, password)
        self._client.on_socket_open = _set_low_delay
        self._client.on_connect = self._on_connect
        self._client.on_publish = _on_publish
        self._client.on_message = self._on_message
        if parts.scheme == "mqtts":
            self._client.tls_set_context(ssl.create_default_context())
        hello = _properties(PacketTypes.CONNECT)
        hello.SessionExpiryInterval = SESSION_KEPT_S
        self._client.connect_async(
            parts.hostname or "127.0.0.1",
            parts.port or _PORTS[parts.scheme],
            KEEP_ALIVE_S,
            clean_start=False,
            properties=hello,
        )

    def open(self) -> None:
        """Connect; the broker may start later."""
        self._client.loop_start()

    def close(self) -> None:
        """Disconnect; the broker keeps the session."""
        self._client.disconnect()
        self._client.loop_stop()

    def _on_connect(
        self, client: Client, _: Any, __: ConnectFlags, reason: ReasonCode, ___: Any
    ) -> None:
        if reason.is_failure:
            LOG.error("the MQTT broker refuses the connection: %s", reason)
            return
        topics = [f"{self._root}/{kind}/+" for kind in KINDS] + [f"{self._root}/{BATCH}"]
        client.subscribe([(topic, _QOS) for topic in topics])
        LOG.info("listening over MQTT under %s", self._root)

    def _on_message(self, client: Client, _: Any, message: MQTTMessage) -> None:
        key = getattr(message.properties, "CorrelationData", b"").decode("ascii", "replace")
        topic = message.topic.removeprefix(f"{self._root}/")
        answered = answer(self._store, Request(topic, key, bytes(message.payload)), time.time())
        answers_topic = getattr(message.properties, "ResponseTopic", "")
        # A sender may not make the cloud publish on any other topic
        if answers_topic.startswith(f"{self._root}/answers/"):
            properties = _properties(PacketTypes.PUBLISH)
            properties.ContentType = "application/json"
            properties.CorrelationData = key.encode()
            properties.UserProperty = ("Accept-Batch", str(MOST_RECORDS))
            client.publish(answers_topic, json.dumps(answered), _QOS, properties=properties)
        client.ack(message.mid, message.qos)


def _on_publish(client: Client, *_: Any) -> None:
    """Disable delayed TCP acknowledgements again, which cost the next record 40 ms."""
    _set_low_delay(client, None, client.socket())


def _set_low_delay(_: Client, __: Any, opened: Any) -> None:
    """Disable Nagle's algorithm and, on Linux, delayed acknowledgements: answers are small."""
    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    if hasattr(socket, "TCP_QUICKACK"):
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)


def _properties(packet_type: int) -> Any:
    """Properties of a packet; paho has no types for them."""
    return Properties(packet_type)  # type: ignore[no-untyped-call]
