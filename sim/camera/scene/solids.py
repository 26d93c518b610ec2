"""Things that stand on the ground: where a ray meets them, and where their surface faces.

Two shapes are enough for barns, trees, tractors and cows: boxes that stand upright, and
ellipsoids. A ray through either is solved in the shape's own frame, where the box is the unit cube
(slab method, Kay and Kajiya, SIGGRAPH 1986) and the ellipsoid the unit sphere.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from sim.camera.scene.lens import Pixels

Point = tuple[float, float, float]
"""East, north [m] on the farm's map and height [m] above the level ground."""

_FAR: Final = np.float32(np.inf)
_THIN: Final = 1e-9


class Hits(NamedTuple):
    """Where rays meet a solid: `depth` in units of the ray's length, infinite for a miss."""

    depth: Pixels
    normal_east: Pixels  # [-] Outward unit normal; undefined for a miss
    normal_north: Pixels
    normal_up: Pixels


@dataclass(frozen=True)
class Solid:
    """A box or an ellipsoid about `middle`, half as long as `half` along its axes."""

    middle: Point
    half: Point  # [m] Along its bearing, to the right of it, up
    bearing_deg: float
    colour: tuple[float, float, float, float]  # [-] Reflectance: red, green, blue, near infrared
    is_round: bool = False
    is_leafy: bool = False  # A crown: its colour is uneven, its outline ragged

    @cached_property
    def radius_m(self) -> float:
        """Radius of a sphere about the middle that holds it all [m]."""
        return max(self.half) if self.is_round else math.hypot(*self.half)

    @cached_property
    def axes(self) -> tuple[float, float]:
        """Sine and cosine of the bearing."""
        bearing = math.radians(self.bearing_deg)
        return math.sin(bearing), math.cos(bearing)

    def hits(
        self, origin: tuple[Pixels | float, ...], direction: tuple[Pixels | float, ...]
    ) -> Hits:
        """Where rays from `origin` along `direction` (east, north, up) first enter the solid."""
        start = self._inward(origin[0], origin[1], origin[2], self.middle)
        ahead = self._inward(direction[0], direction[1], direction[2], (0.0, 0.0, 0.0))
        return self._ellipsoid(start, ahead) if self.is_round else self._box(start, ahead)

    def shades(self, east: Pixels, north: Pixels, sun: Point) -> Pixels:
        """Whether places on the ground see the solid before the sun: True for shade."""
        hits = self.hits((east, north, 0.0), sun)
        shaded: Pixels = np.isfinite(hits.depth)
        return shaded

    def _inward(
        self, east: Pixels | float, north: Pixels | float, up: Pixels | float, less: Point
    ) -> tuple[Pixels, Pixels, Pixels]:
        """Into the frame of the unit shape."""
        sine, cosine = self.axes
        away_east = np.asarray(east - np.float32(less[0]), dtype=np.float32)
        away_north = np.asarray(north - np.float32(less[1]), dtype=np.float32)
        above = np.asarray(up - np.float32(less[2]), dtype=np.float32)
        along = away_east * np.float32(sine) + away_north * np.float32(cosine)
        right = away_east * np.float32(cosine) - away_north * np.float32(sine)
        half = [np.float32(each) for each in self.half]
        return along / half[0], right / half[1], above / half[2]

    def _outward(self, along: Pixels, right: Pixels, up: Pixels) -> tuple[Pixels, Pixels, Pixels]:
        """A normal of the unit shape as a unit normal on the map."""
        sine, cosine = self.axes
        along, right, up = (
            part / np.float32(half)
            for part, half in zip((along, right, up), self.half, strict=True)
        )
        norm = np.sqrt(along * along + right * right + up * up) + np.float32(_THIN)
        along, right, up = along / norm, right / norm, up / norm
        return along * sine + right * cosine, along * cosine - right * sine, up

    def _box(self, start: tuple[Pixels, ...], ahead: tuple[Pixels, ...]) -> Hits:
        """Slab by slab: a ray is inside where it is between all three pairs of faces."""
        entries, exits = [], []
        for place, step in zip(start, ahead, strict=True):
            safe = np.where(np.abs(step) < _THIN, np.float32(_THIN), step)
            one, other = (-1.0 - place) / safe, (1.0 - place) / safe
            entries.append(np.minimum(one, other))
            exits.append(np.maximum(one, other))
        entry = np.maximum(np.maximum(entries[0], entries[1]), entries[2])
        leave = np.minimum(np.minimum(exits[0], exits[1]), exits[2])
        depth = np.where((entry <= leave) & (entry > 0.0), entry, _FAR)
        faces = [
            np.where(entry == each, -np.sign(step), 0.0)
            for each, step in zip(entries, ahead, strict=True)
        ]
        return Hits(depth.astype(np.float32), *self._outward(faces[0], faces[1], faces[2]))

    def _ellipsoid(self, start: tuple[Pixels, ...], ahead: tuple[Pixels, ...]) -> Hits:
        """The nearer root of |start + depth * ahead| = 1."""
        square = sum(step * step for step in ahead)
        half = sum(place * step for place, step in zip(start, ahead, strict=True))
        rest = sum(place * place for place in start) - 1.0
        under = half * half - square * rest
        depth = (-half - np.sqrt(np.maximum(under, 0.0))) / square
        depth = np.where((under >= 0.0) & (depth > 0.0), depth, _FAR)
        shown = np.where(np.isfinite(depth), depth, 0.0)
        normal = [place + shown * step for place, step in zip(start, ahead, strict=True)]
        return Hits(depth.astype(np.float32), *self._outward(normal[0], normal[1], normal[2]))
