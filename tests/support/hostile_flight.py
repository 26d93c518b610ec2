"""A mission flown under fire: the whole autopilot in this process, an enemy on its link.

    calm = fly(folder, 0, is_signed=True)
    under_fire = fly(folder, 20_000, is_signed=True, calls=calm.calls)
    assert under_fire.track == calm.track

What nobody has rightly commanded must not move the vehicle, so that the flight is compared with
the same flight in peace, bit for bit.
"""

import random
import resource
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from sim.config import SimulationConfig
from tests.support.autopilot_tester import SYSTEM_ID, AutopilotTester
from tests.support.ground_station import ADDRESS, MemoryLink
from tests.support.hostile_frames import HostileFrames
from uav_firmware.cal.link import Address
from uav_firmware.modules.mavlink.wire.link_security import SIGN_ALWAYS
from uav_firmware.modules.mavlink.wire.peers import Peer, Profile
from uav_firmware.msg.link import RefusedFrames

KEY: Final = bytes(range(32))
_ENEMY: Final[Address] = ("192.0.2.66", 6666)
_TRACK_EVERY_STEPS: Final = 250


class FireLink(MemoryLink):
    """The operator's link, on which an enemy speaks too: from his own address, from forged ones."""

    def __init__(
        self, frames: HostileFrames, count: int, calls: int, *, is_operator_forged: bool
    ) -> None:
        """Send so many hostile frames, evenly over so many calls.

        With the operator's own address forged too, answers to the enemy's questions would go to
        the operator; so that is for links on which an enemy is not answered.
        """
        super().__init__()
        self._frames = frames
        self._random = random.Random(1)
        self._count = count
        self._expected_calls = max(calls, 1)
        self._is_operator_forged = is_operator_forged
        self.calls = 0
        self.sent: Counter[str] = Counter()
        self.answered_bytes = 0  # To whoever is not the operator

    def receive(self) -> Sequence[tuple[bytes, Address]]:
        """The operator's datagrams among the enemy's."""
        self.calls += 1
        due = min(self._count, self._count * self.calls // self._expected_calls)
        arrived = list(super().receive())
        for _ in range(due - self.sent.total()):
            kind, contents = next(self._frames)
            self.sent[kind] += 1
            arrived.append((contents, self._sender()))
        return arrived

    def send(self, datagram: bytes, address: Address) -> None:
        """Keep what is meant for the operator, count the rest."""
        if address == ADDRESS:
            super().send(datagram, address)
        else:
            self.answered_bytes += len(datagram)

    def _sender(self) -> Address:
        """The enemy himself, somebody that he pretends to be, or the operator's own address."""
        chance = self._random.random()
        if chance < 0.6:
            return _ENEMY
        if chance < 0.9 or not self._is_operator_forged:
            return (f"198.51.100.{self._random.randrange(1, 255)}", self._random.randrange(65536))
        return ADDRESS


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a flight went."""

    calls: int  # [-] Times that the link was read
    items_reached: list[int]
    track: list[Any] = field(repr=False)  # True state every second
    sent: Counter[str]  # Hostile datagrams by kind
    refused: RefusedFrames | None
    answered_bytes: int  # [B] Sent to others than the operator
    slowest_step_s: float  # [s] Of processor time
    cpu_s: float  # [s] Of processor time, the simulation and the enemy's own included
    growth_mb: float  # [MB] Of the process's largest size since take-off


def fly(
    folder: Path,
    frames: int,
    *,
    is_signed: bool,
    calls: int = 1,
    hold_s: float = 2.0,
    seed: int = 1,
) -> Outcome:
    """Fly a square mission under `frames` hostile frames, spread over `calls` of the link.

    `hold_s` is how long the vehicle hovers at each corner.
    """
    enemy = HostileFrames(seed, SYSTEM_ID, is_harmless=not is_signed)
    link = FireLink(enemy, frames, calls, is_operator_forged=is_signed)
    key = KEY if is_signed else None
    operator = Peer(address=ADDRESS, profile=Profile.GROUND_STATION, signing_key=key)
    config = SimulationConfig(seed=seed, gps="rtk")
    tester = AutopilotTester(config, folder, link=link, peers=(operator,))
    if is_signed:
        tester.autopilot.registry.set("MAV_SIGN_CFG", SIGN_ALWAYS)
        tester.ground_station.sign(KEY)
    return _measured(tester, link, hold_s)


def _measured(tester: AutopilotTester, link: FireLink, hold_s: float) -> Outcome:
    track: list[Any] = []
    clock = _StepClock(tester, track)
    tester.watch(clock.note)
    began, size = time.process_time(), _largest_size_mb()
    _fly_square(tester, hold_s)
    return Outcome(
        calls=link.calls,
        items_reached=sorted(set(tester.ground_station.items_reached)),
        track=track,
        sent=link.sent,
        refused=tester.autopilot.topics.refused_frames.value,
        answered_bytes=link.answered_bytes,
        slowest_step_s=clock.slowest_s,
        cpu_s=time.process_time() - began,
        growth_mb=_largest_size_mb() - size,
    )


class _StepClock:
    """Notes what a step cost, and where the vehicle is once a second."""

    def __init__(self, tester: AutopilotTester, track: list[Any]) -> None:
        self._tester = tester
        self._track = track
        self._steps = 0
        self._before = time.process_time()
        self.slowest_s = 0.0

    def note(self) -> None:
        """One step has passed."""
        now = time.process_time()
        self.slowest_s = max(self.slowest_s, now - self._before)
        self._before = now
        if self._steps % _TRACK_EVERY_STEPS == 0:
            self._track.append(self._tester.truth)
        self._steps += 1


def _fly_square(tester: AutopilotTester, hold_s: float) -> None:
    station = tester.ground_station
    places = [
        tester.place(north, east, 5.0) for north, east in ((0, 0), (20, 0), (20, 20), (0, 20))
    ]
    items = [station.mission_item(0, 22, places[0])]
    corners = enumerate(places[1:], 1)
    items += [station.mission_item(seq, 16, place, hold_s) for seq, place in corners]
    items.append(station.return_item(len(items)))
    tester.wait_until_ready()
    tester.upload(items)
    tester.start_mission()
    tester.wait_until_landed(120.0 + 4 * hold_s)


def _largest_size_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
