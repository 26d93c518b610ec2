"""SETUP_SIGNING(256): sets or removes a key over a trusted link.

The message carries the secret in the clear, so it is never forwarded, answered or logged. The
configuration names the trusted links; by default there is none.
"""

from enum import Enum

from uav_firmware.bus import Topic
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender, is_for_us
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.link_security import LinkSecurity, is_loopback
from uav_firmware.modules.mavlink.wire.signature import SigningClock
from uav_firmware.modules.mavlink.wire.signing_store import SigningStore
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.status import VehicleStatus


class SetupTrust(Enum):
    """Which links may set the key."""

    NEVER = "never"
    SIGNED = "signed"  # Senders that sign with a key of the vehicle
    LOOPBACK = "loopback"  # These, and programs of this machine


class SigningSetup:
    """Checks and executes SETUP_SIGNING."""

    def __init__(
        self,
        *,
        system_id: int,
        trust: SetupTrust,
        security: LinkSecurity,
        store: SigningStore,
        clock: SigningClock,
        vehicle_status: Topic[VehicleStatus],
        texts: StatusTexts,
    ) -> None:
        self._system_id = system_id
        self._trust = trust
        self._security = security
        self._store = store
        self._clock = clock
        self._vehicle_status = vehicle_status
        self._texts = texts
        self._storing: tuple[bytes, int] | None = None  # Key and time being stored

    def handle(self, message: Message, sender: Sender, _now_us: int) -> list[Outgoing]:
        """Set the key or refuse it; the result is a STATUSTEXT."""
        if not is_for_us(message, self._system_id):
            return []
        key = bytes(message.secret_key)
        refusal = self._refusal(message, sender)
        if refusal is not None:
            return self._refuse(refusal)
        try:
            self._store.save_key(key if any(key) else None)
        except OSError as error:
            return self._refuse(_unstored(error))
        self._storing = (key, message.initial_timestamp)
        return self.tick()

    def tick(self) -> list[Outgoing]:
        """Use a key once it is stored: losing it in a restart would lock its sender out."""
        if self._storing is None:
            return []
        try:
            if not self._store.poll():
                return []
        except OSError as error:
            self._storing = None
            return self._refuse(_unstored(error))
        (key, timestamp), self._storing = self._storing, None
        if (self._store.state.key or bytes(len(key))) != key:
            return self._refuse("it cannot be stored")
        self._security.set_shared_key(key)
        self._security.refresh()
        self._clock.observe(timestamp)
        return self._texts.encode(
            mavlink.MAV_SEVERITY_NOTICE,
            "Signing key set" if any(key) else "Signing key removed",
        )

    def _refuse(self, reason: str) -> list[Outgoing]:
        return self._texts.encode(mavlink.MAV_SEVERITY_WARNING, f"SETUP_SIGNING refused: {reason}")

    def _refusal(self, message: Message, sender: Sender) -> str | None:
        status = self._vehicle_status.value
        if not self._is_trusted(message, sender):
            return "this link may not set keys"
        if status is not None and status.armed:
            return "the vehicle is armed"
        if message.initial_timestamp > self._clock.latest():
            return "its time is ahead of the vehicle's clock"
        return None

    def _is_trusted(self, message: Message, sender: Sender) -> bool:
        if self._trust is SetupTrust.NEVER:
            return False
        if message.get_signed():
            return True
        return self._trust is SetupTrust.LOOPBACK and is_loopback(sender.address)


def _unstored(error: OSError) -> str:
    return f"it cannot be stored: {error.strerror or error}"
