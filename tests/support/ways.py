"""Two ways from a relay to a cloud that can be told to misbehave: HTTP, and MQTT over Mosquitto."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from tests.support.fake_cloud import FakeCloud, Store, running_cloud
from tests.support.mosquitto import Mosquitto, running_mosquitto
from tests.support.mqtt_cloud import MqttCloud, running_mqtt_cloud


class Way(Protocol):
    """A cloud and the way to it."""

    @property
    def url(self) -> str:
        """What CLOUD_URL is set to."""

    @property
    def store(self) -> Store:
        """What the cloud has seen and kept, and its faults."""

    def cut(self) -> None:
        """Make the cloud unreachable at once."""

    def restore(self) -> None:
        """Make it reachable again."""


class HttpWay:
    """Straight to the cloud."""

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


class MqttWay:
    """Over a broker, which can be killed and started again."""

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
def mqtt_way(folder: Path, *lines: str) -> Iterator[MqttWay]:
    """A broker with these lines of configuration, and a cloud that listens to it."""
    with running_mosquitto(folder, *lines) as broker, running_mqtt_cloud(broker.port) as cloud:
        cloud.wait_until_it_listens()
        yield MqttWay(broker, cloud)


@contextmanager
def way(name: str, folder: Path) -> Iterator[Way]:
    """The way of this name: `http` or `mqtt`."""
    if name == "mqtt":
        with mqtt_way(folder) as over_mqtt:
            yield over_mqtt
    else:
        with running_cloud() as cloud:
            yield HttpWay(cloud)
