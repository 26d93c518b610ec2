"""Detects that the vehicle has hit something: what is integrated over a blow is not to be trusted.

A blow lasts a few milliseconds, less than a sample, and may exceed the accelerometer's range: the
velocity afterwards is wrong by metres per second, and no sensor is broken for that. Only the
beginning counts, so that an accelerometer which reads a large force for long hides nothing.
"""

from typing import Final

from uav_firmware.msg.vectors import Vector3

_BLOW_M_S2: Final = 45.0  # Beyond what the rotors give, twice over
_DISTURBED_US: Final = 2_000_000


class Impact:
    """When the force last rose beyond what flight gives."""

    __slots__ = ("_beyond", "_struck_us")

    def __init__(self) -> None:
        self._beyond = False
        self._struck_us: int | None = None

    def update(self, force_frd: Vector3, time_us: int) -> None:
        """Take a sample [m/s^2]."""
        x, y, z = force_frd
        beyond = x * x + y * y + z * z > _BLOW_M_S2 * _BLOW_M_S2
        if beyond and not self._beyond:
            self._struck_us = time_us
        self._beyond = beyond

    def is_recent(self, now_us: int) -> bool:
        """Whether innovations may still come from a blow."""
        return self._struck_us is not None and now_us - self._struck_us < _DISTURBED_US
