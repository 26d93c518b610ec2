"""Peers of the vehicle: configured ones permanently, discovered ones until they time out.

A configured peer (the broker, the ground station) gets heartbeats and streams from the start. Any
other address is discovered by its HEARTBEAT and gets the rates of a ground station. Its timeout
is as long as it has been known, 10 s to 60 s, so that one datagram with a forged sender does not
direct telemetry at a third party for long.

`channel_to_replace` decides which channel is closed when there is no room for a new peer.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.schedule import LONGEST_INTERVAL_US, Schedule
from uav_firmware.modules.mavlink.wire.signature import Signer

RECENTLY_US: Final = 5_000_000
"""Largest age of the last message of an active peer, which allows for lost heartbeats."""
MAX_DISCOVERED_PEERS: Final = 8
TIMEOUT_MIN_US: Final = 10_000_000
TIMEOUT_MAX_US: Final = 60_000_000
"""Bounds of the timeout of a discovered peer."""
MAX_CANDIDATES: Final = 4096
"""Addresses without room that are stored, for one to two seconds."""
_CANDIDATES_PERIOD_US: Final = 1_000_000
UNREACHABLE_US: Final = 2_500_000
"""Time for which an unreachable peer gets HEARTBEAT only: until two of them were not refused."""


class Profile(Enum):
    """Set of default rates of a peer."""

    GROUND_STATION = "ground station"
    ONBOARD = "onboard"


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A configured peer."""

    address: Address
    profile: Profile
    signing_key: bytes | None = None  # Key of this link alone


class Channel:
    """State of the link to one peer: sequence counters, schedule, signer."""

    __slots__ = (
        "_sequences",
        "address",
        "discovered",
        "is_active",
        "link_id",
        "opened_us",
        "profile",
        "received_us",
        "schedule",
        "signer",
        "unreachable_us",
    )

    def __init__(
        self, peer: Peer, schedule: Schedule, *, link_id: int, discovered: bool, now_us: int
    ) -> None:
        self.address = peer.address
        self.profile = peer.profile
        self.schedule = schedule
        self.link_id = link_id
        self.discovered = discovered
        self.opened_us = now_us
        self.received_us = now_us
        self.is_active = False  # Has sent more than HEARTBEAT
        self.unreachable_us = -UNREACHABLE_US  # Last time that a datagram was refused
        self.signer: Signer | None = None  # None: frames are sent unsigned
        self._sequences: dict[int, int] = {}  # By component

    @property
    def timeout_us(self) -> int:
        """Time without a message after which this peer is closed."""
        known_for_us = self.received_us - self.opened_us
        return min(max(known_for_us, TIMEOUT_MIN_US), TIMEOUT_MAX_US)

    def is_unreachable(self, now_us: int) -> bool:
        """Whether datagrams to its address have been refused recently."""
        return (
            self.unreachable_us > self.received_us and now_us - self.unreachable_us < UNREACHABLE_US
        )

    def next_sequence(self, component: int) -> int:
        """Sequence number of a component's next frame to this peer, modulo 256."""
        sequence = self._sequences.get(component, 0)
        self._sequences[component] = (sequence + 1) & 0xFF
        return sequence


