"""An uploader written from the specification, over a bad link, in simulated time."""

import struct
from typing import Any

import pytest

from tests.support.lossy_link import GROUND_ADDRESS, VEHICLE_ADDRESS, Conditions, LossyLink
from tests.unit.uav_firmware.modules.mavlink.harness import (
    STEP_US,
    SYSTEM,
    flying_topics,
    judged_by,
    mission_count,
    mission_item,
)
from uav_firmware.modules.mavlink.dialect import frame, mavlink, pack, parse
from uav_firmware.modules.mavlink.mission_items import StoredItem, plan_id, read_item
from uav_firmware.modules.mavlink.module import MavlinkModule
from uav_firmware.modules.mavlink.peers import Peer, Profile
from uav_firmware.parameters import Registry

ITEMS = [mission_item(seq, param1=float(seq)) for seq in range(100)]
ACCEPTED, CANCELLED = 0, 15


class Uploader:
    """MISSION_COUNT until the first request, then every request answered, then the last item
    again until the acknowledgement comes."""

    def __init__(self) -> None:
        self.count_sent_us = -(10**9)
        self.last_item_us: int | None = None
        self.began = False
        self.ack: Any = None

    def step(self, heard: list[Any], now_us: int) -> list[Any]:
        said: list[Any] = []
        for message in heard:
            if message.get_type() == "MISSION_REQUEST_INT" and message.seq < len(ITEMS):
                self.began = True
                said.append(ITEMS[message.seq])
                if message.seq == len(ITEMS) - 1:
                    self.last_item_us = now_us
            elif message.get_type() == "MISSION_ACK":
                self.ack = message
        if not self.began and now_us - self.count_sent_us >= 1_000_000:
            self.count_sent_us = now_us
            said.append(mission_count(len(ITEMS)))
        if self.last_item_us is not None and now_us - self.last_item_us >= 3_000_000:
            self.last_item_us = now_us
            said.append(ITEMS[-1])
        return [] if self.ack is not None else said


class Downloader:
    """Asks for the list, then for what is missing, five at a time."""

    def __init__(self) -> None:
        self.count: int | None = None
        self.items: dict[int, Any] = {}
        self.asked_us = -(10**9)

    def step(self, heard: list[Any], now_us: int) -> list[Any]:
        for message in heard:
            if message.get_type() == "MISSION_COUNT":
                self.count = message.count
            elif message.get_type() == "MISSION_ITEM_INT":
                self.items[message.seq] = message
        if now_us - self.asked_us < 250_000:
            return []
        self.asked_us = now_us
        if self.count is None:
            return [mavlink.MAVLink_mission_request_list_message(SYSTEM, 1, 0)]
        missing = [seq for seq in range(self.count) if seq not in self.items]
        return [
            mavlink.MAVLink_mission_request_int_message(SYSTEM, 1, seq, 0) for seq in missing[:5]
        ]

    @property
    def done(self) -> bool:
        return self.count is not None and len(self.items) == self.count


class World:
    """A vehicle and a client with a lossy link between them."""

    def __init__(self, conditions: Conditions, seed: int) -> None:
        self.link = LossyLink(conditions, conditions, seed=seed)
        self.topics = flying_topics()
        self.module = MavlinkModule(
            link=self.link.vehicle,
            system_id=SYSTEM,
            registry=Registry(),
            topics=self.topics,
            checks=judged_by(_anything),
            peers=(Peer(address=GROUND_ADDRESS, profile=Profile.ONBOARD),),
        )
        self.now_us = 0
        self._sequence = 0

    def run(self, client: Any, until_us: int, done: Any) -> None:
        """Step both ends until `done` or the time is over."""
        while self.now_us < until_us and not done():
            self.now_us += STEP_US
            self.link.advance(self.now_us)
            self.module.update(self.now_us)
            heard = [
                m for datagram, _ in self.link.ground.receive() for m in parse(datagram).messages
            ]
            for message in client.step(heard, self.now_us):
                self._sequence = (self._sequence + 1) & 0xFF
                datagram = frame(pack(message), self._sequence, 254, 190)
                self.link.ground.send(datagram, VEHICLE_ADDRESS)


def _anything(_items: object) -> None:
    """Accept any plan."""


def stored_items() -> list[StoredItem]:
    items = [read_item(item) for item in ITEMS]
    return [item for item in items if isinstance(item, StoredItem)]


def as_bytes(message: Any) -> bytes:
    """The parts of an item that a download must give back."""
    p = (message.param1, message.param2, message.param3, message.param4)
    return struct.pack("<HBH4fiif", message.seq, message.frame, message.command, *p, message.x,
                       message.y, message.z)  # fmt: skip


@pytest.mark.parametrize("seed", range(10))
def test_100_items_arrive_at_20_percent_loss_each_way(seed: int) -> None:
    world, client = World(Conditions(loss=0.2), seed), Uploader()
    world.run(client, 300_000_000, lambda: client.ack is not None)
    assert client.ack is not None
    assert client.ack.type == ACCEPTED
    mission = world.topics.mission.value
    assert mission is not None
    assert client.ack.opaque_id == mission.mission_id == plan_id(stored_items())
    assert [item.param1 for item in mission.items] == [float(i) for i in range(100)]


@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2, 0.3])
@pytest.mark.parametrize("delay_us", [0, 150_000, 750_000])
@pytest.mark.parametrize(("duplication", "reordering"), [(0.0, 0.0), (0.2, 0.2)])
def test_an_upload_ends_right_or_in_a_definite_error(
    loss: float, delay_us: int, duplication: float, reordering: float
) -> None:
    conditions = Conditions(
        loss=loss, delay_us=delay_us, duplication=duplication, reordering=reordering
    )
    world, client = World(conditions, seed=1), Uploader()
    world.run(client, 1_000_000_000, lambda: client.ack is not None)
    mission = world.topics.mission.value
    assert mission is not None
    assert client.ack is not None, "no definite state"
    if client.ack.type == ACCEPTED:
        assert mission.mission_id == plan_id(stored_items())
    else:
        assert client.ack.type == CANCELLED
        assert mission.items == ()


@pytest.mark.parametrize("seed", range(3))
def test_100_items_come_down_again_as_they_went_up(seed: int) -> None:
    world, uploader = World(Conditions(), seed), Uploader()
    world.run(uploader, 60_000_000, lambda: uploader.ack is not None)
    bad = Conditions(loss=0.2, delay_us=50_000, duplication=0.1, reordering=0.1)
    world.link.degrade(bad, bad)
    client = Downloader()
    world.run(client, 300_000_000, lambda: client.done)
    assert [as_bytes(client.items[seq]) for seq in range(100)] == [as_bytes(i) for i in ITEMS]
