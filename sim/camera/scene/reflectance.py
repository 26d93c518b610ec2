"""Reflectance of the materials of the farm in four bands. Data.

Broad-band reflectances of leaves, soils and straw after Bowker et al. 1985, "Spectral
reflectances of natural targets" (NASA RP-1139), rounded.
"""

from typing import Final, NamedTuple

import numpy as np

from sim.camera.scene.lens import Pixels


class Bands(NamedTuple):
    """Share of the light that is reflected [-], of one material or of many pixels."""

    red: Pixels
    green: Pixels
    blue: Pixels
    near_infrared: Pixels


def material(red: float, green: float, blue: float, near_infrared: float) -> Bands:
    """The bands of one material."""
    return Bands(*(np.float32(band) for band in (red, green, blue, near_infrared)))  # type: ignore[arg-type]  # scalars broadcast


LEAF: Final = material(0.048, 0.100, 0.034, 0.67)
SOIL: Final = material(0.30, 0.215, 0.135, 0.35)
WET_SOIL: Final = material(0.16, 0.112, 0.070, 0.187)
STRAW: Final = material(0.33, 0.275, 0.16, 0.42)
GRAVEL: Final = material(0.36, 0.32, 0.26, 0.40)
CONCRETE: Final = material(0.62, 0.61, 0.58, 0.63)
LEAF_INDEX: Final = 0.866
"""NDVI of `LEAF`; that of `SOIL` is 0.077, of `STRAW` 0.12."""


def mixed(below: Bands, above: Bands, share: Pixels) -> Bands:
    """`share` of `above` on top of `below`."""
    return Bands(*(low + share * (high - low) for low, high in zip(below, above, strict=True)))


def dimmed(bands: Bands, factor: Pixels) -> Bands:
    """All bands times a factor."""
    return Bands(*(band * factor for band in bands))
