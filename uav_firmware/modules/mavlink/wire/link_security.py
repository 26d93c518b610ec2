"""Admission of messages by signature: keys, and which link must be signed.

| link | MAV_SIGN_CFG 0 | 1 | 2 |
|---|---|---|---|
| a configured peer with a key of its own | open | its key | its key |
| loopback, while a configured peer on it has no key | open | open | any key |
| all others | open | any key | any key |

"Any key" is a key of the vehicle; without one, every link is open. On an open link unsigned
frames are admitted; a signed one must be genuine, and is answered with the same key.
RADIO_STATUS is admitted unsigned on every link, because modems have no keys.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.dialect import Message, is_signed, is_version_1
from uav_firmware.modules.mavlink.wire.peers import Channel, PeerTable
from uav_firmware.modules.mavlink.wire.signature import Refusal, Signer, SigningClock
from uav_firmware.parameters import Registry, UnknownParameterError, param

SIGN_NEVER = 0
SIGN_BEYOND_LOOPBACK = 1
SIGN_ALWAYS = 2
_NO_KEY: Final = bytes(32)


@dataclass(frozen=True, slots=True, kw_only=True)
class SigningParams:
    """Which links must be signed; name and values are PX4 1.17's.

    The loopback interface corresponds to PX4's USB link: its senders run on the same machine. PX4's
    default is 0; without a key the value has no effect here.
    """

    sign_cfg: int = param(
        "MAV_SIGN_CFG",
        SIGN_BEYOND_LOOPBACK,
        unit="1",
        minimum=SIGN_NEVER,
        maximum=SIGN_ALWAYS,
        short="Links that must be signed if the vehicle has a key",
        values={
            0: "none",
            1: "all but loopback while a configured peer there has no key",
            2: "all",
        },
    )


class Admission(NamedTuple):
    """Result of the check of a received message."""

    refusal: Refusal | None = None  # None: the message is admitted
    signer: Signer | None = None  # Signs the frames to the sender
    genuine: bool = False  # Signed with a key of the vehicle


_OPEN: Final = Admission()


class LinkSecurity:
    """The keys of the vehicle and the rules for their use."""

    def __init__(
        self,
        *,
        registry: Registry,
        peers: PeerTable,
        keys: Mapping[Address, bytes],
        shared_key: bytes | None,
        clock: SigningClock,
    ) -> None:
        """Use the keys of configured peers, and the one set by SETUP_SIGNING if there is one.

        Raises:
            ValueError: if a key is invalid.
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
        self.set_shared_key(shared_key)

    @property
    def has_key(self) -> bool:
        """Whether the vehicle has any key."""
        return bool(self._any)

    def set_shared_key(self, key: bytes | None) -> None:
        """Set the key of all links without their own; None or zeros remove it.

        Raises:
            ValueError: if the key is not 32 bytes.
        """
        none = key is None or key == _NO_KEY
        self._shared = None if key is None or none else self._signer(key)
        self._any = list(dict.fromkeys([*self._own.values(), *filter(None, [self._shared])]))
        self._registry_version = -1

    def refresh(self) -> None:
        """Apply MAV_SIGN_CFG and the keys to the channels."""
        if self._registry.version == self._registry_version:
            return
        self._registry_version = self._registry.version
        self._mode = self._configured_mode() if self._any else SIGN_NEVER
        self._loopback_open = any(
            is_loopback(channel.address) and channel.address not in self._own
            for channel in self._peers
            if not channel.discovered
        )
        for channel in self._peers:
            if self._must_sign(channel.address):
                channel.signer = channel.signer or self._default_signer(channel.address)
            elif not channel.discovered:
                channel.signer = None

    def check(self, message: Message, address: Address, channel: Channel | None) -> Admission:
        """Check whether a message from an address is admitted."""
        if self._mode == SIGN_NEVER:
            return _OPEN
        own = self._own.get(address)
        if is_signed(message):
            return self._verify_signature(message, self._any if own is None else (own,))
        if message.get_type() == "RADIO_STATUS":
            return _OPEN if channel is None else Admission(signer=channel.signer)
        if not self._must_sign(address):
            return _OPEN
        return Admission(Refusal.VERSION_1 if is_version_1(message) else Refusal.UNSIGNED)

    def _configured_mode(self) -> int:
        """MAV_SIGN_CFG, or its default if it is not declared."""
        try:
            return int(self._registry.get("MAV_SIGN_CFG"))
        except UnknownParameterError:
            return SIGN_BEYOND_LOOPBACK

    @staticmethod
    def _verify_signature(message: Message, signers: Sequence[Signer]) -> Admission:
        frame = bytes(message.get_msgbuf())
        system, component = message.get_srcSystem(), message.get_srcComponent()
        for signer in signers:
            refusal = signer.verify(frame, system, component)
            if refusal is None:
                return Admission(signer=signer, genuine=True)
            if refusal is not Refusal.BAD_SIGNATURE:
                return Admission(refusal)
        return Admission(Refusal.BAD_SIGNATURE)

    def _must_sign(self, address: Address) -> bool:
        if self._mode == SIGN_NEVER:
            return False
        if self._mode == SIGN_ALWAYS or address in self._own:
            return True
        return not (self._loopback_open and is_loopback(address))

    def _default_signer(self, address: Address) -> Signer:
        """Key for a peer that has sent no message yet."""
        return self._own.get(address) or self._shared or self._any[0]

    def _signer(self, key: bytes) -> Signer:
        """One signer per key, so that a frame of one link is a replay on another."""
        if key not in self._signers:
            self._signers[key] = Signer(key, self._clock)
        return self._signers[key]


def is_loopback(address: Address) -> bool:
    """Whether a numeric IPv4 address belongs to the loopback interface."""
    return address[0].startswith("127.")
