"""The peers of the vehicle: configured ones for ever, others while they are heard.

A configured peer (the broker, the ground station) is sent heartbeats and streams from the
start. Any other address is learnt from its HEARTBEAT and gets the ground station's rates. It
may then be silent for as long as it has been heard, 10 s at least and a minute at most, so that
one datagram with a forged sender does not make the vehicle pour telemetry on a third party.

Who keeps a place when all are taken is settled in `place_for`; see the README's "Peers".
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.signing.signature import Signer
from uav_firmware.modules.mavlink.telemetry.schedule import LONGEST_INTERVAL_US, Schedule

HEARD_LATELY_US: Final = 5_000_000
"""Age of the last message of a peer that is thought to listen, some heartbeats being lost."""
MAX_LEARNT_PEERS: Final = 8
SHORTEST_SILENCE_US: Final = 10_000_000
LONGEST_SILENCE_US: Final = 60_000_000
"""How long a learnt peer may be silent: as long as it has been heard, within these bounds."""
MAX_CALLERS: Final = 4096
"""Addresses remembered for a second or two, of those for which there is no place."""
_CALLERS_PERIOD_US: Final = 1_000_000
REFUSED_FOR_US: Final = 2_500_000
"""How long a peer at whose address nobody listens is sent nothing but HEARTBEAT: until two of
these have not been turned away."""


class Profile(Enum):
    """Which default rates a peer gets."""

    GROUND_STATION = "ground station"
    ONBOARD = "onboard"


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A peer that the configuration names."""

    address: Address
    profile: Profile
    signing_key: bytes | None = None  # Of this link alone; None: the link has none


class Channel:
    """The state of the link to one peer: its sequence counter, its schedule, its signatures."""

    __slots__ = (
        "_sequences",
        "address",
        "heard_us",
        "known_us",
        "learnt",
        "link_id",
        "profile",
        "refused_us",
        "schedule",
        "signer",
        "spoken",
    )

    def __init__(
        self, peer: Peer, schedule: Schedule, *, link_id: int, learnt: bool, now_us: int
    ) -> None:
        self.address = peer.address
        self.profile = peer.profile
        self.schedule = schedule
        self.link_id = link_id
        self.learnt = learnt
        self.known_us = now_us
        self.heard_us = now_us
        self.spoken = False  # Has said more than HEARTBEAT
        self.refused_us = -REFUSED_FOR_US  # When nobody listened there last
        self.signer: Signer | None = None  # Signs what is sent; None: sent unsigned
        self._sequences: dict[int, int] = {}  # By component

    @property
    def patience_us(self) -> int:
        """How long this peer may be silent before it is forgotten."""
        acquaintance_us = self.heard_us - self.known_us
        return min(max(acquaintance_us, SHORTEST_SILENCE_US), LONGEST_SILENCE_US)

    def is_deaf(self, now_us: int) -> bool:
        """Whether nobody listens at its address, as far as is known."""
        return self.refused_us > self.heard_us and now_us - self.refused_us < REFUSED_FOR_US

    def next_sequence(self, component: int) -> int:
        """Sequence number of a component's next frame to this peer, 0 to 255 and round again."""
        sequence = self._sequences.get(component, 0)
        self._sequences[component] = (sequence + 1) & 0xFF
        return sequence


