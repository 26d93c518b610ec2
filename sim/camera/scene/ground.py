"""What the ground reflects, pixel by pixel: soil, crop rows and their shadows, tracks, yard.

Everything is a function of the place on the map, so that two pictures of a place agree. What is
finer than a pixel fades into its mean. NDVI over a square metre is the farm's own
(`Farm.vegetation_index`): where the map says more vigour, more of the ground is under leaves.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.camera.scene.lens import Pixels
from sim.camera.scene.reflectance import (
    CONCRETE,
    GRAVEL,
    LEAF,
    LEAF_INDEX,
    SOIL,
    STRAW,
    WET_SOIL,
    Bands,
    dimmed,
    mixed,
)
from sim.camera.scene.texture import grain
from sim.world.farm import SOIL_SHARE, VIGOUR_SPREAD, WATER_SHARE, WILD_VIGOUR, Farm
from sim.world.layout import PAD_HALF_M, PADS, TRACKS, YARD, Cover, Field
from sim.world.plane import Place

Mask = NDArray[np.bool_]

_SHADE: Final = 0.30  # Light that is left in a row's own shadow
_DRIP_HALF_M: Final = 0.16  # Of the strip that a drip line keeps wet
_TRAMLINE_M: Final = 12.0  # Between the wheel tracks of the sprayer in grain
_WHEELS_M: Final = (0.9, 0.2)  # Half the gauge, half the width
TREES_FROM_EDGE_M: Final = 1.0
"""No tree of an orchard stands nearer to the field's edge [m]."""
_STRAW_INDEX: Final = 0.12


class Patch(NamedTuple):
    """Some pixels of ground."""

    east: Pixels  # [m] On the farm's map
    north: Pixels  # [m]
    size_m: float  # [m] Of a pixel on the ground, about the middle of the patch
    quality: Pixels  # [-] How good the ground is for plants, about 0
    wetness: Pixels  # [-] Map of the soil's water, about 0
    sun: tuple[float, float]  # [-] Level distance towards the sun (east, north) per metre of height

    def part(self, mask: Mask) -> "Patch":
        """Those pixels alone."""
        return Patch(
            self.east[mask],
            self.north[mask],
            self.size_m,
            self.quality[mask],
            self.wetness[mask],
            self.sun,
        )


def quality(moisture: Pixels, vigour: Pixels) -> Pixels:
    """How good the ground is for plants, from the farm's maps."""
    found: Pixels = WATER_SHARE * moisture + SOIL_SHARE * vigour
    return found


def reflectance(farm: Farm, patch: Patch) -> Bands:
    """What a patch of ground reflects; each pixel belongs to one field, or to none."""
    texture = grain(farm.seed, patch.east, patch.north, patch.size_m)
    bands = _wild(patch, texture)
    extent = _extent(patch)
    for field in farm.fields:
        if not _meets(extent, field.boundary, 0.0):
            continue
        inside = _inside(field.boundary, patch)
        if inside.all():
            return _grown(field, patch, texture)
        if inside.any():
            _put(bands, inside, _grown(field, patch.part(inside), texture[inside]))
    _add_trodden(bands, patch, texture, extent)
    return bands


def _wild(patch: Patch, texture: Pixels) -> Bands:
    return _meadow(patch, texture, WILD_VIGOUR, _STRAW_INDEX, STRAW)


def _grown(field: Field, patch: Patch, texture: Pixels) -> Bands:
    if field.cover is Cover.PASTURE:
        return _meadow(patch, texture, field.vigour, field.gap_vigour, STRAW)
    if field.cover is Cover.BARLEY:
        return _grain_field(field, patch, texture)
    return _rows(field, patch, texture)


def cover_share(good: Pixels, vigour: float, gap: float) -> Pixels:
    """Share of the ground under leaves that gives the map's NDVI; `good` is its quality."""
    index = vigour + VIGOUR_SPREAD * good
    share: Pixels = np.clip((index - gap) / (LEAF_INDEX - gap), 0.02, 0.98)
    return share


def _cover_share(patch: Patch, vigour: float, gap: float) -> Pixels:
    return cover_share(patch.quality, vigour, gap)


def _meadow(patch: Patch, texture: Pixels, vigour: float, gap: float, dry: Bands) -> Bands:
    """Tufts of grass; the taller grow where the texture is high."""
    share = np.clip(_cover_share(patch, vigour, gap) + 0.16 * texture, 0.0, 1.0)
    return dimmed(mixed(dry, LEAF, share), 1.0 + 0.10 * texture)


