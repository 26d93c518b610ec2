"""The cloud over MQTT 5, with the guarantees of HTTP: an answer of the cloud for each record.

Records are published on one topic per stream, one at a time in each, all streams in parallel. They
are sent in batches once the cloud has stated, in a user property `Accept-Batch` of an answer, how
many it accepts at once.
"""

import time
from collections.abc import Callable, Sequence
from random import Random
from typing import Final

from edge_server.config import Config
from edge_server.outbox.answers import Answer, Reply
from edge_server.outbox.queue import OutboxRecord
from edge_server.outbox.retry import Backoff
from edge_server.outbox.uplink import MAXIMUM_BATCH, BatchLimit
from edge_server.uplinks import batches
from edge_server.uplinks.mqtt_connection import BrokerSettings, own_client_id
from edge_server.uplinks.mqtt_link import Link
from edge_server.uplinks.mqtt_protocol import RecordPacket, read_address
from edge_server.uplinks.mqtt_session import Session

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
            connect_timeout_s=config.connect_timeout_s,
            answer_timeout_s=config.read_timeout_s,
            random=Random(),
        )
        self._link = Link(self._settings, self._session)

    def batch_limit(self) -> BatchLimit:
        """Return what the cloud and the broker accept as one packet, else the general maximum."""
        return self._packet_limit() or MAXIMUM_BATCH

    def send(self, records: Sequence[OutboxRecord]) -> list[Reply]:
        """Send records and wait for the reply of the cloud, or of the broker, to each.

        Raises:
            LinkEndedError: if the connection's thread has died.
        """
        limit = self._packet_limit()
        if limit is not None and 1 < len(records) <= limit.records:
            replies = self._send_batch(records)
            if replies is not None:
                return replies
            self._no_batches_until = self._monotonic() + batches.NO_BATCHES_S
        return self._link.deliver([self._packet(record) for record in records])

    def close(self) -> None:
        """Disconnect in order if that is quick; a `send` in flight ends with a reason."""
        self._link.close()

    def _packet_limit(self) -> BatchLimit | None:
        records = min(self._session.accept_batch, MAXIMUM_BATCH.records)
        packet_bytes = self._session.limits.packet_bytes - _BATCH_HEADROOM_BYTES
        size = min(MAXIMUM_BATCH.size_bytes, packet_bytes)
        if records < 2 or size < _SMALLEST_BATCH_BYTES:
            return None
        return BatchLimit(records, size) if self._monotonic() >= self._no_batches_until else None

    def _send_batch(self, records: Sequence[OutboxRecord]) -> list[Reply] | None:
        """Send a batch; None if it is refused as a whole, or the answer does not fit it."""
        key = f"batch-{records[0].message_id}"
        topic = self._settings.address.batch_topic
        payload = batches.write(records)
        packet = RecordPacket(key, key, topic, payload, batches.MEDIA_TYPE, self._answers_topic)
        (reply,) = self._link.deliver([packet])
        if isinstance(reply, Answer) and reply.status in batches.REFUSED:
            return None
        return batches.read(reply, records)

    def _packet(self, record: OutboxRecord) -> RecordPacket:
        topic = self._settings.address.record_topic(record.stream)
        payload = record.payload.encode()
        key = record.message_id
        return RecordPacket(key, topic, topic, payload, batches.JSON, self._answers_topic)

    @property
    def _answers_topic(self) -> str | None:
        if not self._settings.reads_answers:
            return None
        return self._settings.address.answers_topic(self._settings.client_id)


def broker_settings(config: Config) -> BrokerSettings:
    """Return the configuration of the broker."""
    return BrokerSettings(
        address=read_address(config.cloud_url),
        client_id=config.mqtt_client_id or own_client_id(config.edge_dir / "mqtt-client-id"),
        reads_answers=config.mqtt_confirm == "cloud",
        login_file=config.cloud_key_file,
        ca_file=config.cloud_ca_file,
        fingerprint=config.cloud_fingerprint,
        certificate_file=config.cloud_client_certificate_file,
        connect_timeout_s=config.connect_timeout_s,
        packet_timeout_s=config.read_timeout_s,
        keep_alive_s=config.mqtt_keep_alive_s,
    )
