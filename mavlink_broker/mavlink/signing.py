"""Signing of MAVLink frames: the keys, the check of received frames, the signature of sent ones.

The keys are files, one per MAVLink system, readable by their owner only. Refused frames are
counted.

The rules for timestamps and the computation of signatures are pymavlink's. The order is ours:
pymavlink 2.4.50 stores a frame's timestamp before it checks the signature, so that one forged frame
locks the genuine sender out. Here pymavlink checks the timestamp of genuine frames only.

No timestamp is stored over a restart. A vehicle signs with a timestamp above all that it has
accepted, so its first frame raises the broker's timestamp above all that the broker ever sent to
it; and the broker sends nothing to a vehicle that it has not received.
"""

import hashlib
import hmac
import logging
import os
import re
import stat
from collections import Counter, OrderedDict
from collections.abc import Callable, Collection, Hashable
from datetime import UTC, datetime, timedelta
from enum import Enum
from pathlib import Path
from typing import Any, Final

from mavlink_broker.mavlink.codec import (
    DIGEST_LENGTH,
    SIGNATURE_LENGTH,
    VERSION_1,
    is_signed,
    signed,
)
from mavlink_broker.mavlink.dialect import Message, Source, mavlink, source_of

KEY_LENGTH: Final = 32
RETRY_INTERVAL_S: Final = 5.0
"""Interval at which a missing key file is read again."""
_FILE_NAME: Final = re.compile(r"signing-([1-9][0-9]{0,2})\.key")
_LOG = logging.getLogger(__name__)
EPOCH: Final = datetime(2015, 1, 1, tzinfo=UTC)
TICKS_PER_S: Final = 100_000
CLOCK_SET: Final = datetime(2025, 1, 1, tzinfo=UTC)
"""A computer that shows an earlier time has no clock that is set."""
MAX_LEAD: Final = timedelta(days=365)
"""Largest lead of a timestamp over our clock. A year, because a computer without a battery for its
clock may be months behind a vehicle that has its time from satellites."""
_MAX_LEAD_TICKS: Final = int(MAX_LEAD.total_seconds()) * TICKS_PER_S
LOG_INTERVAL_S: Final = 30.0
"""Interval of log lines."""
CLOCK_ADVICE: Final = "; if a vehicle is not received, this computer's clock may be ahead of it"
DATE_ADVICE: Final = "; check the date of the sender, else of this computer"
STREAMS_KEPT: Final = 256
"""Per key; the one that was received last longest ago is forgotten."""


