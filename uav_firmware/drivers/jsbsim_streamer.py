"""The live view of the simulated vehicle's camera: Motion JPEG over HTTP, on this machine alone.

With the other `jsbsim` drivers the only files of the firmware that know the simulator. Nobody who
looks has shown who he is, so the view is not served to other machines. The vehicle listens, and a
process beside it serves: who comes while that starts is kept waiting, not turned away.
"""

import socket
import sys
from typing import Final

from sim.camera.film.orders import Frame
from sim.camera.film.render_process import RenderProcess
from sim.simulation import Simulation
from uav_firmware.cal.camera import Exposure
from uav_firmware.drivers.jsbsim_camera import sight

UNDER_WAY: Final = 2
"""Frames that may wait to be made; later ones are left out, and no flight waits."""


class JsbsimStreamer:
    """Implements `uav_firmware.cal.camera.Streamer`."""

    def __init__(self, simulation: Simulation, port: int) -> None:
        """Serve on a TCP port of the loopback interface once there is something to show."""
        self._simulation = simulation
        self._address = ("127.0.0.1", port)
        self._listening: socket.socket | None = None
        self._darkroom: RenderProcess | None = None
        self._number = 0
        self.uri = f"http://127.0.0.1:{port}/stream"
        """Where it can be seen."""

    def show(self, exposure: Exposure, rate_hz: float) -> str:
        """Show what is seen now; gives why nothing can be shown, empty if it can.

        Raises:
            OSError: if the port cannot be had, or the process that shows it not be started.
        """
        render_process = self._open()
        reason = next((end.error for end in render_process.finished() if end.error), "")
        if not self._simulation.camera_failed and render_process.pending < UNDER_WAY:
            self._number += 1
            view = sight(self._simulation, exposure)
            frame = Frame(number=self._number, **view, path="", rate_hz=rate_hz)
            render_process.begin(frame)
        return reason

    def close(self) -> None:
        """Show nothing more, and wait for nothing: a view is closed in flight.

        The process beside has the listening socket too and may take seconds to end. `shutdown`
        ends the listening for both, so the port can be listened on again at once.
        """
        render_process, self._darkroom = self._darkroom, None
        listening, self._listening = self._listening, None
        if listening is not None:
            listening.shutdown(socket.SHUT_RDWR)
            listening.close()
        if render_process is not None:
            render_process.stop()

    def _open(self) -> RenderProcess:
        if self._darkroom is None:
            self._listening = socket.create_server(self._address)
            number = self._listening.fileno()
            command = (sys.executable, "-m", "sim.camera.film.live_view", str(number))
            self._darkroom = RenderProcess(command, inherits=(number,))
        return self._darkroom
