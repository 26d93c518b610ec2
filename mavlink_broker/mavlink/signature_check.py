"""Which vehicles are listened to: signatures asked for, checked, and what is refused counted.

The rules for times and the making of signatures are pymavlink's own. What stands here is the
order: pymavlink 2.4.50 keeps a frame's time before it has looked at the signature, so that one
forged frame locks the genuine sender out. Here it is asked only about frames that are genuine.

Nothing is kept over a restart. A vehicle signs above every time that it has accepted, so its
first frame puts the broker's clock above all that the broker ever sent to it; and the broker
says nothing to a vehicle that it has not heard.
"""

import hashlib
import hmac
import logging
from collections import Counter
from collections.abc import Callable, Collection
from datetime import UTC, datetime
from enum import Enum
from typing import Any, Final

from mavlink_broker.mavlink.dialect import Message, Source, mavlink, source_of
from mavlink_broker.mavlink.frames import signed
from mavlink_broker.mavlink.key_ring import KeyRing

EPOCH: Final = datetime(2015, 1, 1, tzinfo=UTC)
TICKS_PER_S: Final = 100_000
TELL_EVERY_S: Final = 30.0
"""At most one line in half a minute, whatever arrives."""

_MARK_LENGTH: Final = 6
_SIGNED_FLAG: Final = 0x01
_VERSION_1: Final = 0xFE

_LOG = logging.getLogger(__name__)


class Refusal(Enum):
    """Why a whole, undamaged frame is not listened to."""

    UNSIGNED = "unsigned"
    BAD_SIGNATURE = "bad signature"
    REPLAYED = "replayed or over a minute old"
    VERSION_1 = "version 1"
    NO_KEY = "no key for that system"


class VehicleSigning:
    """The key shared with one vehicle."""

    def __init__(self, key: bytes, utc: Callable[[], datetime]) -> None:
        self._judge = mavlink.MAVLink(None)  # Its clock is not what we have signed with
        self._judge.signing.secret_key = key
        self._newest = 0  # [10 us] Of all genuine frames
        self._codec = mavlink.MAVLink(None)
        self._codec.signing.secret_key = key
        self._codec.signing.sign_outgoing = True
        self._key = key
        self._utc = utc

    def for_sending(self) -> Any:
        """What pymavlink signs the next frame by: the key, and a time that is never used twice."""
        signing = self._codec.signing
        signing.timestamp = max(signing.timestamp, self._ticks(), self._newest)
        return signing

    def mark(self, frame: bytes) -> bytes:
        """Give a copy of somebody's frame that is signed with this key."""
        signing = self.for_sending()
        copy = signed(frame, self._key, signing.link_id, signing.timestamp)
        signing.timestamp += 1
        return copy

    def judge(self, frame: bytearray, source: Source) -> Refusal | None:
        """Why a signed frame is refused; None for a genuine one that was not heard before."""
        mark = hashlib.sha256(self._key + frame[:-_MARK_LENGTH]).digest()[:_MARK_LENGTH]
        if not hmac.compare_digest(mark, frame[-_MARK_LENGTH:]):
            return Refusal.BAD_SIGNATURE
        # A new stream is held against the time of day as it is now, and what was genuine: a clock
        # that was ahead and has been corrected must not keep genuine frames out.
        clock = self._judge.signing
        clock.timestamp = max(self._ticks(), self._newest)
        is_news: bool = self._judge.check_signature(frame, *source)
        if not is_news:
            return Refusal.REPLAYED
        self._newest = max(self._newest, int.from_bytes(frame[-12:-6], "little"))
        return None

    def _ticks(self) -> int:
        return int((self._utc() - EPOCH).total_seconds() * TICKS_PER_S)


class Guard:
    """Judges every message; without a key ring every vehicle is listened to."""

    def __init__(
        self, ring: KeyRing | None, unsigned: Collection[int], utc: Callable[[], datetime]
    ) -> None:
        """Ask for signatures by the keys of a ring, but not of the systems that cannot sign."""
        self._ring = ring
        self._unsigned = frozenset(unsigned)
        self._utc = utc
        self._signing: dict[int, VehicleSigning] = {}
        self._told: Counter[Refusal] = Counter()
        self._tell_again = 0.0
        self.refused: Counter[Refusal] = Counter()

    @property
    def is_open(self) -> bool:
        """Whether nobody has to sign."""
        return self._ring is None

    def admits(self, message: Message, now: float, *, is_trusted: bool = False) -> bool:
        """Whether a message is listened to; if not, it is counted and now and then told.

        On a trusted link it need not be signed; a signature that is there must be right.
        """
        refusal = self._judge(message, now)
        if is_trusted and refusal in {Refusal.UNSIGNED, Refusal.VERSION_1}:
            return True
        if refusal is None:
            return True
        self.refused[refusal] += 1
        if now >= self._tell_again:
            self._tell_again = now + TELL_EVERY_S
            self._tell(source_of(message))
        return False

    def signing_for(self, system: int, now: float) -> VehicleSigning | None:
        """How frames to a system are signed; None: not at all."""
        if self._ring is None or system in self._unsigned:
            return None
        if system not in self._signing:
            key = self._ring.key_of(system, now)
            if key is None:
                return None
            self._signing[system] = VehicleSigning(key, self._utc)
        return self._signing[system]

    def greetings(self, is_heard: Callable[[int], bool], now: float) -> list[VehicleSigning | None]:
        """How to sign what is said to vehicles that have not spoken: once by each one's key."""
        if self._ring is None:
            return [None]
        keyed = [system for system in self._ring.systems() if not is_heard(system)]
        by_key = [self.signing_for(system, now) for system in keyed]
        unsigned = [None] if self._unsigned else []
        return [*unsigned, *(signing for signing in by_key if signing is not None)]

    def _judge(self, message: Message, now: float) -> Refusal | None:
        source = source_of(message)
        if self._ring is None or source.system in self._unsigned:
            return None
        frame = message.get_msgbuf()
        if message.get_header().incompat_flags & _SIGNED_FLAG:
            signing = self.signing_for(source.system, now)
            return Refusal.NO_KEY if signing is None else signing.judge(frame, source)
        if message.get_type() == "RADIO_STATUS":
            return None  # Modems have no keys, and nothing is done by their word
        return Refusal.VERSION_1 if frame[0] == _VERSION_1 else Refusal.UNSIGNED

    def _tell(self, last: Source) -> None:
        new = self.refused - self._told
        self._told = self.refused.copy()
        reasons = ", ".join(f"{count} {refusal.value}" for refusal, count in new.items())
        _LOG.warning("MAVLink frames refused: %s; the last from system %d", reasons, last.system)