class KeyRing:
    """Keys by system id, read when first needed; a missing file may appear later."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._keys: dict[int, bytes] = {}
        self._missing: dict[int, float] = {}

    def key_of(self, system: int, now: float) -> bytes | None:
        """Key of a system; None without a valid key file."""
        if system not in self._keys and now >= self._missing.get(system, now):
            key = self._read(system)
            if key is None:
                self._missing[system] = now + RETRY_INTERVAL_S
            else:
                self._keys[system] = key
        return self._keys.get(system)

    def systems(self) -> list[int]:
        """Systems that have a key file in the folder, valid or not."""
        try:
            names = [path.name for path in self.folder.iterdir()]
        except OSError:
            return []
        found = (_FILE_NAME.fullmatch(name) for name in names)
        return sorted(int(match[1]) for match in found if match and int(match[1]) <= 255)

    def _read(self, system: int) -> bytes | None:
        path = self.folder / f"signing-{system}.key"
        try:
            with path.open("rb") as file:
                is_exposed = stat.S_IMODE(os.fstat(file.fileno()).st_mode) & 0o077
                contents = file.read(4 * KEY_LENGTH)
            key = contents if len(contents) == KEY_LENGTH else bytes.fromhex(contents.decode())
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            _LOG.warning("%s cannot be used: %s", path, error)
            return None
        if is_exposed:
            _LOG.warning("%s cannot be used: others may read it; set its mode to 600", path)
            return None
        if len(key) != KEY_LENGTH or not any(key):
            _LOG.warning("%s does not contain a key of %d bytes", path, KEY_LENGTH)
            return None
        return key


class Refusal(Enum):
    """Why a whole, undamaged frame is refused."""

    UNSIGNED = "unsigned"
    BAD_SIGNATURE = "bad signature"
    REPLAYED = "replayed or over a minute old"
    AHEAD = "over a year ahead"
    VERSION_1 = "version 1"
    NO_KEY = "no key for that system"


class LinkSigning:
    """Signs and checks frames with the key of one vehicle."""

    def __init__(self, key: bytes, utc: Callable[[], datetime]) -> None:
        self._verifier = mavlink.MAVLink(None)  # Separate from the timestamp that we sign with
        self._verifier.signing.secret_key = key
        self._newest = 0  # [10 us] Highest timestamp of genuine frames
        self._streams: OrderedDict[tuple[Hashable, Source, int], int] = OrderedDict()
        # [10 us] Highest timestamp by address, sender and the sender's link id
        self._codec = mavlink.MAVLink(None)
        self._codec.signing.secret_key = key
        self._codec.signing.sign_outgoing = True
        self._key = key
        self._utc = utc

    def next_signature(self) -> Any:
        """Signing state of pymavlink for the next frame: the key and an unused timestamp."""
        signing = self._codec.signing
        signing.timestamp = max(signing.timestamp, self._ticks(), self._newest)
        return signing

    def sign(self, frame: bytes) -> bytes:
        """Return a copy of a frame that is signed with this key."""
        signing = self.next_signature()
        copy = signed(frame, self._key, signing.link_id, signing.timestamp)
        signing.timestamp += 1
        return copy

    def check(self, frame: bytearray, source: Source, address: Hashable = None) -> Refusal | None:
        """Why a signed frame is refused; None for a genuine one that was not received before.

        A stream that was received from an address goes on there, although another one with newer
        timestamps has come from elsewhere: a second vehicle with the same id and key must not
        silence the one that flies. Nobody else can send a frame that is newer than its stream's.
        """
        if not self.is_of_this_key(frame):
            return Refusal.BAD_SIGNATURE
        # A new stream is compared with the current time of day and the newest genuine frame: after
        # a clock that was ahead is corrected, genuine frames must still be accepted.
        clock = self._verifier.signing
        clock.timestamp = max(self._ticks(), self._newest)
        timestamp = int.from_bytes(frame[1 - SIGNATURE_LENGTH : -DIGEST_LENGTH], "little")
        # Or one frame with a wrong year would shut out every stream that begins after it
        if self._utc() >= CLOCK_SET and timestamp > clock.timestamp + _MAX_LEAD_TICKS:
            return Refusal.AHEAD
        is_new: bool = self._verifier.check_signature(frame, *source)
        stream = address, source, frame[-SIGNATURE_LENGTH]
        if not is_new and timestamp <= self._streams.get(stream, timestamp):
            return Refusal.REPLAYED
        self._streams[stream] = timestamp
        self._streams.move_to_end(stream)
        if len(self._streams) > STREAMS_KEPT:
            self._streams.popitem(last=False)
        self._newest = max(self._newest, timestamp)
        return None

    def is_of_this_key(self, frame: bytearray) -> bool:
        """Whether a signed frame was signed with this key, at whatever time."""
        digest = hashlib.sha256(self._key + frame[:-DIGEST_LENGTH]).digest()[:DIGEST_LENGTH]
        return hmac.compare_digest(digest, frame[-DIGEST_LENGTH:])

    def _ticks(self) -> int:
        return int((self._utc() - EPOCH).total_seconds() * TICKS_PER_S)


class SignatureCheck:
    """Checks every message; without a key ring every message is accepted."""

    def __init__(
        self, ring: KeyRing | None, unsigned: Collection[int], utc: Callable[[], datetime]
    ) -> None:
        """Require signatures with the keys of a ring, except of systems that cannot sign."""
        self._ring = ring
        self._unsigned = frozenset(unsigned)
        self._utc = utc
        self._signing: dict[int, LinkSigning] = {}
        self._logged: Counter[Refusal] = Counter()
        self._log_at = 0.0
        self.refused: Counter[Refusal] = Counter()

    @property
    def accepts_unsigned(self) -> bool:
        """Whether no signatures are required."""
        return self._ring is None

    def accepts(
        self,
        message: Message,
        now: float,
        *,
        address: Hashable = None,
        is_trusted: bool = False,
    ) -> bool:
        """Whether a message is accepted; refused ones are counted and logged periodically.

        On a trusted link a message may be unsigned; a wrong signature is refused there too.
        """
        refusal = self._refusal_of(message, now, address)
        if is_trusted and refusal in {Refusal.UNSIGNED, Refusal.VERSION_1}:
            return True
        if refusal is None:
            return True
        self.refused[refusal] += 1
        if now >= self._log_at:
            self._log_at = now + LOG_INTERVAL_S
            self._log(source_of(message))
        return False

    def signing_for(self, system: int, now: float) -> LinkSigning | None:
        """Signing of frames to a system; None if they are not signed."""
        if self._ring is None or system in self._unsigned:
            return None
        if system not in self._signing:
            key = self._ring.key_of(system, now)
            if key is None:
                return None
            self._signing[system] = LinkSigning(key, self._utc)
        return self._signing[system]

    def signings_for_contact(
        self, is_received: Callable[[int], bool], now: float
    ) -> list[LinkSigning | None]:
        """Signings of first heartbeats: one with the key of each system that is not received."""
        if self._ring is None:
            return [None]
        keyed = [system for system in self._ring.systems() if not is_received(system)]
        by_key = [self.signing_for(system, now) for system in keyed]
        unsigned = [None] if self._unsigned else []
        return [*unsigned, *(signing for signing in by_key if signing is not None)]

    def _refusal_of(self, message: Message, now: float, address: Hashable) -> Refusal | None:
        source = source_of(message)
        if self._ring is None or source.system in self._unsigned:
            return None
        frame = message.get_msgbuf()
        if is_signed(frame):
            signing = self.signing_for(source.system, now)
            return Refusal.NO_KEY if signing is None else signing.check(frame, source, address)
        if message.get_type() == "RADIO_STATUS":
            return None  # Radios have no keys, and their reports only limit a rate
        return Refusal.VERSION_1 if frame[0] == VERSION_1 else Refusal.UNSIGNED

    def _log(self, last: Source) -> None:
        new = self.refused - self._logged
        self._logged = self.refused.copy()
        reasons = ", ".join(f"{count} {refusal.value}" for refusal, count in new.items())
        advice = CLOCK_ADVICE if Refusal.REPLAYED in new else ""
        advice += DATE_ADVICE if Refusal.AHEAD in new else ""
        _LOG.warning(
            "MAVLink frames refused: %s; the last from system %d%s", reasons, last.system, advice
        )
