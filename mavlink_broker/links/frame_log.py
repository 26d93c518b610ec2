"""Logs every frame of the vehicles' links to `.tlog` files, which ground stations replay.

A record is the time in microseconds since 1970, big-endian in 8 bytes, and the frame as it was on
the link, signature included: what QGroundControl, MAVProxy and pymavlink write and read. Messages
that carry keys or passwords are left out, and the data of vehicles' own logs.

A thread writes from a bounded buffer: a slow or full disk never delays a frame. Frames that cannot
be written are counted and logged once, and writing is retried.

The files lie in a folder with a limit: they grow by whole records, rotate by size, and the oldest
are deleted. `copy_frames` reads the records of one vehicle out of them again.
"""

import logging
import os
import struct
import threading
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, Final

from mavlink_broker.mavlink.codec import Decoder, frame_size, message_id, sender
from mavlink_broker.mavlink.dialect import ADDRESSED, mavlink
from mavlink_broker.supervision import SupervisedThread

SUFFIX: Final = ".tlog"
_NAME: Final = "%Y-%m-%d_%H-%M-%S"
_LOG = logging.getLogger(__name__)
FLUSH_INTERVAL_S: Final = 0.5
RETRY_INTERVAL_S: Final = 5.0
"""Pause after a write error."""
CLOSE_TIMEOUT_S: Final = 5.0
"""How long `close` waits for a slow disk."""
BUFFER_BYTES: Final = 4 << 20
"""Buffer for a slow disk: some minutes of twenty vehicles."""
SECRET_MESSAGES: Final = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_SETUP_SIGNING,
        mavlink.MAVLINK_MSG_ID_AUTH_KEY,
        mavlink.MAVLINK_MSG_ID_WIFI_CONFIG_AP,
    }
)
"""Messages that contain keys or passwords."""
LEFT_OUT: Final = SECRET_MESSAGES | {mavlink.MAVLINK_MSG_ID_LOG_DATA}
"""The log of a flight would push the frames of several flights out of the files."""
_OF_FILES: Final = frozenset({mavlink.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL})
_STAMP: Final = struct.Struct(">Q")
_CHUNK_BYTES: Final = 1 << 20


class FrameFiles:
    """Appends to the newest file and deletes the oldest when there are too many."""

    def __init__(self, folder: Path, *, file_bytes: int, files: int) -> None:
        self._folder = folder
        self._file_bytes = file_bytes
        self._files = files
        self._descriptor: int | None = None
        self._size = 0

    def append(self, records: bytes, time: datetime) -> None:
        """Write whole records; all of them, or nothing.

        Raises:
            OSError: if the write fails; the file then ends as before.
        """
        descriptor = self._descriptor
        if descriptor is None or self._size >= self._file_bytes:
            descriptor = self._begin(time)
        written = 0
        try:
            while written < len(records):
                written += os.write(descriptor, records[written:])
        except OSError:
            self._truncate(descriptor)
            raise
        self._size += written

    def close(self) -> None:
        """Close the file."""
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = None

    def _begin(self, time: datetime) -> int:
        self.close()
        self._folder.mkdir(parents=True, exist_ok=True)
        self._prune()
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND
        for number in range(1, 1000):
            name = time.strftime(_NAME) + (f"_{number}" if number > 1 else "") + SUFFIX
            with suppress(FileExistsError):
                self._descriptor = descriptor = os.open(self._folder / name, flags, 0o644)
                self._size = 0
                return descriptor
        raise FileExistsError(f"{self._folder} has a thousand files of one second")

    def _prune(self) -> None:
        """Delete the oldest files so that one more fits."""
        paths = sorted(self._folder.glob(f"*{SUFFIX}"), key=_age)
        for path in paths[: max(0, len(paths) - self._files + 1)]:
            with suppress(FileNotFoundError):
                path.unlink()

    def _truncate(self, descriptor: int) -> None:
        """Truncate to the last whole record; if that fails, the next record starts a new file."""
        try:
            os.ftruncate(descriptor, self._size)
        except OSError as error:
            _LOG.warning("a frame log ends with an incomplete record: %s", error.strerror)
            self.close()


def _age(path: Path) -> tuple[int, str]:
    """Sort key: oldest first."""
    try:
        return path.stat().st_mtime_ns, path.name
    except FileNotFoundError:
        return 0, path.name


