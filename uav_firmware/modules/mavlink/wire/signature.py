"""MAVLink 2 signatures: authenticate frames and refuse replays.

A signed frame ends in a trailer of 13 bytes: link id (1), time (6, little endian, in units of
10 us since 2015-01-01 UTC), signature (6). The signature is the first 48 bits of SHA-256 over the
secret key and the frame up to the signature (MAVLink guide, "Message Signing").

The signature is verified before any field of the frame is used or stored. pymavlink 2.4.50 stores
the time first, so that one forged frame with a time in the far future locks the genuine sender
out.
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
"""Later times (beyond the year 2098) are refused, because the clock could not advance further."""
CLOCK_SET: Final = (1_735_689_600_000_000 - EPOCH_US) // TICK_US
"""A time before this, 2025-01-01, is of a clock that is not set [ticks]."""
LEAD: Final = 24 * 3600 * 1_000_000 // TICK_US
"""Largest lead of a frame over a world clock that is set [ticks]: one day, because a wrong time
zone is less than that, and the lead is how long a station whose clock is ahead shuts others out."""
LEAD_WITHOUT_CLOCK: Final = 365 * LEAD
"""Largest lead over the newest time known, without a world clock [ticks]: one year, because the
vehicle may have been stored for months."""
NEW_STREAM_WINDOW: Final = 60_000_000 // TICK_US
"""Largest lag of the first frame of a stream behind the own clock [ticks]: one minute."""
MAX_STREAMS: Final = 256
"""Streams stored per key; only a holder of the key can create one."""

_SIGNATURE_LENGTH: Final = 6
_TIME_LENGTH: Final = 6
_LINK: Final = -13


class Refusal(Enum):
    """Reason why a frame with a valid checksum is refused."""

    UNSIGNED = "unsigned"
    BAD_SIGNATURE = "bad signature"
    REPLAYED = "replayed"
    AHEAD = "ahead of the vehicle's clock"
    VERSION_1 = "version 1"


class Stream(NamedTuple):
    """Source of frames with increasing times."""

    link: int
    system: int
    component: int


class SigningClock:
    """Time of signatures: UTC, strictly increasing.

    The newest genuine frame and the stored state of an earlier run correct a world clock that is
    wrong or not set.
    """

    def __init__(self, world_us: Callable[[], int], *, used: int = 0, observed: int = 0) -> None:
        """Start at the world time or later.

        Args:
            world_us: Returns the world time [us since 1970].
            used: A time that no frame sent by an earlier run exceeds [ticks].
            observed: A time that an earlier run has reached [ticks].
        """
        self._world_us = world_us
        self._used = used
        self._observed = observed

    @property
    def used(self) -> int:
        """Lower bound of the time of the next frame to send [ticks]."""
        return self._used

    def now(self) -> int:
        """Best estimate of the present time [ticks]."""
        return max(self._world(), self._observed)

    def latest(self) -> int:
        """Latest time to accept [ticks].

        The clock follows what is accepted, and a frame that was accepted could be repeated until
        its time has passed. MAVLink has no limit, so one frame of a station whose year is wrong
        would shut out every new station until then. A world clock that is more than the lead
        behind what was accepted has lost its time: it is treated as not set.
        """
        world = self._world()
        if world >= max(CLOCK_SET, self._observed - LEAD):
            return min(world + LEAD, LATEST)
        if self._observed >= CLOCK_SET:
            return min(self._observed + LEAD_WITHOUT_CLOCK, LATEST)
        return LATEST

    def next(self) -> int:
        """Time for the next frame to send [ticks]."""
        self._used = max(self._used + 1, self.now())
        return self._used

    def observe(self, time: int) -> None:
        """Advance to the time of a genuine frame or of SETUP_SIGNING [ticks]."""
        self._observed = max(self._observed, time)

    def _world(self) -> int:
        return (self._world_us() - EPOCH_US) // TICK_US


class Signer:
    """Signs and verifies frames with one secret key."""

    def __init__(self, key: bytes, clock: SigningClock) -> None:
        """Use a key.

        Raises:
            ValueError: if it is not 32 bytes, or all zeros, which means no key.
        """
        if len(key) != KEY_LENGTH:
            raise ValueError(f"a signing key has {KEY_LENGTH} bytes, not {len(key)}")
        if not any(key):
            raise ValueError("a signing key must not be all zeros")
        self._key = key
        self._clock = clock
        self._newest: dict[Stream, int] = {}

    def sign(self, frame: bytes, link: int) -> bytes:
        """Append the signature to a frame whose header has the signed flag."""
        body = frame + bytes((link,)) + self._clock.next().to_bytes(6, "little")
        return body + self._signature(body)

    def verify(self, frame: bytes, system: int, component: int) -> Refusal | None:
        """Return why a signed frame is refused; None for a genuine one, whose time is stored."""
        if not hmac.compare_digest(
            self._signature(frame[:-_SIGNATURE_LENGTH]), frame[-_SIGNATURE_LENGTH:]
        ):
            return Refusal.BAD_SIGNATURE
        time = int.from_bytes(
            frame[-_SIGNATURE_LENGTH - _TIME_LENGTH : -_SIGNATURE_LENGTH], "little"
        )
        stream = Stream(frame[_LINK], system, component)
        if time > self._clock.latest():
            return Refusal.AHEAD
        if not self._is_newer(stream, time):
            return Refusal.REPLAYED
        self._newest[stream] = time
        self._clock.observe(time)
        return None

    def _is_newer(self, stream: Stream, time: int) -> bool:
        newest = self._newest.get(stream)
        if newest is not None:
            return time > newest
        oldest = self._clock.now() - NEW_STREAM_WINDOW
        if len(self._newest) >= MAX_STREAMS:
            # Entries below the window are useless: a new stream there is refused anyway
            self._newest = {one: last for one, last in self._newest.items() if last >= oldest}
        return time >= oldest and len(self._newest) < MAX_STREAMS

    def _signature(self, covered: bytes) -> bytes:
        return hashlib.sha256(self._key + covered).digest()[:_SIGNATURE_LENGTH]
