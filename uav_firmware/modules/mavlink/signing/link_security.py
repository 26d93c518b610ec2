"""Whom the vehicle listens to: the keys, and which link must be signed.

| link | MAV_SIGN_CFG 0 | 1 | 2 |
|---|---|---|---|
| a configured peer with a key of its own | open | its key | its key |
| loopback, while a configured peer on it has no key | open | open | any key |
| all others | open | any key | any key |

"Any key" is one that the vehicle holds; while it holds none, every link is open. On an open
link unsigned frames are listened to; a signed one must be genuine, and is answered with the
same key. RADIO_STATUS is listened to unsigned on every link: modems have no keys.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.signing.signature import Refusal, Signer, SigningClock
from uav_firmware.modules.mavlink.signing.signing_params import (
    SIGN_ALWAYS,
    SIGN_BEYOND_LOOPBACK,
    SIGN_NEVER,
)
from uav_firmware.modules.mavlink.wire.dialect import Message, is_signed, is_version_1
from uav_firmware.modules.mavlink.wire.peers import Channel, PeerTable
from uav_firmware.parameters import Registry, UnknownParameterError

_NO_KEY: Final = bytes(32)


class Verdict(NamedTuple):
    """What becomes of a received message."""

    refusal: Refusal | None = None  # None: it is listened to
    signer: Signer | None = None  # The key that the sender is answered with
    genuine: bool = False  # Signed with a key that the vehicle holds


_OPEN: Final = Verdict()


class LinkSecurity:
    """The vehicle's keys and the rules for their use."""

    def __init__(
        self,
        *,
        registry: Registry,
        peers: PeerTable,
        keys: Mapping[Address, bytes],
        shared_key: bytes | None,
        clock: SigningClock,
    ) -> None:
        """Take the keys of configured peers, and the one set by SETUP_SIGNING if there is one.

        Raises:
            ValueError: if a key is none.
        """
        self._registry = registry
        self._registry_version = -1
        self._mode = SIGN_NEVER
        self._loopback_open = False
        self._peers = peers
        self._clock = clock
        self._signers: dict[bytes, Signer] = {}
        self._own = {address: self._signer(key) for address, key in keys.items()}
        self._shared: Signer | None = None
        self._any: Sequence[Signer] = ()
        self.share(shared_key)

    @property
    def has_key(self) -> bool:
        """Whether the vehicle holds any key."""
        return bool(self._any)

    def has_own_key(self, address: Address) -> bool:
        """Whether a link has a key that was configured for it."""
        return address in self._own

    def share(self, key: bytes | None) -> None:
        """Take the key for all links without one of their own; None or zeros takes it away.

        Raises:
            ValueError: if the key is not 32 bytes.
        """
        none = key is None or key == _NO_KEY
        self._shared = None if key is None or none else self._signer(key)
        self._any = list(dict.fromkeys([*self._own.values(), *filter(None, [self._shared])]))
        self._registry_version = -1

    def refresh(self) -> None:
        """Follow the parameter and the keys: which of the configured peers is sent signatures."""
        if self._registry.version == self._registry_version:
            return
        self._registry_version = self._registry.version
        self._mode = self._configured_mode() if self._any else SIGN_NEVER
        self._loopback_open = any(
            is_loopback(channel.address) and channel.address not in self._own
            for channel in self._peers
            if not channel.learnt
        )
        for channel in self._peers:
            if self._must_sign(channel.address):
                channel.signer = channel.signer or self._answering(channel.address)
            elif not channel.learnt:
                channel.signer = None

    def judge(self, message: Message, address: Address, channel: Channel | None) -> Verdict:
        """Whether a message from an address is listened to."""
        if self._mode == SIGN_NEVER:
            return _OPEN
        own = self._own.get(address)
        if is_signed(message):
            return self._judge_signature(message, self._any if own is None else (own,))
        if message.get_type() == "RADIO_STATUS":
            return _OPEN if channel is None else Verdict(signer=channel.signer)
        if not self._must_sign(address):
            return _OPEN
        return Verdict(Refusal.VERSION_1 if is_version_1(message) else Refusal.UNSIGNED)

    def _configured_mode(self) -> int:
        """MAV_SIGN_CFG, or its default in a vehicle that does not declare it."""
        try:
            return int(self._registry.get("MAV_SIGN_CFG"))
        except UnknownParameterError:
            return SIGN_BEYOND_LOOPBACK

    @staticmethod
    def _judge_signature(message: Message, signers: Sequence[Signer]) -> Verdict:
        frame = bytes(message.get_msgbuf())
        system, component = message.get_srcSystem(), message.get_srcComponent()
        for signer in signers:
            refusal = signer.judge(frame, system, component)
            if refusal is None:
                return Verdict(signer=signer, genuine=True)
            if refusal is not Refusal.BAD_SIGNATURE:
                return Verdict(refusal)
        return Verdict(Refusal.BAD_SIGNATURE)

    def _must_sign(self, address: Address) -> bool:
        if self._mode == SIGN_NEVER:
            return False
        if self._mode == SIGN_ALWAYS or address in self._own:
            return True
        return not (self._loopback_open and is_loopback(address))

    def _answering(self, address: Address) -> Signer:
        """The key for a peer that has said nothing yet."""
        return self._own.get(address) or self._shared or self._any[0]

    def _signer(self, key: bytes) -> Signer:
        """One object per key: what was heard on one link is not heard again on another."""
        if key not in self._signers:
            self._signers[key] = Signer(key, self._clock)
        return self._signers[key]


def is_loopback(address: Address) -> bool:
    """Whether a numeric IPv4 address is one that only this machine itself can have sent from."""
    return address[0].startswith("127.")
