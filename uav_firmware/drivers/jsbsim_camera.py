"""The camera of the simulated vehicle: pictures of the farm as files on the storage card.

Only the `jsbsim` drivers import the simulator. A picture is rendered from the true pose; its
metadata are the vehicle's estimates. The gimbal holds its angles relative to the estimated
attitude, so that an error of the attitude tilts the picture as on a real vehicle.

Each picture has a small copy of the same name in the folder `thumbnail`, and on request a second
one in `nir` or `ndvi`.
"""

import errno
import math
from collections import deque
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NamedTuple, TypedDict

from sim.camera.film.orders import SECOND_PICTURES, EstimatedPose, Order
from sim.camera.film.render_process import Rendered, RenderProcess
from sim.camera.scene.lens import Lens, Pose, multiplied
from sim.simulation import Simulation
from uav_firmware.cal.camera import Exposure, Outcome, Picture
from uav_firmware.drivers.file_room import Room

MEMORY: Final = 8
"""Pictures that the camera buffers."""
STORING_US: Final = 1_000_000
"""[us] Delay from exposure to storage where vehicle time waits for the picture."""
ERASED_AT_ONCE: Final = 8
"""Files that one call of `erase` removes: some 0.2 ms."""
THUMBNAILS: Final = "thumbnail"
STORED: Final = frozenset({".jpg", ".avi"})
"""What a format of the storage removes."""


class _Pending(NamedTuple):
    """An exposure that is not stored yet."""

    image_index: int
    name: str
    second: str  # Folder of the second picture; empty without one
    due_us: int  # [us]


class JsbsimCamera:
    """Implements `uav_firmware.cal.camera.CameraDevice`."""

    def __init__(
        self,
        simulation: Simulation,
        folder: Path,
        room: Room,
        *,
        serial: str,
        in_step: bool,
        hurried: bool = False,
        render_process: RenderProcess | None = None,
    ) -> None:
        """Store pictures in a folder that `room` measures.

        With `in_step` a picture is stored exactly `STORING_US` after its exposure and time waits
        for it: the same flight has the same reports. Otherwise it is stored as soon as it is
        made, and no flight in real time waits. A `hurried` flight, faster than real time, waits
        when the memory is full: else it would lose pictures that a real one takes.
        """
        self._simulation = simulation
        self._folder = folder.resolve()
        self._room = room
        self._serial = serial
        self._in_step, self._hurried = in_step, hurried
        self._render_process = RenderProcess() if render_process is None else render_process
        self._pending: deque[_Pending] = deque()
        self._developed: deque[Rendered] = deque()
        self._erasing: deque[Path] = deque()

    @property
    def answers(self) -> bool:
        """Whether it has not failed."""
        return not self._simulation.camera_failed

    @property
    def is_ready(self) -> bool:
        """Whether its memory has room for one more exposure."""
        return len(self._pending) < MEMORY

    @property
    def used_bytes(self) -> int:
        """Room that the stored pictures take [B]."""
        return self._room.taken.bytes

    def expose(self, exposure: Exposure) -> None:
        """Begin a picture.

        Raises:
            OSError: if the camera is broken, its memory full, or it cannot be started.
        """
        if not self.answers:
            raise OSError(errno.EIO, "the camera does not answer")
        if not self.is_ready:
            raise OSError(errno.EBUSY, "the camera's memory is full")
        name = file_name(exposure, self._folder, ".jpg")
        self._render_process.begin(self._order(exposure, name))
        due_us = exposure.time_us + STORING_US
        second = SECOND_PICTURES[exposure.second]
        self._pending.append(_Pending(exposure.image_index, name, second, due_us))

    def collect(self, now_us: int) -> Sequence[Outcome]:
        """Pictures that have been stored or lost since the last call."""
        if not self._pending:
            return ()
        if self._in_step:
            return self._collect_due(now_us)
        self._developed.extend(
            self._render_process.finished(wait=self._hurried and not self.is_ready)
        )
        return [self._outcome() for _ in range(len(self._developed))]

    def erase(self) -> bool:
        """Remove the next of those that were there at the first call; few, to keep the loop's time.

        The first call lists the whole folder in one step.

        Raises:
            OSError: if one cannot be removed; those before it are gone.
        """
        if not self._erasing:
            self._erasing.extend(e for e in self._folder.rglob("*") if e.suffix in STORED)
        for _ in range(min(ERASED_AT_ONCE, len(self._erasing))):
            path = self._erasing.popleft()
            try:
                size = path.stat().st_size
                path.unlink()
            except FileNotFoundError:
                continue  # A peer has removed it by MAVFTP, which has counted it
            except OSError:
                self._erasing.clear()
                raise
            self._room.take(-size, -1)
        return not self._erasing

    def close(self) -> None:
        """Discard the pending pictures, and end the process that renders them."""
        self._pending.clear()
        self._render_process.close()

    def _collect_due(self, now_us: int) -> list[Outcome]:
        """Those that are due; waits for them."""
        found: list[Outcome] = []
        while self._pending and self._pending[0].due_us <= now_us:
            if not self._developed:
                self._developed.extend(self._render_process.finished(wait=True))
            found.append(self._outcome())
        return found

    def _outcome(self) -> Outcome:
        """Outcome of the oldest exposure; the render process keeps the order."""
        pending, ended = self._pending.popleft(), self._developed.popleft()
        if ended.error:
            return Outcome(pending.image_index, None, ended.error)
        self._room.take(ended.size_bytes, ended.files)
        second_place = (pending.second, pending.name) if pending.second else None
        picture = Picture((pending.name,), ended.size_bytes, second_place)
        return Outcome(pending.image_index, picture)

    def _order(self, exposure: Exposure, name: str) -> Order:
        second = SECOND_PICTURES[exposure.second]
        return Order(
            number=exposure.image_index,
            **sight(self._simulation, exposure),
            estimate=_belief(exposure, self._serial),
            path=str(self._folder / name),
            thumbnail_path=str(self._folder / THUMBNAILS / name),
            second=second,
            second_path=str(self._folder / second / name),
        )


