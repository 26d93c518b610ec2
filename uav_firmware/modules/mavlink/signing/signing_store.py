"""What of the signatures must survive a restart: the time, and the key that was set over a link.

The stored time lies ahead of the one in use, and is moved before that reaches it. A run that
begins above it can use no time twice, however the one before has ended; and what the stored
time lay ahead of, the run before has certainly reached.
"""

import json
from dataclasses import dataclass
from typing import Final

from uav_firmware.cal.storage import WRITTEN, Storage, Write
from uav_firmware.modules.mavlink.signing.signature import KEY_LENGTH, LATEST, TICK_US

FILE_NAME: Final = "signing.json"
AHEAD: Final = 120_000_000 // TICK_US
"""How far the stored time lies ahead of the one in use [ticks]: two minutes."""
RENEW_WITHIN: Final = AHEAD // 2
"""It is moved when less than this is left [ticks]: once a minute, as MAVLink asks."""


class SigningStoreError(ValueError):
    """What is stored cannot be understood."""


@dataclass(frozen=True, slots=True)
class SigningState:
    """What is kept."""

    sent_before: int = 0  # [10 us since 2015] No frame was sent at or after this time
    key: bytes | None = None  # Set by SETUP_SIGNING

    @property
    def reached(self) -> int:
        """A time that has certainly been in use [ticks]."""
        return max(self.sent_before - AHEAD, 0)


class SigningStore:
    """The state of the signatures in the vehicle's storage."""

    def __init__(self, storage: Storage | None) -> None:
        """Use a storage; without one nothing is kept."""
        self._storage = storage
        self._write: Write = WRITTEN
        self._writing = SigningState()
        self.state = SigningState()
        """What the medium has for certain."""

    def load(self) -> SigningState:
        """Read what an earlier run has left.

        Raises:
            SigningStoreError: if it cannot be understood.
            OSError: if it is there and cannot be read.
        """
        contents = None if self._storage is None else self._storage.load(FILE_NAME)
        if contents is not None:
            self.state = self._writing = _read(contents)
        return self.state

    def is_due(self, used: int) -> bool:
        """Whether the stored time must be moved, `used` [ticks] being in use."""
        return self._writing.sent_before - used < RENEW_WITHIN

    def renew(self, used: int) -> None:
        """Begin to move the stored time ahead of the one in use [ticks].

        Raises:
            OSError: if the medium refuses at once.
        """
        self._save(SigningState(used + AHEAD, self._writing.key))

    def keep_key(self, key: bytes | None) -> None:
        """Begin to keep a key, or none.

        Raises:
            OSError: if the medium refuses at once; the former key stays.
        """
        self._save(SigningState(self._writing.sent_before, key))

    def settle(self, *, wait: bool = False) -> bool:
        """Take the outcome of what is being written; whether nothing is.

        Args:
            wait: Wait for it: at the start, never in the control loop.

        Raises:
            OSError: if the medium has refused it; what was stored before stays.
        """
        if not (wait or self._write.done()):
            return False
        write, self._write = self._write, WRITTEN
        try:
            write.result()
        except OSError:
            self._writing = self.state
            raise
        self.state = self._writing
        return True

    def _save(self, state: SigningState) -> None:
        if self._storage is not None:
            key = None if state.key is None else state.key.hex()
            document = {"sent_before": state.sent_before, "key": key}
            self._write = self._storage.save(FILE_NAME, json.dumps(document).encode())
        self._writing = state
        if self._write.done():
            self.settle()


def _read(contents: bytes) -> SigningState:
    try:
        document = json.loads(contents)
        sent_before, text = document["sent_before"], document["key"]
        key = None if text is None else bytes.fromhex(text)
    except (ValueError, TypeError, KeyError) as error:
        raise SigningStoreError(f"{FILE_NAME} cannot be understood: {error}") from None
    if type(sent_before) is not int or not 0 <= sent_before <= LATEST + AHEAD:
        raise SigningStoreError(f"{FILE_NAME}: sent_before is {sent_before!r}")
    if key is not None and (len(key) != KEY_LENGTH or not any(key)):
        raise SigningStoreError(f"{FILE_NAME}: the key is not {KEY_LENGTH} bytes")
    return SigningState(sent_before, key)
