"""Writes one ULog file per flight, from a moment before arming to a moment after disarming."""

from collections.abc import Callable
from typing import Final

from uav_firmware.bus import Queue, Topic
from uav_firmware.cal.log_store import LogStore
from uav_firmware.modules.logger import ulog
from uav_firmware.modules.logger.collector import Collector
from uav_firmware.modules.logger.definitions import (
    Identity,
    changed_parameters,
    definitions,
    snapshot,
)
from uav_firmware.modules.logger.params import LoggerParams
from uav_firmware.modules.logger.states import Logging, wanted
from uav_firmware.modules.logger.streams import HIGH_RATE_BIT, STREAMS
from uav_firmware.modules.logger.writer import LogWriter
from uav_firmware.msg.log import LogStreamChunk, LogStreamRequest
from uav_firmware.msg.status import Severity, StatusText, StorageStatus
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

READS: Final = (
    "vehicle_attitude", "vehicle_local_position", "vehicle_global_position", "estimator_status",
    "sensor_imu", "sensor_baro", "sensor_mag", "sensor_gps", "battery_status",
    "trajectory_setpoint", "vehicle_attitude_setpoint", "vehicle_rates_setpoint",
    "vehicle_torque_thrust_setpoint", "control_allocator_status", "actuator_motors",
    "vehicle_status", "land_detected", "home_position", "mission_progress", "status_text",
    "log_stream_request",
)  # fmt: skip
WRITES: Final = ("status_text", "storage_status", "log_stream")
_CHUNKS_PER_SECOND: Final = 2
_CHUNKS_PER_STORAGE_CHECK: Final = 4
_BYTES_PER_MB: Final = 1_000_000


