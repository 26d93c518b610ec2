"""A datagram link that loses, delays, duplicates and reorders; seeded, in simulated time.

    link = LossyLink(Conditions(loss=0.2), Conditions(loss=0.2), seed=1)
    link.vehicle.send(datagram, GROUND_ADDRESS)
    link.advance(now_us)
    for datagram, sender in link.ground.receive(): ...

Both ends have the methods of `uav_firmware.cal.link.Link`.
"""

import heapq
import random
from dataclasses import dataclass
from typing import Final, TypeAlias

Address: TypeAlias = tuple[str, int]

VEHICLE_ADDRESS: Final[Address] = ("192.0.2.1", 14581)
GROUND_ADDRESS: Final[Address] = ("192.0.2.2", 14540)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What happens to a datagram in one direction."""

    loss: float = 0.0  # [-] Probability that it never arrives
    delay_us: int = 0  # [us] Transit time of every datagram
    duplication: float = 0.0  # [-] Probability that it arrives twice
    reordering: float = 0.0  # [-] Probability that it is held back, so that later ones arrive first
    hold_us: int = 30_000  # [us] For how long


class LinkEnd:
    """One end; datagrams wait until they are received."""

    def __init__(self, link: "LossyLink", address: Address) -> None:
        self._link = link
        self.address = address
        self.inbox: list[tuple[bytes, Address]] = []

    def receive(self) -> list[tuple[bytes, Address]]:
        """Everything that has arrived."""
        arrived, self.inbox = self.inbox, []
        return arrived

    def send(self, datagram: bytes, _address: Address) -> None:
        """Send to the other end; there is only one."""
        self._link.carry(datagram, self)

    def refused_addresses(self) -> list[Address]:
        """No address refuses datagrams."""
        return []

    def close(self) -> None:
        """Nothing to release."""


class LossyLink:
    """Two ends and the datagrams in transit."""

    def __init__(self, to_ground: Conditions, to_vehicle: Conditions, *, seed: int) -> None:
        self.vehicle = LinkEnd(self, VEHICLE_ADDRESS)
        self.ground = LinkEnd(self, GROUND_ADDRESS)
        self._directions = {
            VEHICLE_ADDRESS: (to_ground, self.ground),
            GROUND_ADDRESS: (to_vehicle, self.vehicle),
        }
        self._random = random.Random(seed)
        self._in_transit: list[tuple[int, int, bytes, Address]] = []
        self._number = 0
        self._now_us = 0
        self.carried: int = 0
        self.lost: int = 0

    def degrade(self, to_ground: Conditions, to_vehicle: Conditions) -> None:
        """Change the conditions for what is sent from now on."""
        self._directions = {
            VEHICLE_ADDRESS: (to_ground, self.ground),
            GROUND_ADDRESS: (to_vehicle, self.vehicle),
        }

    def advance(self, now_us: int) -> None:
        """Let time pass and deliver what is due."""
        self._now_us = now_us
        while self._in_transit and self._in_transit[0][0] <= now_us:
            _, _, datagram, sender = heapq.heappop(self._in_transit)
            self._directions[sender][1].inbox.append((datagram, sender))

    def carry(self, datagram: bytes, sender: LinkEnd) -> None:
        """Lose, delay or duplicate a datagram."""
        conditions, _ = self._directions[sender.address]
        copies = 2 if self._random.random() < conditions.duplication else 1
        for _ in range(copies):
            self.carried += 1
            if self._random.random() < conditions.loss:
                self.lost += 1
                continue
            held = self._random.random() < conditions.reordering
            due_us = self._now_us + conditions.delay_us + (conditions.hold_us if held else 0)
            self._number += 1
            heapq.heappush(self._in_transit, (due_us, self._number, datagram, sender.address))