class Sight(TypedDict):
    """What the camera sees: fields of an order."""

    farm_seed: int
    farm_origin: tuple[float, float, float]
    farm_time_s: float
    pose: Pose
    lens: Lens


def sight(simulation: Simulation, exposure: Exposure) -> Sight:
    """The world and the camera's true pose at this instant."""
    truth, farm, plane = simulation.truth, simulation.farm, simulation.farm.plane
    w, x, y, z = exposure.q_ned_frd
    q_frd_camera = multiplied((w, -x, -y, -z), exposure.q_ned_camera)
    return Sight(
        farm_seed=farm.seed,
        farm_origin=(plane.latitude_deg, plane.longitude_deg, plane.altitude_amsl_m),
        farm_time_s=simulation.farm_time_s,
        pose=Pose(
            truth.latitude_deg,
            truth.longitude_deg,
            truth.altitude_amsl_m,
            multiplied(truth.q_ned_frd, q_frd_camera),
        ),
        lens=Lens(*exposure.lens),
    )


def _belief(exposure: Exposure, serial: str) -> EstimatedPose:
    return EstimatedPose(
        time_utc_us=exposure.time_utc_us,
        latitude_deg=_known(exposure.latitude_deg),
        longitude_deg=_known(exposure.longitude_deg),
        altitude_amsl_m=_known(exposure.altitude_amsl_m),
        relative_altitude_m=_known(exposure.relative_altitude_m),
        q_ned_camera=exposure.q_ned_camera,
        q_ned_frd=exposure.q_ned_frd,
        serial=serial,
    )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def file_name(exposure: Exposure, folder: Path, suffix: str) -> str:
    """Name after time and index; nothing of an earlier flight is ever overwritten."""
    moment = datetime.fromtimestamp(exposure.time_utc_us // 1_000_000, UTC)
    stem = f"{moment:%Y%m%d_%H%M%S}_{exposure.image_index:04}"
    name, number = f"{stem}{suffix}", 2
    while (folder / name).exists():
        name, number = f"{stem}_{number}{suffix}", number + 1
    return name
