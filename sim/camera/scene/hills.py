"""The hills round the farm from the camera: which rays meet them, and how the sun lights them.

For every bearing the land is walked outwards, and the steepest view up to each distance is kept:
a ray meets the land where that first reaches its own slope (the horizon method of Blinn 1977 and
Max 1988, as for bump shadows). The level floor itself is exact elsewhere; here is only what lies
beyond it.
"""

import math
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.camera.scene.lens import Pixels, Rays
from sim.world.farm import FLOOR_M, Farm
from sim.world.plane import Array

_BEARINGS: Final = 2048
_NEAREST_M, _FARTHEST_M, _STEPS = 20.0, 8000.0, 96
_STEEPEST: Final = 1.9  # Steeper slopes, up or down, count as this one
_ROOM: Final = 4.0  # Between the slopes of one bearing and the next in one sorted list


class Met(NamedTuple):
    """Rays that meet the hills."""

    mask: NDArray[np.bool_]  # Of the pixels asked about
    depth: Pixels  # Of those in the mask, in units of the ray's length
    lit: Pixels  # [-] Sunlight on the slope against that on level ground


class _Table(NamedTuple):
    """The land by bearing (rows) and distance (columns), as one place sees it."""

    height: Array  # [m] Above the floor
    slope: Array  # [-] At which it is seen
    rising: Array  # [-] Greatest slope up to each distance, all rows in one sorted list
    top: float  # [-] Greatest slope of all


class Hills:
    """The hills as one place sees them; worked out when the first ray passes over the floor."""

    def __init__(self, farm: Farm, east_m: float, north_m: float, height_m: float) -> None:
        self._farm = farm
        self._east_m, self._north_m, self._height_m = east_m, north_m, height_m
        self._distance = np.geomspace(_NEAREST_M, _FARTHEST_M, _STEPS)

    @cached_property
    def _table(self) -> _Table:
        bearing = 2.0 * math.pi * np.arange(_BEARINGS) / _BEARINGS
        east = self._east_m + np.sin(bearing)[:, np.newaxis] * self._distance
        north = self._north_m + np.cos(bearing)[:, np.newaxis] * self._distance
        height = self._farm.hill_heights_m(east, north)
        slope = np.clip((height - self._height_m) / self._distance, -_STEEPEST, _STEEPEST)
        steepest = np.maximum.accumulate(slope, axis=1)
        rising = (steepest + _ROOM * np.arange(_BEARINGS)[:, np.newaxis]).ravel()
        return _Table(height, slope, rising, float(steepest[:, -1].max()))

    def meet(self, direction: Rays, depth: Pixels, sun: tuple[float, float, float]) -> Met:
        """Which rays meet the hills, of those that do not meet the floor at `depth`."""
        with np.errstate(invalid="ignore"):
            away = np.hypot(
                self._east_m + depth * direction.east, self._north_m + depth * direction.north
            )
        mask = ~(away < FLOOR_M)
        if not mask.any():
            return Met(mask, depth[mask], depth[mask])
        level = np.hypot(direction.east, direction.north) + np.float32(1e-9)
        slope = direction.up / level
        mask &= (slope < self._table.top) & (slope > -_STEEPEST)
        if not mask.any():
            return Met(mask, depth[mask], depth[mask])
        east, north = (
            direction.east[mask].astype(np.float64),
            direction.north[mask].astype(np.float64),
        )
        bearing, step = self._found(east, north, slope[mask].astype(np.float64))
        hit = step < _STEPS
        mask[mask] = hit
        bearing, step = bearing[hit], step[hit]
        distance = self._between(bearing, step, slope[mask].astype(np.float64))
        lit = self._lit(bearing, step, sun)
        return Met(mask, (distance / level[mask]).astype(np.float32), lit.astype(np.float32))

    def _found(
        self, east: Array, north: Array, slope: Array
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Bearing and first step at which the land reaches a ray; `_STEPS` where it never does."""
        turn = np.arctan2(east, north) / (2.0 * math.pi) * _BEARINGS
        bearing = np.round(turn).astype(np.int64) % _BEARINGS
        place = np.searchsorted(self._table.rising, slope + _ROOM * bearing)
        return bearing, place - bearing * _STEPS

    def _between(self, bearing: NDArray[np.int64], step: NDArray[np.int64], slope: Array) -> Array:
        """Level distance [m] at which a ray is met, between a step and the one before."""
        before = np.maximum(step - 1, 0)
        low, high = self._table.slope[bearing, before], self._table.slope[bearing, step]
        share = np.clip((slope - low) / np.maximum(high - low, 1e-9), 0.0, 1.0)
        found: Array = self._distance[before] + share * (
            self._distance[step] - self._distance[before]
        )
        return found

    def _lit(
        self,
        bearing: NDArray[np.int64],
        step: NDArray[np.int64],
        sun: tuple[float, float, float],
    ) -> Array:
        """Sunlight on the slope by Lambert's law, against that on level ground."""
        before = np.maximum(step - 1, 0)
        run = np.maximum(self._distance[step] - self._distance[before], 1e-6)
        height = self._table.height
        outward = (height[bearing, step] - height[bearing, before]) / run
        aside = height[(bearing + 1) % _BEARINGS, step] - height[bearing - 1, step]
        aside /= 4.0 * math.pi / _BEARINGS * self._distance[step]
        angle = 2.0 * math.pi * bearing / _BEARINGS
        east = outward * np.sin(angle) + aside * np.cos(angle)
        north = outward * np.cos(angle) - aside * np.sin(angle)
        facing = (sun[2] - east * sun[0] - north * sun[1]) / np.sqrt(1.0 + east**2 + north**2)
        found: Array = np.clip(facing / max(sun[2], 0.1), 0.0, 2.0)
        return found
