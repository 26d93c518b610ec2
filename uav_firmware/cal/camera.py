"""Camera of a vehicle: pictures, recordings, live view, tracking.

A picture is exposed at once and stored later; the camera can expose again meanwhile until its
memory is full. Every exposure has one outcome, in the order of the exposures.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple, Protocol, runtime_checkable

from uav_firmware.cal.files import Place
from uav_firmware.msg.payload import Box, CameraLens
from uav_firmware.msg.vectors import Quaternion


class SecondPicture(IntEnum):
    """Second picture stored with each picture."""

    NONE = 0
    NEAR_INFRARED = 1
    VEGETATION_INDEX = 2  # NDVI


class Exposure(NamedTuple):
    """Estimated time, position and attitude of a picture; its metadata."""

    time_us: int  # [us] Since boot
    time_utc_us: int  # [us since 1970] 0 unknown
    image_index: int  # [-] In the log of captures
    lens: CameraLens
    latitude_deg: float  # [deg] NaN unknown
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    relative_altitude_m: float  # [m] Above home
    q_ned_camera: Quaternion  # [-] Optical axis forward, right, down to NED
    q_ned_frd: Quaternion  # [-] Attitude of the vehicle
    second: SecondPicture


class Picture(NamedTuple):
    """A picture that has been stored."""

    place: Place  # In the card's folder of pictures
    size_bytes: int  # [B] With thumbnail and second picture
    second_place: Place | None = None  # Of the second picture, if there is one


class Outcome(NamedTuple):
    """Result of an exposure."""

    image_index: int  # [-] That of the exposure
    picture: Picture | None  # None if it could not be stored
    reason: str = ""  # Why it could not be stored


class CameraDevice(Protocol):
    """A camera with its storage."""

    @property
    def answers(self) -> bool:
        """Whether it responds; a failed camera accepts no commands and sends nothing."""

    @property
    def is_ready(self) -> bool:
        """Whether its memory has room for one more exposure."""

    @property
    def used_bytes(self) -> int:
        """Size of the stored pictures [B].

        Raises:
            OSError: if the storage cannot be read.
        """

    def expose(self, exposure: Exposure) -> None:
        """Take a picture; `collect` returns its outcome.

        Raises:
            OSError: if the camera fails; there is no outcome then.
        """

    def collect(self, now_us: int) -> Sequence[Outcome]:
        """Outcomes since the last call."""

    def erase(self) -> bool:
        """Remove some pictures; called when no outcome is due, until it returns True: none is left.

        Raises:
            OSError: if a file cannot be removed.
        """


class FilmGrowth(NamedTuple):
    """Growth of the recordings since the last call."""

    size_bytes: int  # [B]
    reason: str = ""  # Why the current recording has stopped; empty if it has not


class Recorder(Protocol):
    """Records video."""

    @property
    def is_busy(self) -> bool:
        """Whether frames are still being stored."""

    def begin_film(self, exposure: Exposure, rate_hz: float) -> Place:
        """Begin a recording with its first frame; return its place in the card's pictures.

        Raises:
            OSError: if the camera fails; there is no recording then.
        """

    def add_frame(self, exposure: Exposure) -> None:
        """Add a frame, or leave it out while the storage is too slow.

        Raises:
            OSError: if the camera fails.
        """

    def end_film(self) -> None:
        """End the recording; its file is complete soon afterwards."""

    def film_growth(self) -> FilmGrowth:
        """What has been stored since the last call."""


class Streamer(Protocol):
    """Serves the live view."""

    @property
    def uri(self) -> str:
        """Address of the stream."""

    @property
    def starts_at_once(self) -> bool:
        """Whether it is offered from the start, and not on command only."""

    def show(self, exposure: Exposure, rate_hz: float) -> str:
        """Send a frame to the viewers; return why none can be sent, empty on success.

        Raises:
            OSError: if the stream cannot be served.
        """

    def close(self) -> None:
        """End the stream until the next frame."""


class Gaze(NamedTuple):
    """Estimated direction of the camera."""

    lens: CameraLens
    q_ned_camera: Quaternion  # [-] Optical axis forward, right, down to NED
    q_ned_frd: Quaternion  # [-] Attitude of the vehicle


class Seeker(Protocol):
    """Object tracking of a camera."""

    def lock(self, box: Box, gaze: Gaze) -> bool:
        """Start to track the object in a box; False if none is distinct from the ground."""

    def seen(self, gaze: Gaze) -> Box | None:
        """Box of the tracked object; None when it is not in the picture."""


@runtime_checkable
class CameraCarrier(Protocol):
    """A vehicle with a camera; a driver may implement it beside `Vehicle`."""

    @property
    def camera(self) -> CameraDevice | None:
        """The camera, or None."""

    @property
    def recorder(self) -> Recorder | None:
        """Its video recorder, or None."""

    @property
    def seeker(self) -> Seeker | None:
        """Its object tracking, or None."""

    @property
    def streamer(self) -> Streamer | None:
        """Its live view, or None."""
