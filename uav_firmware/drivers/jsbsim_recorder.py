"""The camera's video of the simulated vehicle: films of the farm on the storage card.

With `jsbsim.py` and `jsbsim_camera.py` the only files of the firmware that know the simulator. A
process of its own makes the frames, so that a film does not hold up pictures.
"""

import errno
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

UNDER_WAY: Final = 8
"""Frames that may wait to be made; vehicle time waits then, or the next one is left out.

In the place of one that is left out the film shows the one before it."""
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
        """Store films in a folder that `room` measures; `in_step` as of `JsbsimCamera`."""
        self._simulation = simulation
        self._folder = folder.resolve()
        self._room = room
        self._in_step = in_step
        self._darkroom = RenderProcess() if render_process is None else render_process
        self._film: tuple[str, float] | None = None  # Path, rate [Hz]
        self._last: Frame | None = None
        self._number = 0
        self._place = 0  # Which frame of the film is next
        self._growth = FilmGrowth(0)

    @property
    def is_busy(self) -> bool:
        """Whether frames are on their way to the card."""
        return self._darkroom.pending > 0

    def begin_film(self, exposure: Exposure, rate_hz: float) -> Place:
        """Begin a film with its first frame.

        Raises:
            OSError: if the camera is broken or cannot be started.
        """
        self._check()
        name = file_name(exposure, self._folder, SUFFIX)
        self._film, self._place = (str(self._folder / name), rate_hz), 0
        self.add_frame(exposure)
        return (name,)

    def add_frame(self, exposure: Exposure) -> None:
        """Add a frame; where vehicle time does not wait, one too many is left out.

        Raises:
            OSError: if the camera is broken or has stopped.
        """
        self._check()
        while self._in_step and self._darkroom.pending >= UNDER_WAY:
            self._collect(wait=True)
        if self._film is None:
            return
        place, self._place = self._place, self._place + 1
        if self._darkroom.pending >= UNDER_WAY:
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
        self._darkroom.begin(self._last)

    def end_film(self) -> None:
        """End the film behind the frames that are under way.

        Raises:
            OSError: if the camera has stopped.
        """
        last, self._film, self._last = self._last, None, None
        if last is not None:
            self._number += 1
            self._darkroom.begin(replace(last, number=self._number, place=self._place, is_end=True))

    def film_growth(self) -> FilmGrowth:
        """What has been stored since the last call."""
        self._collect(wait=False)
        growth, self._growth = self._growth, FilmGrowth(0)
        return growth

    def close(self) -> None:
        """End the process that makes the films, and with it the films."""
        self._darkroom.close()

    def _check(self) -> None:
        if self._simulation.camera_failed:
            raise OSError(errno.EIO, "the camera does not answer")

    def _collect(self, *, wait: bool) -> None:
        for end in self._darkroom.finished(wait=wait):
            if end.error:
                self._growth = self._growth._replace(reason=end.error)
                continue
            self._room.take(end.size_bytes, end.files)
            self._growth = self._growth._replace(
                size_bytes=self._growth.size_bytes + end.size_bytes
            )
