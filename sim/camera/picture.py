"""A picture of the farm: every pixel's ray is followed to what it meets. Pure.

Rows are drawn in bands, so that what is worked on fits into the processor's cache. The level
floor is met first, then the hills round it (`Farm.elevation_amsl_m`), then what stands there. The
scale of the map is corrected to that of the ellipsoid at the camera: a surveyor with WGS-84 finds
every point of the floor within a hundredth of a pixel.
"""

import math
from types import EllipsisType
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sim.camera.light import Light, developed, encoded, hazed, light, sky_colour
from sim.camera.scene import ground
from sim.camera.scene.hills import Hills
from sim.camera.scene.lens import Lens, Pixels, Pose, Rays, in_camera, rays
from sim.camera.scene.orchard import crowns_ahead, leaves
from sim.camera.scene.reflectance import Bands
from sim.camera.scene.solids import Solid
from sim.camera.scene.structures import solids
from sim.physics.earth import degrees_per_metre
from sim.physics.truth import Quaternion, Vector3
from sim.world.farm import Farm


class Box(NamedTuple):
    """Rows and columns of a part of the picture, each from the first to before the last [px]."""

    top: int
    bottom: int
    left: int
    right: int

    def within(self, band: slice) -> tuple[slice, slice] | None:
        """The part of the box in a band of rows, counted from the band's first; None for none."""
        top, bottom = max(band.start, self.top), min(band.stop, self.bottom)
        if top >= bottom or self.left >= self.right:
            return None
        return slice(top - band.start, bottom - band.start), slice(self.left, self.right)


def box_of(lens: Lens, q_ned_camera: Quaternion, solid: Solid, offset_ned: Vector3) -> Box | None:
    """Pixels of the picture that may show a solid: the box about its sphere; None for none.

    `offset_ned` [m] is where its middle is from the camera.
    """
    radius = solid.radius_m
    forward, right, down = in_camera(q_ned_camera, offset_ned)
    sides = (
        abs(right) - forward * lens.half_right - radius * math.hypot(1.0, lens.half_right),
        abs(down) - forward * lens.half_down - radius * math.hypot(1.0, lens.half_down),
    )
    if forward < -radius or max(sides) > 0.0:
        return None
    if forward <= 1.5 * radius:
        return Box(0, lens.height_px, 0, lens.width_px)
    column = 0.5 * lens.width_px * (1.0 + right / (forward * lens.half_right))
    row = 0.5 * lens.height_px * (1.0 + down / (forward * lens.half_down))
    # A sphere's picture is an ellipse that grows toward the edges of the picture
    slant = math.hypot(1.0, right / forward, down / forward) ** 2
    reach = 1.2 * radius * slant / ((forward - radius) * lens.pixel) + 2.0
    return Box(
        max(0, int(row - reach)),
        min(lens.height_px, int(row + reach) + 1),
        max(0, int(column - reach)),
        min(lens.width_px, int(column + reach) + 1),
    )


_BAND_PX: Final = 65_536  # Pixels that are worked on at once
_COARSE: Final = 16  # The smooth maps are read at every so many pixels
_FARTHEST_M: Final = 4000.0
_LEAST_HEIGHT_M: Final = 0.05


_Picked: TypeAlias = NDArray[np.bool_] | EllipsisType
"""Pixels of a band: those of a mask, or all."""


class Shot(NamedTuple):
    """What a picture is taken of, from where and when."""

    farm: Farm
    pose: Pose
    lens: Lens
    time_utc_s: float  # [s since 1970] The farm's time


class Image(NamedTuple):
    """A picture and, in step with it, what a near infrared camera beside it sees."""

    colour: NDArray[np.uint8]  # Height, width, 3
    near_infrared: NDArray[np.uint8]  # [-] Reflectance times 255
    vegetation_index: NDArray[np.uint8]  # [-] (NDVI + 1) / 2 times 255; 0 where there is sky


class _View(NamedTuple):
    """Facts about a shot that hold for all its pixels."""

    shot: Shot
    light: Light
    east_m: float  # [m] Of the camera on the farm's map
    north_m: float
    height_m: float  # [m] Above the ground
    stretch: tuple[float, float]  # [-] Metres of the map in a metre east and north
    solids: tuple[Solid, ...]  # All of them: they may cast shadows into the picture
    seen: tuple[tuple[Solid, Box], ...]  # Those that the picture may show
    hills: Hills


