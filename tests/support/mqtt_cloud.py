"""The cloud of `fake_cloud` at the end of a broker: the same store, the same faults.

A fault sees a handler of the same shape. What HTTP does by cutting the connection, it does by
publishing nothing; a fault has a thread of its own, so one that waits delays no other.
"""

import json
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, cast

from paho.mqtt.client import Client, ConnectFlags, MQTTMessage, MQTTv5
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from tests.support.fake_cloud import Handler, Received, Store
from tests.support.polling import PATIENCE_S

ROOT = "afarcloud/farm"


class MqttHandler:
    """Answers one message."""

    def __init__(self, cloud: "MqttCloud", message: MQTTMessage) -> None:
        self.store = cloud.store
        self._client = cloud.client
        self._properties = message.properties

    def answer(
        self,
        status: int,
        body: bytes = b"{}",
        content_type: str = "application/json",
        headers: Mapping[str, str] | None = None,
    ) -> None:
        if content_type != "application/json" or body != b"{}":
            self.publish(body)
            return
        key = self._properties.CorrelationData.decode()  # type: ignore[union-attr]  # paho's are loose
        answered: dict[str, Any] = {"message_id": key, "status": status}
        if headers and "Retry-After" in headers:
            answered["retry_after_s"] = float(headers["Retry-After"])
        self.publish(json.dumps(answered).encode())

    def publish(self, payload: bytes) -> None:
        properties: Any = Properties(PacketTypes.PUBLISH)  # type: ignore[no-untyped-call]
        properties.CorrelationData = self._properties.CorrelationData  # type: ignore[union-attr]
        topic = self._properties.ResponseTopic  # type: ignore[union-attr]
        self._client.publish(topic, payload, 1, properties=properties)

    def reset(self) -> None:
        """Publish no answer."""


class MqttCloud:
    """Subscribes to a farm's topics until it is closed; what it keeps survives."""

    def __init__(self, port: int, *, user: str | None = None, password: str | None = None) -> None:
        self.store = Store()
        self._subscribed = threading.Event()
        self.presence: list[tuple[str, str]] = []  # Topic and status, in order
        self.client = Client(CallbackAPIVersion.VERSION2, "fake-cloud", protocol=MQTTv5)
        if user is not None:
            self.client.username_pw_set(user, password)
        self.client.reconnect_delay_set(0.05, 0.2)  # type: ignore[arg-type]  # it takes fractions
        self.client.on_connect = self._on_connect
        self.client.on_subscribe = lambda *_: self._subscribed.set()
        self.client.on_disconnect = lambda *_: self._subscribed.clear()
        self.client.on_message = self._on_message
        self._port = port

    def start(self) -> "MqttCloud":
        self.client.connect_async("127.0.0.1", self._port)
        self.client.loop_start()
        return self

    def wait_until_it_listens(self) -> None:
        assert self._subscribed.wait(PATIENCE_S), "the cloud never got to the broker"

    def stop(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()

    def _on_connect(
        self, client: Client, _: Any, __: ConnectFlags, reason: ReasonCode, ___: Any
    ) -> None:
        if not reason.is_failure:
            client.subscribe(f"{ROOT}/+/+", qos=1)

    def _on_message(self, _client: Client, _: Any, message: MQTTMessage) -> None:
        kind, rest = message.topic.removeprefix(f"{ROOT}/").split("/", 1)
        if kind == "gateways":
            self.presence.append((rest, json.loads(message.payload)["status"]))
        elif kind != "answers":
            self._receive(kind, message)

    def _receive(self, kind: str, message: MQTTMessage) -> None:
        headers = dict(getattr(message.properties, "UserProperty", ()))
        headers["Content-Type"] = getattr(message.properties, "ContentType", "")
        headers["Topic"] = message.topic
        received = Received(
            f"/{kind}",
            headers["Idempotency-Key"],
            headers,
            json.loads(message.payload),
            time.monotonic(),
        )
        handler = cast("Handler", MqttHandler(self, message))
        fault = self.store.see(received)
        if fault is not None:
            threading.Thread(target=fault, args=(handler, received), daemon=True).start()
            return
        self.store.keep(received)
        if hasattr(message.properties, "ResponseTopic"):
            handler.answer(200)


@contextmanager
def running_mqtt_cloud(port: int, **login: str) -> Iterator[MqttCloud]:
    """Run a cloud for a while."""
    cloud = MqttCloud(port, **login).start()
    try:
        yield cloud
    finally:
        cloud.stop()
