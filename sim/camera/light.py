"""Sunlight, skylight and the exposure of a picture: from reflectance to what a pixel says."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.camera.scene.lens import Pixels
from sim.camera.scene.reflectance import Bands
from sim.world.farm import Farm
from sim.world.sun import Sun, illuminance_lx

_SUN_TINT: Final = (1.04, 1.00, 0.92)  # Red, green, blue of the sun against daylight
_SKY_TINT: Final = (0.82, 0.96, 1.18)
_GAIN: Final = (
    1.75  # A leaf in the sun comes out at two fifths of white, dry soil at three quarters
)
_HAZE_M: Final = 2600.0  # Over which two thirds of a distant thing are haze
_HORIZON: Final = (0.62, 0.72, 0.84)
_ZENITH: Final = (0.13, 0.26, 0.55)
_DIM_LX: Final = 30.0
"""Light that the longest exposure still makes a picture of as bright as by day."""
_LOWEST_SKY: Final = 0.12  # Share of the light that comes from the sky by day, at least


class Light(NamedTuple):
    """The light of an instant, in shares of all light on level ground."""

    sun: Sun
    direct: float  # [-] From the sun, on level ground
    sky: float  # [-] From the whole sky
    exposure: float = 1.0  # [-] How bright the picture is; less than 1 where no exposure is enough

    @property
    def sun_offset_m(self) -> tuple[float, float]:
        """Level distance towards the sun (east, north) per metre of height."""
        east, north, up = self.sun.towards_enu
        steep = max(up, 0.05)
        return east / steep, north / steep


def light(farm: Farm, time_utc_s: float) -> Light:
    """Light on the farm at a time [s since 1970].

    The exposure follows it, as a camera's does; after dusk it comes to its end.
    """
    place = farm.sun(time_utc_s)
    if place.elevation_deg <= 0.0:
        return Light(place, 0.0, 1.0, min(1.0, illuminance_lx(place.elevation_deg) / _DIM_LX))
    total = illuminance_lx(place.elevation_deg)
    sky = 800.0 + 15_500.0 * max(0.0, place.towards_enu[2]) ** 0.5
    share = min(1.0, max(_LOWEST_SKY, sky / total))
    return Light(place, 1.0 - share, share)


def developed(bands: Bands, direct: Pixels | float, sky: Pixels | float) -> NDArray[np.float32]:
    """Red, green and blue, linear, of surfaces that get so much light from sun and sky."""
    colours = (bands.red, bands.green, bands.blue)
    return np.stack(
        [
            band * (direct * np.float32(_GAIN * sun) + sky * np.float32(_GAIN * blue))
            for band, sun, blue in zip(colours, _SUN_TINT, _SKY_TINT, strict=True)
        ],
        axis=-1,
    )


def sky_colour(rise: Pixels) -> NDArray[np.float32]:
    """Linear colour of the sky, by the sine of the height above the horizon."""
    share = np.clip(rise, 0.0, 1.0)[..., np.newaxis] ** np.float32(0.6)
    horizon, zenith = (np.array(colour, dtype=np.float32) for colour in (_HORIZON, _ZENITH))
    colours: NDArray[np.float32] = horizon + share * (zenith - horizon)
    return colours


def hazed(colours: NDArray[np.float32], distance_m: Pixels) -> NDArray[np.float32]:
    """Colours seen through so much air."""
    clear = np.exp(distance_m * np.float32(-1.0 / _HAZE_M))[..., np.newaxis]
    horizon = np.array(_HORIZON, dtype=np.float32)
    seen: NDArray[np.float32] = horizon + clear * (colours - horizon)
    return seen


_CURVE: Final = np.round(255.0 * np.linspace(0.0, 1.0, 4096) ** (1.0 / 2.2)).astype(np.uint8)


def encoded(colours: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Linear 0..1 as bytes with the gamma of a display, 2.2."""
    steps = np.clip(colours * np.float32(4095.0), 0.0, 4095.0).astype(np.int16)
    values: NDArray[np.uint8] = _CURVE[steps]
    return values
