"""Links from a relay to a cloud with injected faults: HTTP, and MQTT over Mosquitto."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from tests.support.fake_cloud import FakeCloud, Store, running_cloud
from tests.support.mosquitto import Mosquitto, running_mosquitto
from tests.support.mqtt_cloud import MqttCloud, running_mqtt_cloud


class CloudLink(Protocol):
    """A cloud and the link to it."""

    @property
    def url(self) -> str:
        """The value of CLOUD_URL."""

    @property
    def store(self) -> Store:
        """The requests that the cloud has received and stored, and its faults."""

    def cut(self) -> None:
        """Make the cloud unreachable at once."""

    def restore(self) -> None:
        """Make it reachable again."""


class HttpLink:
    """HTTP directly to the cloud."""

    def __init__(self, cloud: FakeCloud) -> None:
        self._cloud = cloud
        self.store = cloud.store

    @property
    def url(self) -> str:
        return self._cloud.url

    def cut(self) -> None:
        self._cloud.stop()

    def restore(self) -> None:
        self._cloud.start()


class MqttLink:
    """MQTT over a broker, which can be killed and restarted."""

    def __init__(self, broker: Mosquitto, cloud: MqttCloud) -> None:
        self.broker = broker
        self.cloud = cloud
        self.store = cloud.store
        self.url = broker.url

    def cut(self) -> None:
        self.broker.kill()

    def restore(self) -> None:
        self.broker.start()


@contextmanager
def mqtt_link(folder: Path, *lines: str) -> Iterator[MqttLink]:
    """A broker with these lines of configuration, and a cloud that subscribes to it."""
    with running_mosquitto(folder, *lines) as broker, running_mqtt_cloud(broker.port) as cloud:
        cloud.wait_until_it_listens()
        yield MqttLink(broker, cloud)


@contextmanager
def cloud_link(name: str, folder: Path) -> Iterator[CloudLink]:
    """The link of this name: `http` or `mqtt`."""
    if name == "mqtt":
        with mqtt_link(folder) as link:
            yield link
    else:
        with running_cloud() as cloud:
            yield HttpLink(cloud)
