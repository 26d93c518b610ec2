"""Admits received messages, discovers peers, counts and reports refused frames."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from uav_firmware.bus import Queue
from uav_firmware.cal.link import Address
from uav_firmware.cal.storage import Storage
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.link_security import LinkSecurity
from uav_firmware.modules.mavlink.wire.peers import Channel, Peer, PeerTable
from uav_firmware.modules.mavlink.wire.signature import Refusal, SigningClock
from uav_firmware.modules.mavlink.wire.signing_setup import SetupTrust
from uav_firmware.modules.mavlink.wire.signing_store import SigningStore
from uav_firmware.msg.link import RefusedFrames
from uav_firmware.msg.status import StatusText
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

_WARNING: Final = mavlink.MAV_SEVERITY_WARNING
REPORT_INTERVAL_US: Final = 30_000_000
"""Shortest interval between two status texts."""
_ADVICE: Final = {
    Refusal.REPLAYED: "signed with an older time than was accepted last: perhaps a clock is wrong",
    Refusal.AHEAD: "check the date of the station, else the vehicle's",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SigningOptions:
    """Configuration of signatures, apart from the keys of configured peers."""

    world_us: Callable[[], int] = lambda: 0  # [us since 1970] UTC
    storage: Storage | None = None  # Stores time and key across restarts
    setup: SetupTrust = SetupTrust.NEVER  # Links that may set a key by SETUP_SIGNING


class Reception:
    """Admits or refuses received messages, and discovers peers."""

    def __init__(
        self,
        options: SigningOptions,
        *,
        registry: Registry,
        configured: Sequence[Peer],
        peers: PeerTable,
        topics: Topics,
    ) -> None:
        """Load the stored state of the signatures.

        Raises:
            SigningStoreError: if it is invalid.
            OSError: if it cannot be read.
            ValueError: if a peer's key is invalid.
        """
        self._peers = peers
        self._topics = topics
        self.store = SigningStore(options.storage)
        state = self.store.load()
        self.clock = SigningClock(options.world_us, used=state.sent_before, observed=state.reached)
        self.security = LinkSecurity(
            registry=registry,
            peers=peers,
            keys={peer.address: peer.signing_key for peer in configured if peer.signing_key},
            shared_key=state.key,
            clock=self.clock,
        )
        self.refused = RefusalCounter()
        self._has_storage_failed = False
        self._store_time(0, wait=True)
        self.security.refresh()

    def admit(self, message: Message, address: Address, now_us: int) -> Channel | None:
        """Return the channel of a message; None when it is refused.

        A HEARTBEAT opens a channel to its sender; other messages of unknown senders are refused.
        """
        channel = self._peers.get(address)
        admission = self.security.check(message, address, channel)
        if admission.refusal is not None:
            self.refused.count(admission.refusal)
            return None
        is_heartbeat = message.get_type() == "HEARTBEAT"
        if channel is None and is_heartbeat:
            channel = self._peers.discover(address, now_us)
        if channel is None:
            return None
        channel.received_us = now_us
        channel.is_active = channel.is_active or not is_heartbeat
        channel.signer = admission.signer
        # pymavlink's flag of a valid signature, which it did not check here
        message._signed = admission.genuine  # noqa: SLF001 - has a reader, get_signed, and no setter
        return channel

    def tick(self) -> None:
        """Apply parameter changes; called at the rate of the commander."""
        self.security.refresh()

    def report(self, now_us: int) -> None:
        """Store the time, publish the counts and warn the operator; called once a second."""
        self._store_time(now_us)
        counts = self.refused.changed_counts(now_us)
        if counts is not None:
            self._topics.refused_frames.publish(counts)
        text = self.refused.status_text(now_us)
        if text is not None:
            self._warn(now_us, text)

    def _store_time(self, now_us: int, *, wait: bool = False) -> None:
        used = max(self.clock.used, self.clock.now())
        try:
            self.store.poll()
            if self.security.has_key and self.store.is_due(used):
                self.store.renew(used)
                self.store.poll(wait=wait)
        except OSError as error:
            if not self._has_storage_failed:
                self._warn(now_us, f"Signing time not stored: {error.strerror or error}")
            self._has_storage_failed = True

    def _warn(self, now_us: int, text: str) -> None:
        texts: Queue[StatusText] = self._topics.status_text
        texts.publish(StatusText(now_us, _WARNING, text))


class RefusalCounter:
    """Counts refused frames by reason."""

    def __init__(self) -> None:
        self._refused = dict.fromkeys(Refusal, 0)
        self._reported = dict.fromkeys(Refusal, 0)
        self._next_report_us = 0
        self._published = RefusedFrames(0)
        self.malformed: int = 0
        self.flood: int = 0

    def count(self, reason: Refusal) -> None:
        """Count one frame."""
        self._refused[reason] += 1

    def changed_counts(self, now_us: int) -> RefusedFrames | None:
        """The counts if they have changed since the last call."""
        counts = RefusedFrames(
            now_us,
            malformed=self.malformed,
            unsigned=self._refused[Refusal.UNSIGNED],
            bad_signature=self._refused[Refusal.BAD_SIGNATURE],
            replayed=self._refused[Refusal.REPLAYED],
            ahead=self._refused[Refusal.AHEAD],
            version_1=self._refused[Refusal.VERSION_1],
            flood=self.flood,
        )
        if counts[1:] == self._published[1:]:
            return None
        self._published = counts
        return counts

    def status_text(self, now_us: int) -> str | None:
        """Warning about newly refused frames, if one is due.

        Malformed bytes and floods are only counted. One station whose clock is an hour ahead shuts
        out all whose clocks are right, until they have caught up, and one whose date is wrong is
        shut out itself: the text names the clock.
        """
        new = {reason: self._refused[reason] - self._reported[reason] for reason in Refusal}
        if now_us < self._next_report_us or not any(new.values()):
            return None
        self._next_report_us = now_us + REPORT_INTERVAL_US
        self._reported = dict(self._refused)
        parts = ", ".join(f"{count} {reason.value}" for reason, count in new.items() if count)
        hints = "".join(f" ({advice})" for reason, advice in _ADVICE.items() if new[reason])
        return f"MAVLink frames refused: {parts}{hints}"