def render(shot: Shot) -> Image:
    """Take the picture."""
    view, lens = _view(shot), shot.lens
    shape = (lens.height_px, lens.width_px)
    image = Image(
        np.empty((*shape, 3), dtype=np.uint8),
        np.empty(shape, dtype=np.uint8),
        np.empty(shape, dtype=np.uint8),
    )
    step = max(1, _BAND_PX // lens.width_px)
    for first in range(0, lens.height_px, step):
        band = slice(first, min(first + step, lens.height_px))
        for whole, part in zip(image, _band(view, band), strict=True):
            whole[band] = part
    return image


def _view(shot: Shot) -> _View:
    plane, pose = shot.farm.plane, shot.pose
    east, north = plane.place(pose.latitude_deg, pose.longitude_deg)
    here = degrees_per_metre(pose.latitude_deg, plane.altitude_amsl_m)
    height = max(_LEAST_HEIGHT_M, pose.altitude_amsl_m - plane.altitude_amsl_m)
    stretch = (here.east / plane.scale.east, here.north / plane.scale.north)
    standing = solids(shot.farm, shot.time_utc_s)
    boxes = []
    for solid in standing:
        offset_ned = (
            (solid.middle[1] - north) / stretch[1],
            (solid.middle[0] - east) / stretch[0],
            height - solid.middle[2],
        )
        box = box_of(shot.lens, shot.pose.q_ned_camera, solid, offset_ned)
        if box is not None:
            boxes.append((solid, box))
    for crown, offset_ned in crowns_ahead(
        shot.farm, shot.lens, shot.pose.q_ned_camera, (east, north, height), stretch
    ):
        box = box_of(shot.lens, shot.pose.q_ned_camera, crown, offset_ned)
        if box is not None:
            boxes.append((crown, box))
    instant = light(shot.farm, shot.time_utc_s)
    hills = Hills(shot.farm, east, north, height)
    return _View(shot, instant, east, north, height, stretch, standing, tuple(boxes), hills)


def _band(view: _View, band: slice) -> Image:
    """The rows of a band."""
    direction = rays(view.shot.lens, view.shot.pose.q_ned_camera, band)
    direction = Rays(
        direction.east * view.stretch[0], direction.north * view.stretch[1], direction.up
    )
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        depth = np.where(
            direction.up < 0.0, np.float32(-view.height_m) / direction.up, np.float32(np.inf)
        )
    length = np.sqrt(direction.east**2 + direction.north**2 + direction.up**2)
    met = view.hills.meet(direction, depth, view.light.sun.towards_enu)
    depth[met.mask] = met.depth
    on_ground = (depth * length < _FARTHEST_M) | met.mask
    if on_ground.all():
        colours = np.empty((*depth.shape, 3), dtype=np.float32)
    else:
        colours = sky_colour(np.maximum(direction.up, 0.0) / length)
    infrared = np.zeros(depth.shape, dtype=np.float32)
    index = np.full(depth.shape, -1.0, dtype=np.float32)
    if on_ground.any():
        # Most pictures look down: what is all ground needs no picking out
        picked: _Picked = ... if on_ground.all() else on_ground
        bands, lit = _ground(view, direction, depth, picked)
        lit[met.mask[picked]] = met.lit
        seen = developed(bands, lit * view.light.direct, view.light.sky)
        colours[picked] = hazed(seen, (depth * length)[picked])
        infrared[picked] = bands.near_infrared
        index[picked] = _vegetation_index(bands.red, bands.near_infrared)
    _add_solids(view, band, direction, depth, colours, infrared, index)
    if view.light.exposure < 1.0:
        colours *= np.float32(view.light.exposure)
    return Image(encoded(colours), _byte(infrared), _byte(0.5 + 0.5 * index))


def _ground(
    view: _View, direction: Rays, depth: Pixels, on_ground: _Picked
) -> tuple[Bands, Pixels]:
    """What the ground reflects where it is met, and whether the sun shines on it."""
    met = depth[on_ground]
    east = np.float32(view.east_m) + met * direction.east[on_ground]
    north = np.float32(view.north_m) + met * direction.north[on_ground]
    size = float(np.median(met.ravel()[:: max(1, met.size // 512)])) * view.shot.lens.pixel
    moisture, vigour = _maps(view, direction, depth, on_ground)
    patch = ground.Patch(
        east, north, size, ground.quality(moisture, vigour), moisture, view.light.sun_offset_m
    )
    bands = ground.reflectance(view.shot.farm, patch)
    return bands, _sunlit(view, east, north)


def _maps(view: _View, direction: Rays, depth: Pixels, on_ground: _Picked) -> tuple[Pixels, Pixels]:
    """The farm's smooth maps at the pixels: read coarsely, then stretched between."""
    rows = _knots(depth.shape[0])
    columns = _knots(depth.shape[1])
    coarse = np.ix_(rows, columns)
    far = np.minimum(depth[coarse], np.float32(_FARTHEST_M))
    east = view.east_m + far * direction.east[coarse]
    north = view.north_m + far * direction.north[coarse]
    farm = view.shot.farm
    found = []
    for smooth in (farm.moisture_map, farm.vigour_map):
        values = smooth.over(east.astype(np.float64), north.astype(np.float64))
        found.append(_stretched(values, rows, columns, depth.shape)[on_ground])
    return found[0], found[1]


def _knots(size: int) -> NDArray[np.int64]:
    """Pixels along an edge at which the maps are read, both ends among them."""
    count = max(2, -(-size // _COARSE) + 1)
    return np.unique(np.linspace(0, size - 1, count).round().astype(np.int64))


def _stretched(
    values: NDArray[np.float64],
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    shape: tuple[int, ...],
) -> Pixels:
    """Linear interpolation between knots, along the rows and then along the columns."""
    wide = np.stack([np.interp(np.arange(shape[1]), columns, row) for row in values])
    if len(rows) == 1:
        return np.broadcast_to(wide, shape).astype(np.float32)
    at = np.interp(np.arange(shape[0]), rows, np.arange(len(rows)))
    low = np.minimum(at.astype(np.int64), len(rows) - 2)
    share = (at - low)[:, np.newaxis]
    full: Pixels = (wide[low] + share * (wide[low + 1] - wide[low])).astype(np.float32)
    return full


def _sunlit(view: _View, east: Pixels, north: Pixels) -> Pixels:
    """1 where the sun shines on the ground, 0 in the shadow of what stands there."""
    lit = np.ones(east.shape, dtype=np.float32)
    if view.light.direct == 0.0:
        return lit
    low, high = (float(east.min()), float(north.min())), (float(east.max()), float(north.max()))
    toward, (sun_east, sun_north) = view.light.sun.towards_enu, view.light.sun_offset_m
    for solid in view.solids:
        reach = solid.middle[2] + solid.half[2]
        ends = [
            solid.middle[0] - reach * sun_east,
            solid.middle[1] - reach * sun_north,
        ]
        least = [min(solid.middle[i], ends[i]) - solid.radius_m for i in (0, 1)]
        most = [max(solid.middle[i], ends[i]) + solid.radius_m for i in (0, 1)]
        if any(least[i] > high[i] or most[i] < low[i] for i in (0, 1)):
            continue
        near = (east > least[0]) & (east < most[0]) & (north > least[1]) & (north < most[1])
        if near.any():
            lit[near] *= 1.0 - solid.shades(east[near], north[near], toward)
    return lit


def _add_solids(
    view: _View,
    band: slice,
    direction: Rays,
    depth: Pixels,
    colours: NDArray[np.float32],
    infrared: Pixels,
    index: Pixels,
) -> None:
    """Draw what stands on the ground over it, the nearest in front."""
    origin = (view.east_m, view.north_m, view.height_m)
    for solid, box in view.seen:
        window = box.within(band)
        if window is None:
            continue
        part = (direction.east[window], direction.north[window], direction.up[window])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            hits = solid.hits(origin, part)
        shown = hits.depth < depth[window]
        if not shown.any():
            continue
        if solid.is_leafy:
            shade = leaves(view.shot.farm.seed, origin, part, hits, shown, view.shot.lens.pixel)
        else:
            shade = np.ones(int(shown.sum()), dtype=np.float32)
        depth[window][shown] = hits.depth[shown]
        bands = Bands(*(np.float32(each) * shade for each in solid.colour))
        east, north, up = view.light.sun.towards_enu
        facing = hits.normal_east * east + hits.normal_north * north + hits.normal_up * up
        direct = view.light.direct * np.maximum(facing, 0.0) / max(up, 0.1)
        sky = view.light.sky * (0.55 + 0.45 * hits.normal_up)
        colours[window][shown] = developed(bands, direct[shown], sky[shown])
        infrared[window][shown] = bands.near_infrared
        index[window][shown] = _vegetation_index(bands.red, bands.near_infrared)


def _vegetation_index(red: Pixels, near_infrared: Pixels) -> Pixels:
    """NDVI: near infrared less red over their sum (Rouse et al. 1974)."""
    index: Pixels = (near_infrared - red) / (near_infrared + red + np.float32(1e-6))
    return index


def _byte(share: Pixels) -> NDArray[np.uint8]:
    values: NDArray[np.uint8] = np.clip(255.0 * share + 0.5, 0.0, 255.0).astype(np.uint8)
    return values
