"""Orders for pictures in which the vehicle's estimate is the truth."""

import math
from pathlib import Path

from sim.camera.film.orders import EstimatedPose, Order
from sim.camera.film.picture_file import write_picture
from sim.camera.scene.lens import Lens, Pose
from sim.physics.truth import quaternion_from_euler
from sim.world.farm import Farm

FARM = Farm(1)
MORNING_S = 1_780_308_000.0  # 2026-06-01 10:00 UTC: the sun in the east-south-east
ORIGIN = (40.44340, -3.73820, 650.0)


def pose(east_m: float, north_m: float, up_m: float, pitch_deg: float, yaw_deg: float) -> Pose:
    """Above a place of the farm's map, looking there."""
    latitude_deg, longitude_deg = FARM.plane.geodetic((east_m, north_m))
    q = quaternion_from_euler(0.0, math.radians(pitch_deg), math.radians(yaw_deg))
    return Pose(latitude_deg, longitude_deg, ORIGIN[2] + up_m, q)


def lens(width_px: int) -> Lens:
    return Lens(4.5, 6.3, 4.725, width_px, width_px * 3 // 4)


def order(
    folder: Path, number: int, place: Pose, *, width_px: int = 640, second: str = "",
    time_s: float = MORNING_S,
) -> Order:  # fmt: skip
    estimate = EstimatedPose(
        time_utc_us=round(time_s * 1e6) + 1000 * number,
        latitude_deg=place.latitude_deg,
        longitude_deg=place.longitude_deg,
        altitude_amsl_m=place.altitude_amsl_m,
        relative_altitude_m=place.altitude_amsl_m - ORIGIN[2],
        q_ned_camera=place.q_ned_camera,
        q_ned_frd=(1.0, 0.0, 0.0, 0.0),
        serial="F450-0001",
    )
    return Order(
        number=number,
        farm_seed=FARM.seed,
        farm_origin=ORIGIN,
        farm_time_s=time_s,
        pose=place,
        lens=lens(width_px),
        estimate=estimate,
        path=str(folder / f"{number}.jpg"),
        thumbnail_path=str(folder / "thumbnail" / f"{number}.jpg"),
        second=second,
        second_path=str(folder / second / f"{number}.jpg"),
    )


def taken(folder: Path, place: Pose, **choices: float | str) -> bytes:
    """The file of one picture."""
    wanted = order(folder, 0, place, **choices)  # type: ignore[arg-type]  # named as they are typed
    write_picture(wanted)
    return Path(wanted.path).read_bytes()