class PeerTable:
    """All channels by address."""

    def __init__(
        self, peers: Sequence[Peer], intervals_us: Mapping[Profile, Mapping[int, int]]
    ) -> None:
        """Open a channel to each configured peer; `intervals_us` are the default intervals."""
        self._intervals_us = intervals_us
        self._links = 0
        self._candidates: set[Address] = set()
        self._earlier_candidates: set[Address] = set()
        self._candidates_us = 0
        self._displaced: list[Address] = []
        self._channels = {
            peer.address: self._channel(peer, discovered=False, now_us=0) for peer in peers
        }

    def __iter__(self) -> Iterator[Channel]:
        return iter(self._channels.values())

    def __len__(self) -> int:
        return len(self._channels)

    def get(self, address: Address) -> Channel | None:
        """Channel to an address; None for an unknown peer."""
        return self._channels.get(address)

    def only(self, address: Address) -> tuple[Channel, ...]:
        """The channel to one address, or none."""
        channel = self._channels.get(address)
        return () if channel is None else (channel,)

    def discover(self, address: Address, now_us: int) -> Channel | None:
        """Open a channel to a new peer that has sent a HEARTBEAT; None without room."""
        discovered = [channel for channel in self if channel.discovered]
        if len(discovered) >= MAX_DISCOVERED_PEERS:
            replaced = (
                channel_to_replace(discovered, now_us)
                if self._is_repeated(address, now_us)
                else None
            )
            if replaced is None:
                return None
            del self._channels[replaced.address]
            self._displaced.append(replaced.address)
        peer = Peer(address=address, profile=Profile.GROUND_STATION)
        channel = self._channel(peer, discovered=True, now_us=now_us)
        self._channels[address] = channel
        return channel

    def _is_repeated(self, address: Address, now_us: int) -> bool:
        """Whether an address without room has also sent a HEARTBEAT in the previous period.

        Forged addresses usually occur once. The memory is bounded; during a larger flood, a real
        peer is stored at one of its next heartbeats.
        """
        elapsed_us = now_us - self._candidates_us
        if elapsed_us >= _CANDIDATES_PERIOD_US:
            self._earlier_candidates = (
                self._candidates if elapsed_us < 3 * _CANDIDATES_PERIOD_US else set()
            )
            self._candidates = set()
            self._candidates_us = now_us
        if len(self._candidates) < MAX_CANDIDATES:
            self._candidates.add(address)
        return address in self._earlier_candidates

    def is_any_due(self, now_us: int) -> bool:
        """Whether a stream to any peer is due; called in every control step."""
        for channel in self._channels.values():  # noqa: SIM110 - a generator costs twice as much
            if channel.schedule.next_due_us <= now_us:
                return True
        return False

    def shortest_interval_us(self, now_us: int) -> int:
        """Shortest interval [us] of a stream to an active peer; one second without one."""
        return min(
            (
                channel.schedule.shortest_interval_us
                for channel in self
                if now_us - channel.received_us < RECENTLY_US
            ),
            default=LONGEST_INTERVAL_US,
        )

    def note_unreachable(self, addresses: Iterable[Address], now_us: int) -> None:
        """Mark the channels to addresses that refuse datagrams."""
        for address in addresses:
            channel = self._channels.get(address)
            if channel is not None:
                channel.unreachable_us = now_us

    def close_timed_out(self, now_us: int) -> list[Address]:
        """Close the channels to discovered peers that have timed out.

        Returns their addresses, and those of channels replaced since the last call.
        """
        timed_out = [
            address
            for address, channel in self._channels.items()
            if channel.discovered and now_us - channel.received_us > channel.timeout_us
        ]
        for address in timed_out:
            del self._channels[address]
        gone, self._displaced = timed_out + self._displaced, []
        return gone

    def _channel(self, peer: Peer, *, discovered: bool, now_us: int) -> Channel:
        schedule = Schedule(self._intervals_us[peer.profile])
        link_id = self._links & 0xFF
        self._links += 1
        return Channel(peer, schedule, link_id=link_id, discovered=discovered, now_us=now_us)


def channel_to_replace(discovered: Sequence[Channel], now_us: int) -> Channel | None:
    """Discovered channel to close for a new peer that repeats its HEARTBEAT, or None.

    First a peer without messages for over 5 s, then one that has sent only HEARTBEATs; of several,
    the one known for the shortest time. Any other peer is kept.
    """
    timed_out = [c for c in discovered if now_us - c.received_us > TIMEOUT_MIN_US // 2]
    inactive = [c for c in discovered if not c.is_active]
    return min(timed_out or inactive, key=lambda c: c.received_us - c.opened_us, default=None)
