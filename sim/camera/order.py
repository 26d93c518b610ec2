"""What a picture is to be: everything that the darkroom needs, as one line of JSON.

Errors:
    OrderError(ValueError): a line is no order; the message names the reason.
"""

import json
from dataclasses import asdict, dataclass
from typing import Final

from sim.camera.lens import Lens, Pose
from sim.camera.render import Shot
from sim.truth import Quaternion
from sim.world.farm import Farm
from sim.world.plane import Plane

SECOND_PICTURES: Final = ("", "nir", "ndvi")
"""What can be stored beside the picture: nothing, near infrared, vegetation index."""


class OrderError(ValueError):
    """A line is no order; the message names the reason."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """What the vehicle believes of itself and writes into the picture."""

    time_utc_us: int  # [us since 1970] 0 unknown
    latitude_deg: float | None  # [deg] WGS-84; None unknown
    longitude_deg: float | None  # [deg]
    altitude_amsl_m: float | None  # [m]
    relative_altitude_m: float | None  # [m] Above home
    q_ned_camera: Quaternion  # [-] Optical axis forward, right, down to NED
    q_ned_frd: Quaternion  # [-] Attitude of the vehicle
    serial: str  # Of the vehicle


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """One picture: the world at its instant, the true pose, and where the files go."""

    number: int  # [-] The answer bears it
    farm_seed: int
    farm_origin: tuple[float, float, float]  # [deg, deg, m AMSL]
    farm_time_s: float  # [s since 1970]
    pose: Pose
    lens: Lens
    belief: Belief
    path: str  # Absolute, of the picture
    thumbnail_path: str
    second: str  # One of `SECOND_PICTURES`
    second_path: str  # Used when there is a second picture

    @property
    def shot(self) -> Shot:
        """What is to be rendered."""
        farm = Farm(self.farm_seed, Plane(*self.farm_origin))
        return Shot(farm, self.pose, self.lens, self.farm_time_s)


def to_line(order: Order) -> str:
    """The order as a line without its end."""
    return json.dumps(asdict(order), allow_nan=False)


def from_line(line: str) -> Order:
    """Read a line.

    Raises:
        OrderError: if it is no order.
    """
    try:
        fields = json.loads(line)
        belief = fields.pop("belief")
        for name in ("q_ned_camera", "q_ned_frd"):
            belief[name] = tuple(belief[name])
        latitude, longitude, altitude, q = fields.pop("pose")
        lens, origin = Lens(*fields.pop("lens")), tuple(fields.pop("farm_origin"))
        return Order(
            **fields,
            farm_origin=origin,
            pose=Pose(latitude, longitude, altitude, tuple(q)),
            lens=lens,
            belief=Belief(**belief),
        )
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise OrderError(f"no order for a picture: {error}") from error
