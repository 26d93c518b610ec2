"""Stores the time of signatures and the key of SETUP_SIGNING across restarts.

The stored time is ahead of the one in use, and advances before that reaches it. A run that starts
above it uses no time twice, even after a crash. The stored time less its lead is a time that the
previous run has reached.
"""

import json
from dataclasses import dataclass
from typing import Final

from uav_firmware.cal.storage import WRITTEN, Storage, Write
from uav_firmware.modules.mavlink.wire.signature import KEY_LENGTH, LATEST, TICK_US

FILE_NAME: Final = "signing.json"
AHEAD: Final = 120_000_000 // TICK_US
"""Lead of the stored time over the one in use [ticks]: two minutes."""
RENEW_WITHIN: Final = AHEAD // 2
"""The stored time advances below this lead [ticks]: once a minute, as MAVLink requires."""


class SigningStoreError(ValueError):
    """The stored state is invalid."""


@dataclass(frozen=True, slots=True)
class SigningState:
    """The stored state."""

    sent_before: int = 0  # [10 us since 2015] All frames were sent before this
    key: bytes | None = None  # Set by SETUP_SIGNING

    @property
    def reached(self) -> int:
        """A time that has been reached [ticks]."""
        return max(self.sent_before - AHEAD, 0)


class SigningStore:
    """Loads and saves the state of the signatures."""

    def __init__(self, storage: Storage | None) -> None:
        """Use a storage; without one nothing is stored."""
        self._storage = storage
        self._write: Write = WRITTEN
        self._writing = SigningState()
        self.state = SigningState()
        """The state known to be stored."""

    def load(self) -> SigningState:
        """Load the state of an earlier run.

        Raises:
            SigningStoreError: if it is invalid.
            OSError: if it exists and cannot be read.
        """
        contents = None if self._storage is None else self._storage.load(FILE_NAME)
        if contents is not None:
            self.state = self._writing = _read(contents)
        return self.state

    def is_due(self, used: int) -> bool:
        """Whether the stored time must advance; `used` [ticks] is the time in use."""
        return self._writing.sent_before - used < RENEW_WITHIN

    def renew(self, used: int) -> None:
        """Start to store a time ahead of the one in use [ticks].

        Raises:
            OSError: if the write cannot start.
        """
        self._save(SigningState(used + AHEAD, self._writing.key))

    def save_key(self, key: bytes | None) -> None:
        """Start to store a key, or its removal.

        Raises:
            OSError: if the write cannot start; the previous key stays.
        """
        self._save(SigningState(self._writing.sent_before, key))

    def poll(self, *, wait: bool = False) -> bool:
        """Complete a finished write; return whether no write is in progress.

        Args:
            wait: Block until it has finished; at the start only.

        Raises:
            OSError: if the write has failed; the previous state stays.
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
            self.poll()


def _read(contents: bytes) -> SigningState:
    try:
        document = json.loads(contents)
        sent_before, text = document["sent_before"], document["key"]
        key = None if text is None else bytes.fromhex(text)
    except (ValueError, TypeError, KeyError) as error:
        raise SigningStoreError(f"{FILE_NAME} is invalid: {error}") from None
    if type(sent_before) is not int or not 0 <= sent_before <= LATEST + AHEAD:
        raise SigningStoreError(f"{FILE_NAME}: sent_before is {sent_before!r}")
    if key is not None and (len(key) != KEY_LENGTH or not any(key)):
        raise SigningStoreError(f"{FILE_NAME}: the key is not {KEY_LENGTH} bytes")
    return SigningState(sent_before, key)
