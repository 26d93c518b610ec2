"""The cloud over MQTT 5, with the promises of HTTP: an answer of the cloud for each record.

Records go out one topic per stream, one at a time in each, all streams side by side; as batches
once the cloud has said, in a user property `Accept-Batch` of an answer, how many it takes at once.
"""

import time
from collections.abc import Callable, Sequence
from random import Random
from typing import Final

from edge_server.config import Config
from edge_server.outbox import batches
from edge_server.outbox.answers import Answer, Reply
from edge_server.outbox.queue import Parcel
from edge_server.outbox.retry import Backoff
from edge_server.outbox.uplink import MOST, Offer
from edge_server.uplinks.mqtt_connection import BrokerSettings
from edge_server.uplinks.mqtt_link import Link
from edge_server.uplinks.mqtt_login import own_client_id
from edge_server.uplinks.mqtt_messages import RecordPacket
from edge_server.uplinks.mqtt_session import Session
from edge_server.uplinks.mqtt_topics import read_address

NO_BATCHES_S: Final = 600.0
"""How long an offer of batches is not believed after a batch was refused as a whole."""
_BATCH_REFUSED: Final = frozenset({400, 404, 405, 410, 413, 415, 422, 501})
_BATCH_HEADROOM_BYTES: Final = 8192  # Kinds, topic and properties beside the records
_SMALLEST_BATCH_BYTES: Final = 8192


class MqttUplink:
    """An Uplink over one connection to a broker."""

    def __init__(self, config: Config, *, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._settings = broker_settings(config)
        self._monotonic = monotonic
        self._no_batches_until = float("-inf")
        self._session = Session(
            backoff=Backoff(config.backoff_base_s, config.backoff_cap_s),
            refused_wait_s=config.probe_interval_s,
            connect_patience_s=config.connect_timeout_s,
            answer_patience_s=config.read_timeout_s,
            random=Random(),
        )
        self._link = Link(self._settings, self._session)

    def offer(self) -> Offer:
        """As much as anybody, or what the cloud and the broker take as one packet."""
        return self._batch_offer() or MOST

    def send(self, parcels: Sequence[Parcel]) -> list[Reply]:
        """Send records and wait for what the cloud, or the broker, says to each.

        Raises:
            LinkEndedError: if the connection's thread has died.
        """
        offer = self._batch_offer()
        if offer is not None and 1 < len(parcels) <= offer.records:
            replies = self._send_batch(parcels)
            if replies is not None:
                return replies
            self._no_batches_until = self._monotonic() + NO_BATCHES_S
        return self._link.deliver([self._packet(parcel) for parcel in parcels])

    def close(self) -> None:
        """Leave the broker in order, if that is quick; a `send` under way ends with a reason."""
        self._link.close()

    def _batch_offer(self) -> Offer | None:
        records = min(self._session.accept_batch, MOST.records)
        size = min(MOST.size_bytes, self._session.limits.packet_bytes - _BATCH_HEADROOM_BYTES)
        if records < 2 or size < _SMALLEST_BATCH_BYTES:
            return None
        return Offer(records, size) if self._monotonic() >= self._no_batches_until else None

    def _send_batch(self, parcels: Sequence[Parcel]) -> list[Reply] | None:
        """None when batches are refused, or answered with what is no answer to them."""
        key = f"batch-{parcels[0].message_id}"
        topic = self._settings.address.batch_topic
        payload = batches.write(parcels)
        packet = RecordPacket(key, key, topic, payload, batches.MEDIA_TYPE, self._answers_topic)
        (reply,) = self._link.deliver([packet])
        if isinstance(reply, Answer) and reply.status in _BATCH_REFUSED:
            return None
        return batches.read(reply, parcels)

    def _packet(self, parcel: Parcel) -> RecordPacket:
        topic = self._settings.address.record_topic(parcel.stream)
        payload = parcel.payload.encode()
        key = parcel.message_id
        return RecordPacket(key, topic, topic, payload, batches.JSON, self._answers_topic)

    @property
    def _answers_topic(self) -> str | None:
        if not self._settings.hears_answers:
            return None
        return self._settings.address.answers_topic(self._settings.client_id)


def broker_settings(config: Config) -> BrokerSettings:
    """What the configuration says about the broker."""
    return BrokerSettings(
        address=read_address(config.cloud_url),
        client_id=config.mqtt_client_id or own_client_id(config.edge_dir / "mqtt-client-id"),
        hears_answers=config.mqtt_confirm == "cloud",
        login_file=config.cloud_key_file,
        ca_file=config.cloud_ca_file,
        fingerprint=config.cloud_fingerprint,
        certificate_file=config.cloud_client_certificate_file,
        connect_timeout_s=config.connect_timeout_s,
        packet_timeout_s=config.read_timeout_s,
        keep_alive_s=config.mqtt_keep_alive_s,
    )
