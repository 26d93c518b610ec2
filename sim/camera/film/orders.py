"""An order for a picture or a video frame, as a line of JSON: all that the render process needs.

Errors:
    OrderError(ValueError): a line is no order; the message names the reason.
"""

import json
from dataclasses import asdict, dataclass
from typing import Final

from sim.camera.picture import Shot
from sim.camera.scene.lens import Lens, Pose
from sim.physics.truth import Quaternion
from sim.world.farm import Farm
from sim.world.plane import Plane

SECOND_PICTURES: Final = ("", "nir", "ndvi")
"""What can be stored beside the picture: nothing, near infrared, vegetation index."""


class OrderError(ValueError):
    """A line is no order; the message names the reason."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatedPose:
    """What the vehicle estimates, as written into the picture."""

    time_utc_us: int  # [us since 1970] 0 unknown
    latitude_deg: float | None  # [deg] WGS-84; None unknown
    longitude_deg: float | None  # [deg]
    altitude_amsl_m: float | None  # [m]
    relative_altitude_m: float | None  # [m] Above home
    q_ned_camera: Quaternion  # [-] Optical axis forward, right, down to NED
    q_ned_frd: Quaternion  # [-] Attitude of the vehicle
    serial: str  # Of the vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What the camera sees: the world at an instant, the true pose, and the path of the file."""

    number: int  # [-] Repeated in the answer
    farm_seed: int
    farm_origin: tuple[float, float, float]  # [deg, deg, m AMSL]
    farm_time_s: float  # [s since 1970]
    pose: Pose
    lens: Lens
    path: str  # Absolute, of the picture or the video

    @property
    def shot(self) -> Shot:
        """What is to be rendered."""
        farm = Farm(self.farm_seed, Plane(*self.farm_origin))
        return Shot(farm, self.pose, self.lens, self.farm_time_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame(View):
    """One frame of a video; the first frame of a path begins the file."""

    rate_hz: float  # Of the film
    place: int = 0  # [-] Which frame of the film it is, from 0
    is_end: bool = False  # Nothing is to be seen: the film is over, `place` frames long


@dataclass(frozen=True, slots=True, kw_only=True)
class Order(View):
    """One picture."""

    estimate: EstimatedPose
    thumbnail_path: str
    second: str  # One of `SECOND_PICTURES`
    second_path: str  # Used when there is a second picture


def to_line(order: Order | Frame) -> str:
    """The order as a line without its end; a rate marks a frame."""
    return json.dumps(asdict(order), allow_nan=False)


def from_line(line: str) -> Order | Frame:
    """Read a line.

    Raises:
        OrderError: if it is no order.
    """
    try:
        fields = json.loads(line)
        latitude, longitude, altitude, q = fields.pop("pose")
        fields["pose"] = Pose(latitude, longitude, altitude, tuple(q))
        fields["lens"] = Lens(*fields["lens"])
        fields["farm_origin"] = tuple(fields["farm_origin"])
        if "rate_hz" in fields:
            return Frame(**fields)
        estimate = fields.pop("estimate")
        for name in ("q_ned_camera", "q_ned_frd"):
            estimate[name] = tuple(estimate[name])
        return Order(**fields, estimate=EstimatedPose(**estimate))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise OrderError(f"no order for a picture: {error}") from error
