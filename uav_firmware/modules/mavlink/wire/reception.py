"""The door: which messages are listened to, from whom, and what is told of the others."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from uav_firmware.bus import Queue
from uav_firmware.cal.link import Address
from uav_firmware.cal.storage import Storage
from uav_firmware.modules.mavlink.signing.link_security import LinkSecurity
from uav_firmware.modules.mavlink.signing.signature import SigningClock
from uav_firmware.modules.mavlink.signing.signing_setup import SetupTrust
from uav_firmware.modules.mavlink.signing.signing_store import SigningStore
from uav_firmware.modules.mavlink.topics import MavlinkTopics
from uav_firmware.modules.mavlink.wire.dialect import Message, mavlink
from uav_firmware.modules.mavlink.wire.peers import Channel, Peer, PeerTable
from uav_firmware.modules.mavlink.wire.refused_frames import RefusalCounter
from uav_firmware.msg.status import StatusText
from uav_firmware.parameters import Registry

_WARNING: Final = mavlink.MAV_SEVERITY_WARNING


@dataclass(frozen=True, slots=True, kw_only=True)
class SigningOptions:
    """What signatures need from outside; the links' own keys come with the peers."""

    world_us: Callable[[], int] = lambda: 0  # [us since 1970] The clock of the world
    storage: Storage | None = None  # Keeps time and key over a restart
    setup: SetupTrust = SetupTrust.NEVER  # Who may set a key by SETUP_SIGNING


class Reception:
    """Judges what arrives, makes strangers known, counts and tells what it refuses."""

    def __init__(
        self,
        options: SigningOptions,
        *,
        registry: Registry,
        configured: Sequence[Peer],
        peers: PeerTable,
        topics: MavlinkTopics,
    ) -> None:
        """Read what an earlier run has left.

        Raises:
            SigningStoreError: if that cannot be understood.
            OSError: if it cannot be read.
            ValueError: if a peer's key is none.
        """
        self._peers = peers
        self._topics = topics
        self.store = SigningStore(options.storage)
        state = self.store.load()
        self.clock = SigningClock(options.world_us, used=state.sent_before, heard=state.reached)
        self.security = LinkSecurity(
            registry=registry,
            peers=peers,
            keys={peer.address: peer.signing_key for peer in configured if peer.signing_key},
            shared_key=state.key,
            clock=self.clock,
        )
        self.refused = RefusalCounter()
        self._is_medium_bad = False
        self._keep_time(0, wait=True)
        self.security.refresh()

    def admit(self, message: Message, address: Address, now_us: int) -> Channel | None:
        """The channel that a message came in by; None when it is not to be listened to.

        A HEARTBEAT makes its sender known; else a stranger is not listened to.
        """
        channel = self._peers.get(address)
        verdict = self.security.judge(message, address, channel)
        if verdict.refusal is not None:
            self.refused.count(verdict.refusal)
            return None
        is_heartbeat = message.get_type() == "HEARTBEAT"
        if channel is None and is_heartbeat:
            channel = self._peers.learn(address, now_us)
        if channel is None:
            return None
        channel.heard_us = now_us
        channel.spoken = channel.spoken or not is_heartbeat
        channel.signer = verdict.signer
        # pymavlink's flag for a signature that was found right, which it did not look at here
        message._signed = verdict.genuine  # noqa: SLF001 - has a reader, get_signed, and no setter
        return channel

    def tick(self) -> None:
        """Follow the parameters; asked at the rate of the commander."""
        self.security.refresh()

    def tell(self, now_us: int) -> None:
        """Once a second: keep the time, publish the counts, tell the user."""
        self._keep_time(now_us)
        counts = self.refused.news(now_us)
        if counts is not None:
            self._topics.refused_frames.publish(counts)
        sentence = self.refused.sentence(now_us)
        if sentence is not None:
            self._warn(now_us, sentence)

    def _keep_time(self, now_us: int, *, wait: bool = False) -> None:
        used = max(self.clock.used, self.clock.now())
        try:
            self.store.settle()
            if self.security.has_key and self.store.is_due(used):
                self.store.renew(used)
                self.store.settle(wait=wait)
        except OSError as error:
            if not self._is_medium_bad:
                self._warn(now_us, f"Signing time not stored: {error.strerror or error}")
            self._is_medium_bad = True

    def _warn(self, now_us: int, text: str) -> None:
        texts: Queue[StatusText] = self._topics.status_text
        texts.publish(StatusText(now_us, _WARNING, text))
