"""The live picture of vehicles: Motion JPEG of their cameras, fetched once for all who look.

A camera is requested while somebody looks at it, by one thread, however many look. Each viewer
gets the newest picture when everything before was sent: a slow one misses pictures and delays
nobody. The addresses are settings: what a vehicle announces over the radio is requested by nobody.
"""

import http.client
import logging
import threading
import time
import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from enum import Enum
from typing import Final, NamedTuple
from urllib.parse import urlsplit

from edge_server.live.mjpeg import FrameError, FrameReader, part_of

LOG = logging.getLogger(__name__)
CONNECT_S: Final = 5.0
SILENT_S: Final = 10.0
"""How long a camera may send nothing."""
RETRY_S: Final = 2.0
LINGER_S: Final = 5.0
"""A camera is requested so long after its last viewer."""
WAIT_FOR_PICTURE_S: Final = 20.0
"""A viewer's answer ends when there was no picture for so long."""
VIEWERS_MAX: Final = 32
"""Of all cameras together; each may keep a picture in memory."""
PICTURES_PER_SECOND: Final = 5.0
"""To one viewer; a camera may send more."""
_PIECE_BYTES: Final = 65_536


class CameraState(Enum):
    """What is known of a camera."""

    IDLE = "idle"  # Nobody looks
    CONNECTING = "connecting"
    SHOWING = "showing"
    FAILED = "failed"


class TooManyViewersError(Exception):
    """No more viewers are served now."""


class Camera:
    """One camera and its newest picture; for many threads."""

    def __init__(self, url: str, wake: Callable[[], None]) -> None:
        """Begin without requesting it; `wake` is called after each picture."""
        self._url = url
        self._wake = wake
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._wanted_until = float("-inf")
        self.state = CameraState.IDLE
        self.reason: str | None = None
        """Why it cannot be shown."""
        self.newest: tuple[int, bytes] = 0, b""
        """Number of the newest picture, and the picture."""

    def note_viewer(self) -> None:
        """Note that somebody looks now; starts the thread if there is none."""
        with self._lock:
            self._wanted_until = time.monotonic() + LINGER_S
            if self._thread is None:
                self.state, self.reason = CameraState.CONNECTING, None
                self._thread = threading.Thread(target=self._run, name="video", daemon=True)
                self._thread.start()

    @property
    def _is_wanted(self) -> bool:
        return time.monotonic() < self._wanted_until

    def _run(self) -> None:
        while True:
            try:
                self._receive()
            except (OSError, http.client.HTTPException, FrameError) as error:
                self._fail(str(error) or type(error).__name__)
            except Exception:
                LOG.exception("the live picture of %s has failed", self._url)
                self._fail("internal error; the edge server's log has the details")
            with self._lock:
                if not self._is_wanted:
                    self._thread, self.state = None, CameraState.IDLE
                    self.newest = self.newest[0], b""
                    return
            time.sleep(RETRY_S)

    def _fail(self, reason: str) -> None:
        if self.state is not CameraState.FAILED:
            LOG.warning("no live picture from %s: %s", self._url, reason)
        self.state, self.reason = CameraState.FAILED, reason

    def _receive(self) -> None:
        """Receive pictures while somebody looks.

        Raises:
            OSError, http.client.HTTPException: if the connection fails or is silent.
            FrameError: if what it sends cannot be shown.
        """
        with _requested(self._url) as answer:
            if answer.status != http.client.OK:
                raise FrameError(f"it answers {answer.status} {answer.reason}"[:80])
            reader = FrameReader(answer.headers.get("Content-Type", ""))
            while self._is_wanted:
                data = answer.read1(_PIECE_BYTES)
                if not data:
                    raise FrameError("it has ended the stream")
                if frames := reader.feed(data):
                    self.newest = self.newest[0] + 1, frames[-1]
                    self.state, self.reason = CameraState.SHOWING, None
                    self._wake()


@contextmanager
def _requested(url: str) -> Iterator[http.client.HTTPResponse]:
    parts = urlsplit(url)
    kinds = {"http": http.client.HTTPConnection, "https": http.client.HTTPSConnection}
    connection = kinds[parts.scheme](parts.hostname or "", parts.port, timeout=CONNECT_S)
    try:
        connection.connect()
        connection.sock.settimeout(SILENT_S)
        target = f"{parts.path or '/'}{f'?{parts.query}' if parts.query else ''}"
        connection.request("GET", target, headers={"Accept": "multipart/x-mixed-replace"})
        yield connection.getresponse()
    finally:
        connection.close()


class VideoStream:
    """What one viewer still has to receive; called by one thread."""

    def __init__(self, camera: Camera, is_admitted: Callable[[], bool], now: float) -> None:
        """Begin with the next picture; `is_admitted` is false once the session has ended."""
        self._camera = camera
        self._is_admitted = is_admitted
        self._sent = camera.newest[0] if not camera.newest[1] else -1
        self._picture_at = now
        self._next_at = now

    def take(self, now: float) -> bytes | None:
        """Give the newest picture, if there is a newer one; None ends the answer."""
        if not self._is_admitted() or now - self._picture_at > WAIT_FOR_PICTURE_S:
            return None
        self._camera.note_viewer()
        number, frame = self._camera.newest
        if number == self._sent or not frame or now < self._next_at:
            return b""
        self._sent, self._picture_at = number, now
        self._next_at = now + 1.0 / PICTURES_PER_SECOND
        return part_of(frame)


class CameraView(NamedTuple):
    """A camera as it is listed."""

    vehicle_id: int
    state: CameraState
    reason: str | None


class Cameras:
    """The cameras of the settings, by vehicle."""

    def __init__(self, addresses: Mapping[int, str]) -> None:
        self.wake: Callable[[], None] = lambda: None
        """Called after each picture."""
        self._cameras = {
            vehicle_id: Camera(url, self._wake_loop) for vehicle_id, url in addresses.items()
        }
        self._viewers: weakref.WeakSet[VideoStream] = weakref.WeakSet()

    def _wake_loop(self) -> None:
        self.wake()  # The server sets it after the cameras are made

    def listing(self) -> list[CameraView]:
        """List the cameras by vehicle."""
        return [
            CameraView(vehicle_id, camera.state, camera.reason)
            for vehicle_id, camera in sorted(self._cameras.items())
        ]

    def view(
        self, vehicle_id: int, is_admitted: Callable[[], bool], now: float
    ) -> VideoStream | None:
        """Begin a viewer's answer; None if the vehicle has no camera. `now` is monotonic.

        Raises:
            TooManyViewersError: if too many look already.
        """
        camera = self._cameras.get(vehicle_id)
        if camera is None:
            return None
        if len(self._viewers) >= VIEWERS_MAX:
            raise TooManyViewersError(f"{VIEWERS_MAX} viewers look already; try again later")
        stream = VideoStream(camera, is_admitted, now)
        self._viewers.add(stream)
        return stream
