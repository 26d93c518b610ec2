"""Loads a signing key into one vehicle, or removes it, by SETUP_SIGNING(256).

A vehicle without a key takes its first one unsigned (PX4 from 1.18, ArduPilot); the next one must
be signed with the present key. Neither answers the message: the vehicle has the key when it signs
with it. Both refuse while armed. The message carries the key in the clear, is sent at least twice,
and never while it is unknown whether the vehicle is armed (mavlink.io, "Message Signing").
"""

from collections.abc import Callable
from datetime import datetime
from enum import Enum
from typing import Any, Final

from mavlink_broker.autopilots.status_texts import StatusTexts
from mavlink_broker.mavlink.codec import Encoder, is_signed
from mavlink_broker.mavlink.dialect import ONBOARD_COMPUTER, Message, mavlink, source_of
from mavlink_broker.mavlink.signing import EPOCH, KEY_LENGTH, TICKS_PER_S, LinkSigning
from mavlink_broker.microservices.link_state import own_heartbeat

HEARTBEAT_TIMEOUT_S: Final = 10.0
CONFIRMATION_TIMEOUT_S: Final = 8.0
INTERVAL_S: Final = 1.0
"""Of heartbeats, and of SETUP_SIGNING until the vehicle signs."""
_SENT_AT_LEAST: Final = 2


class Outcome(Enum):
    """How the loading of a key ended."""

    DONE = "done"
    ALREADY = "the vehicle has this key already"
    SILENT = "no heartbeat of the vehicle was received"
    ARMED = "the vehicle is armed"
    OTHER_KEY = "the vehicle signs with a key that is not known here"
    VERSION_1 = (
        "the vehicle sends MAVLink 1, which has no signatures; set its protocol to MAVLink 2"
    )
    UNCONFIRMED = "the vehicle does not sign with the new key"
    NOT_REMOVED = "the vehicle still signs"


class SigningSetup:
    """Sets the key of one vehicle; `outcome` is None until it has ended."""

    def __init__(
        self,
        system: int,
        key: bytes | None,
        *,
        current_key: bytes | None,
        own_system: int,
        utc: Callable[[], datetime],
    ) -> None:
        """Set `key`, None removes the present one; `current_key` is what the vehicle may have."""
        self._system = system
        self._key = key
        self._utc = utc
        self._new = None if key is None else LinkSigning(key, utc)
        self._current = None if current_key is None else LinkSigning(current_key, utc)
        self._signs_with_current = False
        self._encoder = Encoder(own_system, ONBOARD_COMPUTER)
        self._texts = StatusTexts()
        self._sends_version_1 = False
        self._began: float | None = None
        self._found: float | None = None
        self._next = 0.0
        self._sent = 0
        self.outcome: Outcome | None = None

    @property
    def found(self) -> bool:
        """Whether a heartbeat of the vehicle was received."""
        return self._found is not None

    def texts(self) -> list[str]:
        """What the vehicle has reported as STATUSTEXT since it was found."""
        return self._texts.since(0.0)

    def receive(self, message: Message, now: float) -> None:
        """Handle a message of any sender."""
        source = source_of(message)
        autopilot = mavlink.MAV_COMP_ID_AUTOPILOT1
        if self.outcome or source.system != self._system or source.component != autopilot:
            return
        self._texts.receive(message, now)
        if message.get_type() == "HEARTBEAT" and self._found is None:
            self._find(message, now)
        elif self._sent:
            self._confirm(message)

    def step(self, now: float) -> list[bytes]:
        """Give the frames that are due."""
        if self._began is None:
            self._began = now
        if self.outcome is not None or now < self._next:
            return []
        self._next = now + INTERVAL_S
        if self._found is None:
            if now - self._began > HEARTBEAT_TIMEOUT_S:
                self.outcome = Outcome.VERSION_1 if self._sends_version_1 else Outcome.SILENT
                return []
            return [self._heartbeat(None)]
        if now - self._found > CONFIRMATION_TIMEOUT_S:
            self.outcome = Outcome.UNCONFIRMED if self._key else Outcome.NOT_REMOVED
            return []
        self._sent += 1
        present = self._current if self._signs_with_current else None
        setup = self._encoder.encode(self._message(), self._signature(present))
        return [setup, self._heartbeat(self._new)]

    def _find(self, heartbeat: Message, now: float) -> None:
        if heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED:
            self.outcome = Outcome.ARMED
            return
        if heartbeat.get_msgbuf()[0] != mavlink.PROTOCOL_MARKER_V2:
            self._sends_version_1 = True  # Many change to 2 after our first heartbeat
            return
        signs = is_signed(heartbeat.get_msgbuf())
        if signs:
            if _is_genuine(self._new, heartbeat):
                self.outcome = Outcome.ALREADY
                return
            if not _is_genuine(self._current, heartbeat):
                self.outcome = Outcome.OTHER_KEY
                return
        # Some sign only to who has signed; without a key they do not mind a signature.
        self._signs_with_current = signs or self._key is None
        self._found = now
        self._next = now

    def _confirm(self, message: Message) -> None:
        signs = is_signed(message.get_msgbuf())
        if self._key is None:
            is_late = self._sent >= _SENT_AT_LEAST
            if is_late and message.get_type() == "HEARTBEAT" and not signs:
                self.outcome = Outcome.DONE
        elif signs and _is_genuine(self._new, message):
            self.outcome = Outcome.DONE

    def _message(self) -> Message:
        """SETUP_SIGNING with the time of day; all zero to remove the key."""
        ticks = int((self._utc() - EPOCH).total_seconds() * TICKS_PER_S) if self._key else 0
        return mavlink.MAVLink_setup_signing_message(
            self._system,
            mavlink.MAV_COMP_ID_AUTOPILOT1,
            list(self._key or bytes(KEY_LENGTH)),
            ticks,
        )

    def _heartbeat(self, signing: LinkSigning | None) -> bytes:
        return self._encoder.encode(own_heartbeat(), self._signature(signing))

    @staticmethod
    def _signature(signing: LinkSigning | None) -> Any:
        return None if signing is None else signing.next_signature()


def _is_genuine(signing: LinkSigning | None, message: Message) -> bool:
    """Whether a signed message was signed with a key, at whatever time of day."""
    return signing is not None and signing.is_of_this_key(message.get_msgbuf())
