"""Every frame of the vehicles' links in files that ground stations replay: `.tlog`.

A record is the time in microseconds since 1970, big-endian in 8 bytes, and the frame as it was on
the link, signature included: what QGroundControl, MAVProxy and pymavlink write and read. Messages
that carry keys or passwords are left out.

Writing is a thread's work, from a bounded buffer: a slow or full disk never delays a frame. What
cannot be kept is counted and told once; then it is tried again.
"""

import logging
import struct
import threading
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from mavlink_broker.links.tlog_files import FrameFiles
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.frames import message_id
from mavlink_broker.supervision import SupervisedThread

FLUSH_EVERY_S: Final = 0.5
TRY_AGAIN_S: Final = 5.0
"""After the disk has refused."""
END_WITHIN_S: Final = 5.0
"""How long an ending program waits for a slow disk."""
BUFFER_BYTES: Final = 4 << 20
"""What may wait for a slow disk: some minutes of twenty vehicles."""
SECRETS: Final = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_SETUP_SIGNING,
        mavlink.MAVLINK_MSG_ID_AUTH_KEY,
        mavlink.MAVLINK_MSG_ID_WIFI_CONFIG_AP,
    }
)
"""Messages with keys or passwords in them."""
_STAMP: Final = struct.Struct(">Q")

_LOG = logging.getLogger(__name__)


class FrameLog:
    """A buffer that any frame goes into at once, and a thread that empties it onto the disk."""

    def __init__(self, folder: Path, *, file_bytes: int, files: int) -> None:
        """Write into a folder, so many files of such a size at most."""
        self._folder = folder
        self._store = FrameFiles(folder, file_bytes=file_bytes, files=files)
        self._lock = threading.Lock()
        self._waiting = bytearray()
        self._count = 0
        self._stop = threading.Event()
        self._is_refused = False
        self.dropped = 0  # Frames that could not be kept
        self._thread = SupervisedThread("frame-log", self._run, self._stop)
        self._thread.start()

    def write(self, frame: bytes, time: datetime) -> None:
        """Leave a frame to be written; never waits for the disk."""
        if message_id(frame) in SECRETS:
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
        """Write what waits, if the disk takes it, and end."""
        self._stop.set()
        self._thread.join(END_WITHIN_S)

    def _run(self) -> None:
        pause_s = FLUSH_EVERY_S
        while not self._stop.wait(pause_s):
            pause_s = FLUSH_EVERY_S if self._flush() else TRY_AGAIN_S
        self._flush()
        self._store.close()

    def _flush(self) -> bool:
        """Write what has gathered; false if the disk has refused it."""
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
            _LOG.warning("%s takes frames again; %d are missing", self._folder, self.dropped)
        return True

    def _refused(self, error: OSError, count: int) -> None:
        with self._lock:
            self.dropped += count
        if not self._is_refused:
            _LOG.warning("no frames are logged in %s: %s", self._folder, error.strerror or error)
        self._is_refused = True
