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
from uav_firmware.modules.logger.feed import LogFeed
from uav_firmware.modules.logger.params import LoggerParams
from uav_firmware.modules.logger.states import Logging, wanted
from uav_firmware.modules.logger.streams import HIGH_RATE_BIT, STREAMS, LoggerTopics
from uav_firmware.modules.logger.writer import LogWriter
from uav_firmware.msg.log import LogStreamChunk, LogStreamRequest
from uav_firmware.msg.status import StatusText, StorageStatus
from uav_firmware.parameters import Registry

_CHUNKS_PER_SECOND: Final = 2
_TURNS_PER_LOOK: Final = 4  # At the room that is left
_WARNING: Final = 4  # MAV_SEVERITY
_BYTES_PER_MB: Final = 1_000_000


class LoggerModule:
    """Collects records in every step and hands them on twice a second."""

    def __init__(
        self,
        store: LogStore | None,
        *,
        topics: LoggerTopics,
        texts: Queue[StatusText],
        status_text: Queue[StatusText],
        stream_request: Topic[LogStreamRequest],
        stream: Queue[LogStreamChunk],
        registry: Registry,
        identity: Identity,
        boot_time_utc_us: int,
        step_us: int,
        time_us: Callable[[], int],
        storage_status: Topic[StorageStatus],
    ) -> None:
        """Take what is read (`texts`, `stream_request`) and written (the others).

        Without a store nothing is logged.
        """
        self._store = store
        self._writer = (
            None if store is None else LogWriter(store, boot_time_utc_us=boot_time_utc_us)
        )
        self._vehicle_status = topics.vehicle_status
        self._texts = texts
        self._status_text = status_text
        self._storage_status = storage_status
        self._room_turns_to_go = 1
        self._registry = registry
        self._identity = identity
        self._feed = LogFeed(stream_request, stream, self._definitions)
        self._time_us = time_us
        steps_per_second = 1_000_000 // step_us
        self._collector = Collector(topics, steps_per_second)
        self._chunk_steps = steps_per_second // _CHUNKS_PER_SECOND
        self._steps_to_go = self._chunk_steps
        self._began_us = 0
        self._armed_lately = False
        self._armed_before = False
        self._flown = False
        self._said_unfit: set[str] = set()
        self._logged_parameters = snapshot(registry)
        self._logged_version = registry.version
        self._retune()

    def update(self) -> None:
        """Collect what is due in this step; twice a second, hand it on."""
        if self._writer is None:
            return
        status = self._vehicle_status.value
        if status is not None and status.armed:
            self._armed_lately = True
        if self._collecting:
            self._collector.collect()
        self._steps_to_go -= 1
        if self._steps_to_go == 0:
            self._steps_to_go = self._chunk_steps
            self._turn(self._writer)
            self._tell_room(self._writer)

    def close(self) -> None:
        """Write what is left: the vehicle is being switched off."""
        if self._writer is not None:
            self._warn(self._writer.finish(self._take_chunk(self._writer)))

    def _turn(self, writer: LogWriter) -> None:
        if self._registry.version != self._read_version:
            self._retune()
        self._collecting = self._params.mode >= 0 or self._feed.is_wanted
        began_us, chunk = self._began_us, self._take_chunk(writer)
        self._feed.pass_on(began_us, chunk)
        self._warn(
            writer.turn(
                chunk,
                began_us=began_us,
                wanted=self._wanted(),
                size_max=self._params.size_max_mb * _BYTES_PER_MB,
                describe=self._describe,
            )
        )
        for name in sorted(self._collector.unfit - self._said_unfit):
            self._said_unfit.add(name)
            self._warn(f"Not logged: {name} holds a value that does not fit")

    def _tell_room(self, writer: LogWriter) -> None:
        """Every 2 s: how much room the medium has."""
        self._room_turns_to_go -= 1
        if self._room_turns_to_go > 0 or self._store is None:
            return
        self._room_turns_to_go = _TURNS_PER_LOOK
        try:
            free_bytes = self._store.free_bytes()
        except OSError:
            free_bytes = 0
        self._storage_status.publish(
            StorageStatus(self._time_us(), free_bytes, writer.state is Logging.BROKEN)
        )

    def _take_chunk(self, writer: LogWriter) -> bytes:
        """Records, sentences and changed parameters since the former chunk.

        A file that is yet to begin will hold the present parameters anyway.
        """
        now_us = self._time_us()
        self._began_us = now_us
        texts = [ulog.text(t.severity, t.time_us, t.text) for t in self._texts.drain()]
        told = writer.writing or self._feed.is_wanted
        parameters = self._changed_parameters() if told else b""
        return b"".join((self._collector.take(now_us), *texts, parameters))

    def _changed_parameters(self) -> bytes:
        """Parameters changed since the former chunk; looked through only if there is one."""
        if self._registry.version == self._logged_version:
            return b""
        self._logged_version = self._registry.version
        return changed_parameters(self._registry, self._logged_parameters)

    def _describe(self, began_us: int) -> bytes:
        """First part of a file; what it tells of the parameters need not be told again."""
        self._logged_parameters = snapshot(self._registry)
        self._logged_version = self._registry.version
        return self._definitions(began_us)

    def _definitions(self, began_us: int) -> bytes:
        messages = [stream.message for stream in STREAMS]
        return definitions(began_us, self._identity, self._registry, messages)

    def _wanted(self) -> bool:
        """Whether this turn wants a log, also of an armed time that lay between two turns."""
        status = self._vehicle_status.value
        armed = status is not None and status.armed
        armed = armed or (self._armed_lately and not self._armed_before)
        self._armed_lately = False
        self._flown = self._flown or (self._armed_before and not armed)
        self._armed_before = armed
        return wanted(self._params.mode, armed=armed, flown=self._flown)

    def _retune(self) -> None:
        self._read_version = self._registry.version
        self._params = self._registry.read(LoggerParams)
        self._collecting = self._params.mode >= 0
        self._collector.use_rates(high=bool(self._params.profile & HIGH_RATE_BIT))

    def _warn(self, sentence: str | None) -> None:
        if sentence is not None:
            self._status_text.publish(StatusText(self._time_us(), _WARNING, sentence))
