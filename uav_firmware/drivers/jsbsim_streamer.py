"""The live view of the simulated vehicle's camera: Motion JPEG over HTTP, on this machine alone.

With the other `jsbsim` drivers the only files of the firmware that know the simulator. Nobody who
looks has shown who he is, so the view is not served to other machines.
"""

import sys
from typing import Final

from sim.camera.darkroom import Darkroom
from sim.camera.order import Frame
from sim.simulation import Simulation
from uav_firmware.cal.camera import Exposure
from uav_firmware.drivers.jsbsim_camera import sight

UNDER_WAY: Final = 2
"""Frames that may wait to be made; later ones are left out, and no flight waits."""


class JsbsimStreamer:
    """Implements `uav_firmware.cal.camera.Streamer`."""

    def __init__(self, simulation: Simulation, port: int, darkroom: Darkroom | None = None) -> None:
        """Serve on a TCP port of the loopback interface once there is something to show."""
        self._simulation = simulation
        command = (sys.executable, "-m", "sim.camera.live", str(port))
        self._darkroom = Darkroom(command) if darkroom is None else darkroom
        self._number = 0
        self.uri = f"http://127.0.0.1:{port}/stream"
        """Where it can be seen."""

    def show(self, exposure: Exposure, rate_hz: float) -> str:
        """Show what is seen now; gives why nothing can be shown, empty if it can.

        Raises:
            OSError: if the process that shows it cannot be started.
        """
        reason = next((end.error for end in self._darkroom.finished() if end.error), "")
        if not self._simulation.camera_failed and self._darkroom.pending < UNDER_WAY:
            self._number += 1
            view = sight(self._simulation, exposure)
            frame = Frame(number=self._number, **view, path="", rate_hz=rate_hz)
            self._darkroom.begin(frame)
        return reason

    def close(self) -> None:
        """Show nothing more."""
        self._darkroom.close()
