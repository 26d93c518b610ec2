"""The colours of a vegetation index (NDVI), those of the console's legend. Pure."""

from typing import Final

RAMP: Final = ((165, 0, 38), (244, 109, 67), (254, 224, 139), (166, 217, 106), (26, 152, 80))
"""Red, green and blue of the values 0 to 1 at equal distances; RdYlGn of ColorBrewer."""
Colour = tuple[int, int, int]
_STEPS: Final = 256
_NO_GROUND: Final = 16
"""Grey values below this are no ground: cameras write 0 there, and JPEG blurs it. Neither plants
nor soil nor water have an index this low (-0.87)."""


def colour(value: float) -> Colour:
    """Give the colour of a value; below 0 and above 1 that of the limit."""
    at = min(1.0, max(0.0, value)) * (len(RAMP) - 1)
    low = min(int(at), len(RAMP) - 2)
    red, green, blue = (
        round(one + (other - one) * (at - low))
        for one, other in zip(RAMP[low], RAMP[low + 1], strict=True)
    )
    return red, green, blue


def colours_of_unit() -> list[Colour]:
    """Give the colours of the values from 0 to 1 in equal steps."""
    return [colour(step / (_STEPS - 1)) for step in range(_STEPS)]


def colours_of_grey() -> list[tuple[int, int, int, int]]:
    """Give red, green, blue and opacity of the 256 grey values of a picture of the index.

    Cameras write the index as (NDVI + 1) / 2 times 255, and 0 where there is no ground.
    """
    return [
        (0, 0, 0, 0) if grey < _NO_GROUND else (*colour(grey / 127.5 - 1.0), 255)
        for grey in range(256)
    ]
