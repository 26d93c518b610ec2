"""Detects that the vehicle has hit something: what is integrated over a blow is not to be trusted.

A blow lasts a few milliseconds, less than a sample, and may exceed the accelerometer's range: the
velocity afterwards is wrong by metres per second, and no sensor is broken for that. Only the
beginning counts, so that an accelerometer which reads a large force for long hides nothing.

Where the range was exceeded, what the vehicle has gained in velocity is not known: for the
first fix that was taken after the blow that doubt counts, else it would be rejected for seconds.
"""

from typing import Final

from uav_firmware.msg.vectors import Vector3

_BLOW_M_S2: Final = 45.0  # Beyond what the rotors give, twice over
_DISTURBED_US: Final = 2_000_000
_CLIPS_M_S2: Final = 150.0  # Of an axis: that of the usual 16 g sensor saturates
_LONGEST_US: Final = 1_000_000  # A fix later than that finds an estimate that others have corrected

UNSEEN_M_S: Final = 3.0
"""[m/s] Of velocity that a blow beyond the range changes unseen, one sigma of each axis."""


class Impact:
    """When the force last rose beyond what flight gives."""

    __slots__ = ("_beyond", "_clipped_us", "_struck_us")

    def __init__(self) -> None:
        self._beyond = False
        self._struck_us: int | None = None
        self._clipped_us: int | None = None  # Until a fix of after it has come

    def update(self, force_frd: Vector3, time_us: int) -> None:
        """Take a sample [m/s^2]."""
        x, y, z = force_frd
        beyond = x * x + y * y + z * z > _BLOW_M_S2 * _BLOW_M_S2
        if beyond and not self._beyond:
            self._struck_us = time_us
        self._beyond = beyond
        if beyond and max(abs(x), abs(y), abs(z)) > _CLIPS_M_S2:
            self._clipped_us = time_us

    def is_recent(self, now_us: int) -> bool:
        """Whether innovations may still come from a blow."""
        return self._struck_us is not None and now_us - self._struck_us < _DISTURBED_US

    def unseen_s(self, fix_us: int, now_us: int) -> float | None:
        """How long ago a blow beyond the range was, once for the first fix that is of after it."""
        clipped_us = self._clipped_us
        if clipped_us is None or fix_us <= clipped_us:
            return None
        self._clipped_us = None
        ago_us = now_us - clipped_us
        return ago_us * 1e-6 if ago_us < _LONGEST_US else None
