"""Video of the simulated vehicle's camera: recorded on the storage card, and as a live view.

Like the other `jsbsim` drivers it imports the simulator. Separate processes render the frames, so
that a recording does not delay pictures. The live view is Motion JPEG over HTTP on the loopback
interface only, because its viewers are not authenticated. The vehicle opens the listening socket
and another process serves it: a viewer that connects while that process starts is not refused.
"""

import errno
import select
import socket
import sys
from dataclasses import replace
from pathlib import Path
from typing import Final

from sim.camera.film.orders import Frame
from sim.camera.film.render_process import RenderProcess
from sim.simulation import Simulation
from uav_firmware.cal.camera import Exposure, FilmGrowth
from uav_firmware.cal.files import Place
from uav_firmware.drivers.file_room import Room
from uav_firmware.drivers.jsbsim_camera import file_name, sight

RECORDER_PENDING_MAX: Final = 8
"""Frames that may be pending; beyond it vehicle time waits, or the next frame is left out.

A recording repeats the frame before one that is left out."""
STREAMER_PENDING_MAX: Final = 2
"""Frames that may be pending; later ones are left out."""
SUFFIX: Final = ".avi"


class JsbsimRecorder:
    """Implements `uav_firmware.cal.camera.Recorder`."""

    def __init__(
        self,
        simulation: Simulation,
        folder: Path,
        room: Room,
        *,
        in_step: bool,
        render_process: RenderProcess | None = None,
    ) -> None:
        """Store recordings in a folder that `room` measures; `in_step` as of `JsbsimCamera`."""
        self._simulation = simulation
        self._folder = folder.resolve()
        self._room = room
        self._in_step = in_step
        self._render_process = RenderProcess() if render_process is None else render_process
        self._film: tuple[str, float] | None = None  # Path, rate [Hz]
        self._last: Frame | None = None
        self._number = 0
        self._place = 0  # Index of the next frame
        self._growth = FilmGrowth(0)

    @property
    def is_busy(self) -> bool:
        """Whether frames are still being rendered or stored."""
        return self._render_process.pending > 0

    def begin_film(self, exposure: Exposure, rate_hz: float) -> Place:
        """Begin a recording with its first frame.

        Raises:
            OSError: if the camera has failed or cannot be started.
        """
        self._check()
        name = file_name(exposure, self._folder, SUFFIX)
        self._film, self._place = (str(self._folder / name), rate_hz), 0
        self.add_frame(exposure)
        return (name,)

    def add_frame(self, exposure: Exposure) -> None:
        """Add a frame; where vehicle time does not wait, a frame beyond the limit is left out.

        Raises:
            OSError: if the camera has failed or stopped.
        """
        self._check()
        while self._in_step and self._render_process.pending >= RECORDER_PENDING_MAX:
            self._collect(wait=True)
        if self._film is None:
            return
        place, self._place = self._place, self._place + 1
        if self._render_process.pending >= RECORDER_PENDING_MAX:
            return
        path, rate_hz = self._film
        self._number += 1
        self._last = Frame(
            number=self._number,
            **sight(self._simulation, exposure),
            path=path,
            rate_hz=rate_hz,
            place=place,
        )
        self._render_process.begin(self._last)

    def end_film(self) -> None:
        """End the recording after its pending frames.

        Raises:
            OSError: if the camera has stopped.
        """
        last, self._film, self._last = self._last, None, None
        if last is not None:
            self._number += 1
            self._render_process.begin(
                replace(last, number=self._number, place=self._place, is_end=True)
            )

    def film_growth(self) -> FilmGrowth:
        """What has been stored since the last call."""
        self._collect(wait=False)
        growth, self._growth = self._growth, FilmGrowth(0)
        return growth

    def close(self) -> None:
        """End the process that renders the frames, and with it the recording."""
        self._render_process.close()

    def _check(self) -> None:
        if self._simulation.camera_failed:
            raise OSError(errno.EIO, "the camera does not answer")

    def _collect(self, *, wait: bool) -> None:
        for end in self._render_process.finished(wait=wait):
            if end.error:
                self._growth = self._growth._replace(reason=end.error)
                continue
            self._room.take(end.size_bytes, end.files)
            self._growth = self._growth._replace(
                size_bytes=self._growth.size_bytes + end.size_bytes
            )


class JsbsimStreamer:
    """Implements `uav_firmware.cal.camera.Streamer`."""

    def __init__(self, simulation: Simulation, port: int, *, starts_at_once: bool = False) -> None:
        """Serve on a TCP port of the loopback interface, from the first frame."""
        self.starts_at_once = starts_at_once
        self._simulation = simulation
        self._address = ("127.0.0.1", port)
        self._listening: socket.socket | None = None
        self._render_process: RenderProcess | None = None
        self._number = 0
        self.uri = f"http://127.0.0.1:{port}/stream"
        """Address of the stream."""

    def show(self, exposure: Exposure, rate_hz: float) -> str:
        """Send a frame to the viewers; return why none can be sent, empty on success.

        Raises:
            OSError: if the port cannot be bound, or the serving process cannot be started.
        """
        render_process = self._open()
        if render_process is None:
            return ""
        reason = next((end.error for end in render_process.finished() if end.error), "")
        if not self._simulation.camera_failed and render_process.pending < STREAMER_PENDING_MAX:
            self._number += 1
            view = sight(self._simulation, exposure)
            frame = Frame(number=self._number, **view, path="", rate_hz=rate_hz)
            render_process.begin(frame)
        return reason

    def close(self) -> None:
        """End the view without waiting: it is closed in flight.

        The serving process shares the listening socket and may take seconds to end. `shutdown`
        ends the listening for both, so the port can be bound again at once.
        """
        render_process, self._render_process = self._render_process, None
        listening, self._listening = self._listening, None
        if listening is not None:
            listening.shutdown(socket.SHUT_RDWR)
            listening.close()
        if render_process is not None:
            render_process.stop()

    def _open(self) -> RenderProcess | None:
        """Listen; the process begins with the first viewer, who waits for it. None before."""
        if self._listening is None:
            self._listening = socket.create_server(self._address)
        if self._render_process is None:
            if not select.select([self._listening], [], [], 0.0)[0]:
                return None
            number = self._listening.fileno()
            command = (sys.executable, "-m", "sim.camera.film.live_view", str(number))
            self._render_process = RenderProcess(command, inherits=(number,))
        return self._render_process