class LoggerModule:
    """Collects records in every step and writes them twice a second."""

    def __init__(
        self,
        store: LogStore | None,
        *,
        topics: Topics,
        registry: Registry,
        identity: Identity,
        boot_time_utc_us: int,
        step_us: int,
        time_us: Callable[[], int],
    ) -> None:
        """Connect the module to the bus; without a store nothing is logged."""
        self._store = store
        self._writer = (
            None if store is None else LogWriter(store, boot_time_utc_us=boot_time_utc_us)
        )
        self._vehicle_status = topics.vehicle_status
        self._texts = topics.status_text.third
        self._status_text = topics.status_text
        self._storage_status = topics.storage_status
        self._chunks_to_storage_check = 1
        self._registry = registry
        self._identity = identity
        self._streamer = LogStreamer(
            topics.log_stream_request, topics.log_stream, self._definitions
        )
        self._time_us = time_us
        steps_per_second = 1_000_000 // step_us
        self._collector = Collector(topics, steps_per_second)
        self._chunk_steps = steps_per_second // _CHUNKS_PER_SECOND
        self._steps_to_go = self._chunk_steps
        self._began_us = 0
        self._armed_since_chunk = False
        self._armed_before = False
        self._flown = False
        self._reported_unfit: set[str] = set()
        self._logged_parameters = snapshot(registry)
        self._logged_version = registry.version
        self._read_parameters()

    def update(self) -> None:
        """Collect the records of this step; twice a second, write them."""
        if self._writer is None:
            return
        status = self._vehicle_status.value
        if status is not None and status.armed:
            self._armed_since_chunk = True
        if self._collecting:
            self._collector.collect()
        self._steps_to_go -= 1
        if self._steps_to_go == 0:
            self._steps_to_go = self._chunk_steps
            self._write_chunk(self._writer)
            self._publish_storage_status(self._writer)

    def close(self) -> None:
        """Write the remaining records at shutdown."""
        if self._writer is not None:
            self._warn(self._writer.finish(self._collect_chunk(self._writer)))

    def _write_chunk(self, writer: LogWriter) -> None:
        if self._registry.version != self._read_version:
            self._read_parameters()
        self._collecting = self._params.mode >= 0 or self._streamer.is_wanted
        began_us, chunk = self._began_us, self._collect_chunk(writer)
        self._streamer.publish(began_us, chunk)
        self._warn(
            writer.write_chunk(
                chunk,
                began_us=began_us,
                wanted=self._wanted(),
                size_max=self._params.size_max_mb * _BYTES_PER_MB,
                describe=self._describe,
            )
        )
        for name in sorted(self._collector.unfit - self._reported_unfit):
            self._reported_unfit.add(name)
            self._warn(f"Not logged: {name} holds a value that does not fit")

    def _publish_storage_status(self, writer: LogWriter) -> None:
        """Publish the free space of the storage every 2 s."""
        self._chunks_to_storage_check -= 1
        if self._chunks_to_storage_check > 0 or self._store is None:
            return
        self._chunks_to_storage_check = _CHUNKS_PER_STORAGE_CHECK
        try:
            free_bytes = self._store.free_bytes()
        except OSError:
            free_bytes = 0
        self._storage_status.publish(
            StorageStatus(self._time_us(), free_bytes, writer.state is Logging.BROKEN)
        )

    def _collect_chunk(self, writer: LogWriter) -> bytes:
        """Return records, status texts and changed parameters since the previous chunk.

        Without an open file or stream changed parameters are skipped: the definitions of the next
        one contain them.
        """
        now_us = self._time_us()
        self._began_us = now_us
        texts = [ulog.text(t.severity, t.time_us, t.text) for t in self._texts.drain()]
        is_open = writer.writing or self._streamer.is_wanted
        parameters = self._changed_parameters() if is_open else b""
        return b"".join((self._collector.take(now_us), *texts, parameters))

    def _changed_parameters(self) -> bytes:
        """Encode the parameters that changed since the previous chunk."""
        if self._registry.version == self._logged_version:
            return b""
        self._logged_version = self._registry.version
        return changed_parameters(self._registry, self._logged_parameters)

    def _describe(self, began_us: int) -> bytes:
        """Encode the definitions of a new file, and mark the current parameters as logged."""
        self._logged_parameters = snapshot(self._registry)
        self._logged_version = self._registry.version
        return self._definitions(began_us)

    def _definitions(self, began_us: int) -> bytes:
        messages = [stream.message for stream in STREAMS]
        return definitions(began_us, self._identity, self._registry, messages)

    def _wanted(self) -> bool:
        """Whether a log is due now, also when armed only between two calls."""
        status = self._vehicle_status.value
        armed = status is not None and status.armed
        armed = armed or (self._armed_since_chunk and not self._armed_before)
        self._armed_since_chunk = False
        self._flown = self._flown or (self._armed_before and not armed)
        self._armed_before = armed
        return wanted(self._params.mode, armed=armed, flown=self._flown)

    def _read_parameters(self) -> None:
        self._read_version = self._registry.version
        self._params = self._registry.read(LoggerParams)
        self._collecting = self._params.mode >= 0
        self._collector.use_rates(high=bool(self._params.profile & HIGH_RATE_BIT))

    def _warn(self, text: str | None) -> None:
        if text is not None:
            self._status_text.publish(StatusText(self._time_us(), Severity.WARNING, text))


class LogStreamer:
    """Passes chunks to a peer that streams the log, each stream headed by the definitions."""

    def __init__(
        self,
        request: Topic[LogStreamRequest],
        stream: Queue[LogStreamChunk],
        describe: Callable[[int], bytes],
    ) -> None:
        """`describe` encodes the definitions of a stream that begins at a time [us]."""
        self._request = request
        self._stream = stream
        self._describe = describe
        self._number = 0

    @property
    def is_wanted(self) -> bool:
        """Whether a peer has requested a stream."""
        request = self._request.value
        return request is not None and request.number != 0

    def publish(self, began_us: int, chunk: bytes) -> None:
        """Publish a chunk if a peer has requested a stream."""
        request = self._request.value
        number = 0 if request is None else request.number
        if number == 0:
            return
        if number != self._number:
            self._number = number
            definitions = self._describe(began_us)
            self._stream.publish(
                LogStreamChunk(number, began_us, is_definition=True, data=definitions)
            )
        self._stream.publish(LogStreamChunk(number, began_us, is_definition=False, data=chunk))
