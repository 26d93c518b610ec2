"""What takes the pictures, where a vehicle has something that does.

A picture is exposed at once and stored a while later; the camera can expose again meanwhile, up
to what its memory holds. Every exposure has one outcome, in the order of the exposures.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple, Protocol, runtime_checkable

from uav_firmware.cal.files import Place
from uav_firmware.msg.payload import Box, CameraLens
from uav_firmware.msg.vectors import Quaternion


class SecondPicture(IntEnum):
    """What is stored beside each picture."""

    NONE = 0
    NEAR_INFRARED = 1
    VEGETATION_INDEX = 2  # NDVI


class Exposure(NamedTuple):
    """How and where a picture is taken, as the vehicle believes; written into the picture."""

    time_us: int  # [us] Since boot
    time_utc_us: int  # [us since 1970] 0 unknown
    image_index: int  # [-] In the log of captures
    lens: CameraLens
    latitude_deg: float  # [deg] NaN unknown
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    relative_altitude_m: float  # [m] Above home
    q_ned_camera: Quaternion  # [-] Optical axis forward, right, down to NED
    q_ned_frd: Quaternion  # [-] Attitude of the vehicle that the gimbal works against
    second: SecondPicture


class Picture(NamedTuple):
    """A picture that has been stored."""

    place: Place  # In the card's folder of pictures
    size_bytes: int  # [B] With all that is stored beside it


class Outcome(NamedTuple):
    """What became of an exposure."""

    image_index: int  # [-] That of the exposure
    picture: Picture | None  # None if it could not be stored
    reason: str = ""  # Why it could not


class CameraDevice(Protocol):
    """A camera with its storage."""

    @property
    def answers(self) -> bool:
        """Whether it is there at all: a dead camera takes no orders and says nothing."""

    @property
    def is_ready(self) -> bool:
        """Whether its memory has room for one more exposure."""

    @property
    def used_bytes(self) -> int:
        """Room that the stored pictures take [B].

        Raises:
            OSError: if the storage cannot be read.
        """

    def expose(self, exposure: Exposure) -> None:
        """Take a picture; its outcome comes by `collect`.

        Raises:
            OSError: if the camera fails; there is no outcome then.
        """

    def collect(self, now_us: int) -> Sequence[Outcome]:
        """Outcomes that have come since the last call."""

    def erase(self) -> bool:
        """Remove some pictures; called when no outcome is due, until it gives true: none is left.

        Raises:
            OSError: if the storage refuses.
        """


class FilmGrowth(NamedTuple):
    """Growth of the stored films since the last call."""

    size_bytes: int  # [B]
    reason: str = ""  # Why the film that was being recorded goes no further; empty if it does


class Recorder(Protocol):
    """What records films."""

    @property
    def is_busy(self) -> bool:
        """Whether frames are on their way to the card."""

    def begin_film(self, exposure: Exposure, rate_hz: float) -> Place:
        """Begin a film with its first frame; gives where it lies in the card's pictures.

        Raises:
            OSError: if the camera fails; there is no film then.
        """

    def add_frame(self, exposure: Exposure) -> None:
        """Add a frame, or leave it out while the storage is too slow.

        Raises:
            OSError: if the camera fails.
        """

    def end_film(self) -> None:
        """End the film; it is whole soon afterwards."""

    def film_growth(self) -> FilmGrowth:
        """What has been stored since the last call."""


class Streamer(Protocol):
    """What shows live what the camera sees."""

    @property
    def uri(self) -> str:
        """Where it can be seen."""

    def show(self, exposure: Exposure, rate_hz: float) -> str:
        """Show what is seen now; gives why nothing can be shown, empty if it can.

        Raises:
            OSError: if it cannot be shown at all.
        """

    def close(self) -> None:
        """Show nothing more, until something is shown again."""


class Gaze(NamedTuple):
    """Where the camera points, as the vehicle believes."""

    lens: CameraLens
    q_ned_camera: Quaternion  # [-] Optical axis forward, right, down to NED
    q_ned_frd: Quaternion  # [-] Attitude of the vehicle that the gimbal works against


class Seeker(Protocol):
    """A camera's own search for something in its picture."""

    def lock(self, box: Box, gaze: Gaze) -> bool:
        """Lock on to the object in a box; false if there is none distinct from the ground."""

    def seen(self, gaze: Gaze) -> Box | None:
        """Where what is held on to is seen; None when it is not in the picture."""


@runtime_checkable
class CameraCarrier(Protocol):
    """A vehicle with a camera; a driver may implement it beside `Vehicle`."""

    @property
    def camera(self) -> CameraDevice | None:
        """The camera; None if this one has none."""

    @property
    def recorder(self) -> Recorder | None:
        """What records its films; None if nothing does."""

    @property
    def seeker(self) -> Seeker | None:
        """What finds moving things in its picture; None if nothing does."""

    @property
    def streamer(self) -> Streamer | None:
        """What shows live what it sees; None if nothing does."""