def _grain_field(field: Field, patch: Patch, texture: Pixels) -> Bands:
    """Grain in rows too close to see, with the wheel tracks of the sprayer."""
    across = _across(field, patch)
    share = np.clip(_cover_share(patch, field.vigour, field.gap_vigour) + 0.1 * texture, 0.0, 1.0)
    from_middle = np.abs(across - _TRAMLINE_M * np.round(across / _TRAMLINE_M))
    softness = max(0.05, patch.size_m)
    wheels = _edge(_WHEELS_M[1] - np.abs(from_middle - _WHEELS_M[0]), softness)
    soil = mixed(SOIL, WET_SOIL, np.clip(0.3 + 0.2 * patch.wetness, 0.0, 1.0))
    return dimmed(mixed(soil, LEAF, share * (1.0 - 0.9 * wheels)), 1.0 + 0.10 * texture)


def _rows(field: Field, patch: Patch, texture: Pixels) -> Bands:
    """Rows of plants on bare soil or grass, their shadows, and the strips along drip lines.

    The crowns of trees are solids (`grove.py`), which lie over this.
    """
    share = _cover_share(patch, field.vigour, field.gap_vigour)
    seen = _contrast(field, patch.size_m)
    if field.cover is Cover.OLIVES:
        canopy = (1.0 - seen) * share
    else:
        canopy = share + seen * (_canopy(field, patch, share, texture, (0.0, 0.0)) - share)
    soil = _between(field, patch, texture, seen)
    shadow = np.maximum(
        _canopy(field, patch, share, texture, _towards(patch, 0.45 * field.crop_height_m)),
        _canopy(field, patch, share, texture, _towards(patch, 0.9 * field.crop_height_m)),
    )
    shadow = seen * np.clip(shadow - canopy, 0.0, 1.0) + (1.0 - seen) * 0.3
    soil = dimmed(soil, 1.0 - (1.0 - _SHADE) * shadow)
    leaves = dimmed(LEAF, 1.0 + 0.22 * texture)
    return mixed(soil, leaves, canopy)


def _between(field: Field, patch: Patch, texture: Pixels, seen: float) -> Bands:
    """What lies between the plants: grass as far as the field has it, else soil."""
    wet = np.clip(0.30 + 0.22 * patch.wetness + 0.06 * texture, 0.0, 1.0)
    if field.drip_every:
        pitch = field.drip_every * field.row_spacing_m
        across = _across(field, patch)
        away = np.abs(across - pitch * np.round(across / pitch))
        strip = _edge(_DRIP_HALF_M + 0.03 * texture - away, max(0.06, patch.size_m))
        mean = 2.0 * _DRIP_HALF_M / pitch
        wet = np.clip(wet + 0.5 * (mean + seen * (strip - mean)), 0.0, 1.0)
    soil = dimmed(mixed(SOIL, WET_SOIL, wet), 1.0 + 0.12 * texture)
    grass = (field.gap_vigour - 0.077) / (LEAF_INDEX - 0.077)
    return mixed(soil, LEAF, np.clip(grass * (1.0 + 0.8 * texture), 0.0, 1.0))


def _canopy(
    field: Field, patch: Patch, share: Pixels, texture: Pixels, shift: tuple[float, float]
) -> Pixels:
    """Whether leaves cover a place `shift` metres (east, north) off, 0 to 1."""
    east, north = field.across
    offset = np.float32(shift[0] * east + shift[1] * north)
    across = _across(field, patch) + offset
    row = field.row_spacing_m * np.round(across / field.row_spacing_m)
    away = np.abs(across - row)
    if field.cover is Cover.OLIVES:
        radius = field.row_spacing_m * np.sqrt(share / math.pi) * (1.0 + 0.14 * texture)
        along = _along(field, patch) + np.float32(shift[0] * field.along[0])
        along += np.float32(shift[1] * field.along[1])
        plant = field.plant_spacing_m * np.round(along / field.plant_spacing_m)
        crown = _edge(radius - np.hypot(away, along - plant), max(0.15, patch.size_m))
        return crown * _stands(field, row, plant)
    half = 0.5 * field.row_spacing_m * share * (1.0 + 0.28 * texture)
    return _edge(half - away, max(0.04, patch.size_m))


def _stands(field: Field, across: Pixels, along: Pixels) -> Mask:
    """Whether a tree stands at such a place of its rows [m]."""
    east = across * np.float32(field.across[0]) + along * np.float32(field.along[0])
    north = across * np.float32(field.across[1]) + along * np.float32(field.along[1])
    stands = np.ones(east.shape, dtype=np.bool_)
    for start, end in zip(field.boundary, [*field.boundary[1:], field.boundary[0]], strict=True):
        way_east, way_north = end.east_m - start.east_m, end.north_m - start.north_m
        length = math.hypot(way_east, way_north)
        left = way_east * (north - start.north_m) - way_north * (east - start.east_m)
        stands &= left > TREES_FROM_EDGE_M * length
    return stands