def copy_frames(folder: Path, system: int, begin: datetime, end: datetime, output: BinaryIO) -> int:
    """Copy the records of a vehicle from a folder's files; returns their size in bytes.

    These are the frames from `begin` to `end` that the vehicle has sent, and those that were sent
    to it or to all systems, without those of files: pictures are ten times what else a survey
    sends, and are kept themselves. A file is read up to its first incomplete record.

    Raises:
        OSError: if a file cannot be read, or `output` not be written.
    """
    first, last = (round(one.timestamp() * 1e6) for one in (begin, end))
    size = 0
    for path in sorted(folder.glob(f"*{SUFFIX}"), key=_age):
        if _age(path)[0] >= first * 1000:  # Else its last record is older
            with suppress(FileNotFoundError), path.open("rb") as file:  # It may be pruned now
                size += _copy_records(file, system, range(first, last + 1), output)
    return size


def _copy_records(file: BinaryIO, system: int, times: range, output: BinaryIO) -> int:
    decoder, size = Decoder(), 0
    for record in _records(file):
        frame = record[_STAMP.size :]
        (stamp,) = _STAMP.unpack_from(record)
        if stamp not in times or message_id(frame) in _OF_FILES:
            continue
        if sender(frame)[0] == system or _is_to(frame, system, decoder):
            size += output.write(record)
    return size


def _records(file: BinaryIO) -> Iterator[bytes]:
    """Read a file record by record, up to the first one that is incomplete."""
    data, position = b"", 0
    while chunk := file.read(_CHUNK_BYTES):
        data, position = data[position:] + chunk, 0
        while len(data) - position > _STAMP.size:
            length = frame_size(data, position + _STAMP.size)
            if length == 0:
                return
            if length is None or position + _STAMP.size + length > len(data):
                break
            begin, position = position, position + _STAMP.size + length
            yield data[begin:position]


def _is_to(frame: bytes, system: int, decoder: Decoder) -> bool:
    """Whether another system has sent a frame to a vehicle, or to all."""
    if message_id(frame) not in ADDRESSED:
        return False
    return any(message.target_system in {0, system} for message in decoder.decode(frame))


class FrameLog:
    """A buffer that takes any frame at once, and a thread that writes it to the disk."""

    def __init__(self, folder: Path, *, file_bytes: int, files: int) -> None:
        """Write into a folder at most `files` files of `file_bytes` each."""
        self._folder = folder
        self._store = FrameFiles(folder, file_bytes=file_bytes, files=files)
        self._lock = threading.Lock()
        self._waiting = bytearray()
        self._count = 0
        self._stop = threading.Event()
        self._is_refused = False
        self.dropped = 0  # Frames that could not be written
        self._thread = SupervisedThread("frame-log", self._run, self._stop)
        self._thread.start()

    def write(self, frame: bytes, time: datetime) -> None:
        """Add a frame to the buffer; never waits for the disk."""
        if message_id(frame) in LEFT_OUT:
            return
        stamp = _STAMP.pack(max(0, round(time.timestamp() * 1e6)))
        with self._lock:
            if len(self._waiting) > BUFFER_BYTES:
                self.dropped += 1
                return
            self._waiting += stamp
            self._waiting += frame
            self._count += 1

    def close(self) -> None:
        """Write the buffer, if the disk takes it, and end the thread."""
        self._stop.set()
        self._thread.join(CLOSE_TIMEOUT_S)

    def _run(self) -> None:
        pause_s = FLUSH_INTERVAL_S
        while not self._stop.wait(pause_s):
            pause_s = FLUSH_INTERVAL_S if self._flush() else RETRY_INTERVAL_S
        self._flush()
        self._store.close()

    def _flush(self) -> bool:
        """Write the buffer; false after a write error."""
        with self._lock:
            records, self._waiting = bytes(self._waiting), bytearray()
            count, self._count = self._count, 0
        if not records:
            return True
        try:
            self._store.append(records, datetime.now(UTC))
        except OSError as error:
            self._refused(error, count)
            return False
        if self._is_refused:
            self._is_refused = False
            _LOG.warning(
                "frames are logged in %s again; %d are missing", self._folder, self.dropped
            )
        return True

    def _refused(self, error: OSError, count: int) -> None:
        with self._lock:
            self.dropped += count
        if not self._is_refused:
            _LOG.warning("no frames are logged in %s: %s", self._folder, error.strerror or error)
        self._is_refused = True
