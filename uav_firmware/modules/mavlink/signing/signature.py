"""MAVLink 2 signatures: a frame is from who holds the key, and is heard once.

A signed frame ends in a trailer of 13 bytes: link id (1), time (6, little endian, in units of
10 us since 2015-01-01 UTC), mark (6). The mark is the first 48 bits of SHA-256 over the secret
key and the whole frame up to the mark (MAVLink guide, "Message Signing").

Nothing of a frame is believed, and nothing kept of it, before its mark has been found right.
pymavlink 2.4.50 does it the other way round, so that one forged frame with a time in the far
future locks the genuine sender out.
"""

import hashlib
import hmac
from collections.abc import Callable
from enum import Enum
from typing import Final, NamedTuple

KEY_LENGTH: Final = 32
TICK_US: Final = 10
"""Unit of a signature's time [us]."""
EPOCH_US: Final = 1_420_070_400_000_000
"""2015-01-01 00:00 UTC [us since 1970]."""
LATEST: Final = (1 << 48) - (1 << 44)
"""Times beyond (the year 2098) are refused: a clock pushed to its end could not go on."""
NEW_STREAM_WINDOW: Final = 60_000_000 // TICK_US
"""How far behind the own clock the first frame of a stream may be [ticks]: one minute."""
MAX_STREAMS: Final = 256
"""Streams kept for a key; only who holds the key can make one."""

_MARK_LENGTH: Final = 6
_TIME: Final = slice(-12, -6)
_LINK: Final = -13


class Refusal(Enum):
    """Why a whole, undamaged frame is not listened to."""

    UNSIGNED = "unsigned"
    BAD_SIGNATURE = "bad signature"
    REPLAYED = "replayed"
    VERSION_1 = "version 1"


class Stream(NamedTuple):
    """Frames whose times must rise."""

    link: int
    system: int
    component: int


class SigningClock:
    """The time of signatures: that of the world, but never back and never twice the same.

    A world clock that is wrong or was never set is put right by the newest genuine frame, and
    by what was kept of an earlier run.
    """

    def __init__(self, world_us: Callable[[], int], *, used: int = 0, heard: int = 0) -> None:
        """Start at the world's time or later.

        Args:
            world_us: Gives the world's time [us since 1970].
            used: A time that no earlier run has gone beyond in sending [ticks].
            heard: A time that an earlier run has certainly reached [ticks].
        """
        self._world_us = world_us
        self._used = used
        self._heard = heard

    @property
    def used(self) -> int:
        """Time of the newest frame that was sent, or one that it must be above [ticks]."""
        return self._used

    def now(self) -> int:
        """The present time, as far as it is known [ticks]."""
        return max((self._world_us() - EPOCH_US) // TICK_US, self._heard)

    def next(self) -> int:
        """A time for the next frame to be sent [ticks]."""
        self._used = max(self._used + 1, self.now())
        return self._used

    def hear(self, time: int) -> None:
        """Take note of the time in a genuine frame, or of one set by hand [ticks]."""
        self._heard = max(self._heard, time)


class Signer:
    """One secret key: marks what is sent, judges what is heard."""

    def __init__(self, key: bytes, clock: SigningClock) -> None:
        """Take a key.

        Raises:
            ValueError: if it is not 32 bytes, or all of them zero, which means no key.
        """
        if len(key) != KEY_LENGTH:
            raise ValueError(f"a signing key has {KEY_LENGTH} bytes, not {len(key)}")
        if not any(key):
            raise ValueError("a signing key of zeros is none")
        self._key = key
        self._clock = clock
        self._newest: dict[Stream, int] = {}

    def sign(self, frame: bytes, link: int) -> bytes:
        """Complete a frame whose header says that it is signed."""
        body = frame + bytes((link,)) + self._clock.next().to_bytes(6, "little")
        return body + self._mark(body)

    def judge(self, frame: bytes, system: int, component: int) -> Refusal | None:
        """Why a signed frame is refused; None for a genuine one, which is then taken note of."""
        if not hmac.compare_digest(self._mark(frame[:-_MARK_LENGTH]), frame[-_MARK_LENGTH:]):
            return Refusal.BAD_SIGNATURE
        time = int.from_bytes(frame[_TIME], "little")
        stream = Stream(frame[_LINK], system, component)
        if time > LATEST or not self._is_news(stream, time):
            return Refusal.REPLAYED
        self._newest[stream] = time
        self._clock.hear(time)
        return None

    def _is_news(self, stream: Stream, time: int) -> bool:
        newest = self._newest.get(stream)
        if newest is not None:
            return time > newest
        oldest = self._clock.now() - NEW_STREAM_WINDOW
        if len(self._newest) >= MAX_STREAMS:
            # Below the window a new stream is refused anyway: such an entry guards nothing.
            self._newest = {one: last for one, last in self._newest.items() if last >= oldest}
        return time >= oldest and len(self._newest) < MAX_STREAMS

    def _mark(self, covered: bytes) -> bytes:
        return hashlib.sha256(self._key + covered).digest()[:_MARK_LENGTH]