def _contrast(field: Field, size_m: float) -> float:
    """How much of the rows a pixel of that size shows: all, some, or only their mean."""
    return min(1.0, max(0.0, (0.55 * field.row_spacing_m - size_m) / (0.35 * field.row_spacing_m)))


def _across(field: Field, patch: Patch) -> Pixels:
    east, north = (np.float32(part) for part in field.across)
    return east * patch.east + north * patch.north


def _along(field: Field, patch: Patch) -> Pixels:
    east, north = (np.float32(part) for part in field.along)
    return east * patch.east + north * patch.north


def _towards(patch: Patch, height_m: float) -> tuple[float, float]:
    """The level distance [m] to where something of that height shades the place from."""
    return height_m * patch.sun[0], height_m * patch.sun[1]


def _edge(inside_m: Pixels, softness_m: float) -> Pixels:
    """0 outside to 1 inside, over `softness_m`."""
    share: Pixels = np.clip(0.5 + inside_m * np.float32(1.0 / softness_m), 0.0, 1.0)
    return share


def _add_trodden(
    bands: Bands, patch: Patch, texture: Pixels, extent: tuple[float, float, float, float]
) -> None:
    """Lay tracks, the yard and the slabs on the ground."""
    worn = Bands(
        *(np.broadcast_to(band, texture.shape) for band in dimmed(GRAVEL, 1.0 + 0.12 * texture))
    )
    if _meets(extent, YARD, 0.0):
        inside = _inside(YARD, patch) & (texture < 0.9)
        trodden = mixed(worn, LEAF, np.clip(0.10 + 0.14 * texture, 0.0, 1.0))
        _put(bands, inside, Bands(*(band[inside] for band in trodden)))
    for track in TRACKS:
        for start, end in zip(track.centre_line, track.centre_line[1:], strict=False):
            if _meets(extent, (start, end), track.width_m):
                _add_track(bands, patch, worn, (start, end), track.width_m)
    for pad in PADS:
        if _meets(extent, (pad,), PAD_HALF_M):
            away = np.maximum(np.abs(patch.east - pad.east_m), np.abs(patch.north - pad.north_m))
            slab = away < PAD_HALF_M
            _put(bands, slab, Bands(*(band + 0.03 * texture[slab] for band in CONCRETE)))


def _add_track(
    bands: Bands, patch: Patch, worn: Bands, leg: tuple[Place, Place], width_m: float
) -> None:
    """Two wheel tracks with a strip of grass between them."""
    start, end = leg
    length = math.dist(start, end)
    along_track = ((end.east_m - start.east_m) / length, (end.north_m - start.north_m) / length)
    east, north = patch.east - np.float32(start.east_m), patch.north - np.float32(start.north_m)
    along = np.float32(along_track[0]) * east + np.float32(along_track[1]) * north
    aside = np.abs(np.float32(along_track[1]) * east - np.float32(along_track[0]) * north)
    on = (aside < 0.5 * width_m) & (along > -0.5 * width_m) & (along < length + 0.5 * width_m)
    middle = 0.55 * np.clip(1.0 - aside[on] / (0.2 * width_m), 0.0, 1.0)
    _put(bands, on, mixed(Bands(*(band[on] for band in worn)), LEAF, middle))


def _put(bands: Bands, mask: Mask, values: Bands) -> None:
    for band, value in zip(bands, values, strict=True):
        band[mask] = value


def _inside(ring: tuple[Place, ...], patch: Patch) -> Mask:
    """Whether pixels lie in a convex, counter-clockwise ring."""
    inside = np.ones(patch.east.shape, dtype=np.bool_)
    for start, end in zip(ring, [*ring[1:], ring[0]], strict=True):
        east, north = np.float32(end.east_m - start.east_m), np.float32(end.north_m - start.north_m)
        here = np.float32(start.east_m), np.float32(start.north_m)
        inside &= east * (patch.north - here[1]) >= north * (patch.east - here[0])
    return inside


def _extent(patch: Patch) -> tuple[float, float, float, float]:
    """Least and greatest east and north [m]."""
    return (
        float(patch.east.min()),
        float(patch.east.max()),
        float(patch.north.min()),
        float(patch.north.max()),
    )


def _meets(
    extent: tuple[float, float, float, float], places: tuple[Place, ...], margin_m: float
) -> bool:
    """Whether the box about some places, widened, meets an extent."""
    east = [place.east_m for place in places]
    north = [place.north_m for place in places]
    return (
        min(east) - margin_m <= extent[1]
        and max(east) + margin_m >= extent[0]
        and min(north) - margin_m <= extent[3]
        and max(north) + margin_m >= extent[2]
    )
