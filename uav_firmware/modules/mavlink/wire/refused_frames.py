"""Counts what is not listened to, and tells the user, now and then."""

from typing import Final

from uav_firmware.modules.mavlink.signing.signature import Refusal
from uav_firmware.msg.link import RefusedFrames

TELL_EVERY_US: Final = 30_000_000
"""At most one sentence in half a minute, whatever arrives."""


class RefusalCounter:
    """Frames refused since the start, by reason."""

    def __init__(self) -> None:
        self._refused = dict.fromkeys(Refusal, 0)
        self._told = dict.fromkeys(Refusal, 0)
        self._tell_us = 0
        self._published = RefusedFrames(0)
        self.malformed: int = 0
        self.flood: int = 0

    def count(self, reason: Refusal) -> None:
        """Note one frame."""
        self._refused[reason] += 1

    def news(self, now_us: int) -> RefusedFrames | None:
        """The counts, if they have changed since the last call."""
        counts = RefusedFrames(
            now_us,
            malformed=self.malformed,
            unsigned=self._refused[Refusal.UNSIGNED],
            bad_signature=self._refused[Refusal.BAD_SIGNATURE],
            replayed=self._refused[Refusal.REPLAYED],
            version_1=self._refused[Refusal.VERSION_1],
            flood=self.flood,
        )
        if counts[1:] == self._published[1:]:
            return None
        self._published = counts
        return counts

    def sentence(self, now_us: int) -> str | None:
        """What to tell the user now, if anything: only of frames that somebody meant for us.

        Noise on the line is no event; it is only counted.
        """
        new = {reason: self._refused[reason] - self._told[reason] for reason in Refusal}
        if now_us < self._tell_us or not any(new.values()):
            return None
        self._tell_us = now_us + TELL_EVERY_US
        self._told = dict(self._refused)
        parts = ", ".join(f"{count} {reason.value}" for reason, count in new.items() if count)
        return f"MAVLink frames refused: {parts}"
