"""Where things are in MQTT: broker and topics, read from the cloud's address; pure.

mqtts://broker.example:8883/afarcloud/north-farm
                            <root>

<root>/<kind>/<vehicle_id>   records, one topic per stream
<root>/answers/<client id>   the cloud's answers to one gateway
<root>/gateways/<client id>  whether that gateway is online (retained, Will)
"""

from typing import Final, NamedTuple
from urllib.parse import unquote, urlsplit

from edge_server.outbox.queue import Stream

DEFAULT_ROOT: Final = "afarcloud/farm"
_PORTS: Final = {"mqtt": 1883, "mqtts": 8883}


class MqttAddress(NamedTuple):
    """A broker, and the level under which a farm's topics lie."""

    host: str
    port: int
    tls: bool
    root: str

    def record_topic(self, stream: Stream) -> str:
        """Topic of a stream's records."""
        return f"{self.root}/{stream.kind}/{stream.vehicle_id}"

    @property
    def batch_topic(self) -> str:
        """Topic of batches of records."""
        return f"{self.root}/batch"

    def answers_topic(self, client_id: str) -> str:
        """Topic on which the cloud answers a gateway."""
        return f"{self.root}/answers/{client_id}"

    def presence_topic(self, client_id: str) -> str:
        """Topic that tells whether a gateway is online."""
        return f"{self.root}/gateways/{client_id}"


def is_mqtt(url: str) -> bool:
    """Tell whether an address of the cloud means this uplink."""
    return urlsplit(url).scheme in _PORTS


def read_address(url: str) -> MqttAddress:
    """Read `mqtt://` or `mqtts://`; what the configuration has accepted cannot fail here."""
    parts = urlsplit(url)
    root = unquote(parts.path).strip("/") or DEFAULT_ROOT
    port = parts.port or _PORTS[parts.scheme]
    return MqttAddress(parts.hostname or "", port, parts.scheme == "mqtts", root)