class PeerTable:
    """All channels by address."""

    def __init__(
        self, peers: Sequence[Peer], intervals_us: Mapping[Profile, Mapping[int, int]]
    ) -> None:
        """Open a channel to each configured peer; `intervals_us` are the default rates."""
        self._intervals_us = intervals_us
        self._links = 0
        self._callers: set[Address] = set()
        self._earlier_callers: set[Address] = set()
        self._callers_us = 0
        self._displaced: list[Address] = []
        self._channels = {
            peer.address: self._channel(peer, learnt=False, now_us=0) for peer in peers
        }

    def __iter__(self) -> Iterator[Channel]:
        return iter(self._channels.values())

    def __len__(self) -> int:
        return len(self._channels)

    def get(self, address: Address) -> Channel | None:
        """Channel to an address; None when the peer is not known."""
        return self._channels.get(address)

    def only(self, address: Address) -> tuple[Channel, ...]:
        """The channel to one address, or none."""
        channel = self._channels.get(address)
        return () if channel is None else (channel,)

    def learn(self, address: Address, now_us: int) -> Channel | None:
        """Open a channel to a new peer that has sent a HEARTBEAT; None when no place is free."""
        learnt = [channel for channel in self if channel.learnt]
        if len(learnt) >= MAX_LEARNT_PEERS:
            loser = place_for(learnt, now_us) if self._has_called(address, now_us) else None
            if loser is None:
                return None
            del self._channels[loser.address]
            self._displaced.append(loser.address)
        peer = Peer(address=address, profile=Profile.GROUND_STATION)
        channel = self._channel(peer, learnt=True, now_us=now_us)
        self._channels[address] = channel
        return channel

    def _has_called(self, address: Address, now_us: int) -> bool:
        """Whether an address for which there was no place has called a moment earlier too.

        Forged senders come once. What is remembered is bounded; of a flood beyond it, an
        honest caller is remembered at one of its next heartbeats.
        """
        elapsed_us = now_us - self._callers_us
        if elapsed_us >= _CALLERS_PERIOD_US:
            self._earlier_callers = self._callers if elapsed_us < 3 * _CALLERS_PERIOD_US else set()
            self._callers = set()
            self._callers_us = now_us
        if len(self._callers) < MAX_CALLERS:
            self._callers.add(address)
        return address in self._earlier_callers

    def is_any_due(self, now_us: int) -> bool:
        """Whether any peer's schedule has something due; asked in every control step."""
        for channel in self._channels.values():  # noqa: SIM110 - a generator costs twice as much
            if channel.schedule.next_due_us <= now_us:
                return True
        return False

    def shortest_interval_us(self, now_us: int) -> int:
        """Interval [us] of what is sent most often to a peer that is heard; a second if to none."""
        return min(
            (
                channel.schedule.shortest_interval_us
                for channel in self
                if now_us - channel.heard_us < HEARD_LATELY_US
            ),
            default=LONGEST_INTERVAL_US,
        )

    def note_refused(self, addresses: Iterable[Address], now_us: int) -> None:
        """Note where datagrams have been turned away."""
        for address in addresses:
            channel = self._channels.get(address)
            if channel is not None:
                channel.refused_us = now_us

    def forget_silent(self, now_us: int) -> list[Address]:
        """Close the channels to learnt peers that have been silent for too long.

        Gives the addresses of these, and of those that lost their place to another since.
        """
        silent = [
            address
            for address, channel in self._channels.items()
            if channel.learnt and now_us - channel.heard_us > channel.patience_us
        ]
        for address in silent:
            del self._channels[address]
        gone, self._displaced = silent + self._displaced, []
        return gone

    def _channel(self, peer: Peer, *, learnt: bool, now_us: int) -> Channel:
        schedule = Schedule(self._intervals_us[peer.profile])
        link_id = self._links & 0xFF
        self._links += 1
        return Channel(peer, schedule, link_id=link_id, learnt=learnt, now_us=now_us)


def place_for(learnt: Sequence[Channel], now_us: int) -> Channel | None:
    """Which learnt peer gives its place to a newcomer that keeps calling; None: none does.

    First one that has been silent for longer than a ground station between two heartbeats;
    then one that has only ever sent HEARTBEATs. Of several, the one known for the shortest
    time. A peer that is heard and has spoken keeps its place.
    """
    silent = [c for c in learnt if now_us - c.heard_us > SHORTEST_SILENCE_US // 2]
    mute = [c for c in learnt if not c.spoken]
    return min(silent or mute, key=lambda c: c.heard_us - c.known_us, default=None)
