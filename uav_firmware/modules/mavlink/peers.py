"""The peers of the vehicle: configured ones for ever, others while they are heard.

A configured peer (the broker, the ground station) is sent heartbeats and streams from the
start. Any other address is learnt from its HEARTBEAT, gets the ground station's rates, and is
forgotten after a minute of silence.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.schedule import LONGEST_INTERVAL_US, Schedule

MAX_LEARNT_PEERS: Final = 8
SILENCE_LIMIT_US: Final = 60_000_000


class Profile(Enum):
    """Which default rates a peer gets."""

    GROUND_STATION = "ground station"
    ONBOARD = "onboard"


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A peer that the configuration names."""

    address: Address
    profile: Profile


class Channel:
    """The state of the link to one peer: its sequence counter and its schedule."""

    __slots__ = ("_sequence", "address", "heard_us", "learnt", "profile", "schedule")

    def __init__(self, peer: Peer, schedule: Schedule, *, learnt: bool, now_us: int) -> None:
        self.address = peer.address
        self.profile = peer.profile
        self.schedule = schedule
        self.learnt = learnt
        self.heard_us = now_us
        self._sequence = 0

    def next_sequence(self) -> int:
        """Sequence number of the next frame to this peer, 0 to 255 and round again."""
        sequence = self._sequence
        self._sequence = (sequence + 1) & 0xFF
        return sequence


class PeerTable:
    """All channels by address."""

    def __init__(
        self, peers: Sequence[Peer], intervals_us: Mapping[Profile, Mapping[int, int]]
    ) -> None:
        """Open a channel to each configured peer; `intervals_us` are the default rates."""
        self._intervals_us = intervals_us
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

    def heard(self, address: Address, now_us: int) -> bool:
        """Note that a peer has sent a valid message; False when the peer is not known."""
        channel = self._channels.get(address)
        if channel is None:
            return False
        channel.heard_us = now_us
        return True

    def learn(self, address: Address, now_us: int) -> Channel | None:
        """Open a channel to a new peer; None when as many are known as may be learnt."""
        if sum(channel.learnt for channel in self) >= MAX_LEARNT_PEERS:
            return None
        peer = Peer(address=address, profile=Profile.GROUND_STATION)
        channel = self._channel(peer, learnt=True, now_us=now_us)
        self._channels[address] = channel
        return channel

    def is_any_due(self, now_us: int) -> bool:
        """Whether any peer's schedule has something due; asked in every control step."""
        for channel in self._channels.values():  # noqa: SIM110 - a generator costs twice as much
            if channel.schedule.next_due_us <= now_us:
                return True
        return False

    def shortest_interval_us(self) -> int:
        """Interval [us] of the message that is sent most often; a second if there is none."""
        return min(
            (channel.schedule.shortest_interval_us for channel in self),
            default=LONGEST_INTERVAL_US,
        )

    def forget_silent(self, now_us: int) -> list[Address]:
        """Close the channels to learnt peers that have been silent for too long."""
        silent = [
            address
            for address, channel in self._channels.items()
            if channel.learnt and now_us - channel.heard_us > SILENCE_LIMIT_US
        ]
        for address in silent:
            del self._channels[address]
        return silent

    def _channel(self, peer: Peer, *, learnt: bool, now_us: int) -> Channel:
        schedule = Schedule(self._intervals_us[peer.profile])
        return Channel(peer, schedule, learnt=learnt, now_us=now_us)
