"""A vehicle's mission server and ground stations over a lossy link, in simulated time."""

from collections.abc import Sequence
from typing import Any, Final

from pymavlink.dialects.v20 import common

from tests.support.lossy_link import GROUND_ADDRESS, VEHICLE_ADDRESS, Conditions, LossyLink
from tests.support.mission_clients import Client, Message
from uav_firmware.bus import Topic
from uav_firmware.cal.storage import Storage
from uav_firmware.modules.mavlink.missions.mission_server import MissionServer
from uav_firmware.modules.mavlink.missions.mission_store import PlanCheck, PlanStore
from uav_firmware.modules.mavlink.wire import dialect
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.mission import Mission, MissionItem, PlanReview

STEP_US: Final = 20_000
"""The vehicle's tick; datagrams are answered as often in reality, which only makes it faster."""
MISSION: Final = 0


def any_plan(_items: Sequence[MissionItem]) -> PlanReview:
    """Accept every plan."""
    yield 1
    return None


class Vehicle:
    """The firmware's mission server for missions, with its own codec."""

    def __init__(self, *, storage: Storage | None = None) -> None:
        self.mission: Topic[Mission] = Topic()
        store = PlanStore(
            MISSION,
            check=PlanCheck(lambda _: None, any_plan),
            publish=lambda accepted: self.mission.publish(Mission(*accepted)),
            storage=storage,
        )
        self.server = MissionServer(
            system_id=1, stores={MISSION: store}, current_seq=lambda: 0, texts=StatusTexts()
        )
        self.server.load()
        self._sequence = 0

    def receive(self, datagram: bytes, now_us: int) -> list[bytes]:
        """Frames that answer a datagram."""
        answers: list[Outgoing] = []
        for message in dialect.parse(datagram).messages:
            if message.get_type() in self.server.message_types:
                source = (message.get_srcSystem(), message.get_srcComponent())
                answers += self.server.handle(message, Sender(*source, GROUND_ADDRESS), now_us)
        return [self._framed(answer) for answer in answers]

    def tick(self, now_us: int) -> list[bytes]:
        """Frames that are due."""
        return [self._framed(answer) for answer in self.server.tick(now_us)]

    @staticmethod
    def read(datagram: bytes) -> Message:
        """The one message of an own frame."""
        (message,) = dialect.parse(datagram).messages
        return message

    def _framed(self, outgoing: Outgoing) -> bytes:
        self._sequence = (self._sequence + 1) & 0xFF
        return dialect.frame(dialect.pack(outgoing.message), self._sequence, 1, 1)


class Field:
    """One vehicle and the clients that transfer plans to and from it."""

    def __init__(self, conditions: Conditions = Conditions(), *, seed: int = 1) -> None:  # noqa: B008 - frozen
        self.vehicle = Vehicle()
        self.link = LossyLink(conditions, conditions, seed=seed)
        self.now_us = 0
        self._codecs: dict[int, Any] = {}

    def run(self, client: Client, *, system: int = 255, patience_s: float = 1200.0) -> str:
        """Run a client to its outcome, and return that."""
        return self.run_all({system: client}, patience_s=patience_s)[system]

    def run_all(self, clients: dict[int, Client], *, patience_s: float = 1200.0) -> dict[int, str]:
        """Run several clients at once, each with its own system id."""
        end_us = self.now_us + round(patience_s * 1e6)
        for system, client in clients.items():
            self.send(client.start(self._now_s), system)
        while any(client.outcome is None for client in clients.values()):
            assert self.now_us < end_us, "no definite outcome"
            self.pass_time(STEP_US, clients)
        return {system: client.outcome or "" for system, client in clients.items()}

    def pass_time(self, step_us: int, clients: dict[int, Client]) -> None:
        """Advance time by one step."""
        self.now_us += step_us
        self.link.advance(self.now_us)
        answers = [
            frame
            for datagram, _ in self.link.vehicle.receive()
            for frame in self.vehicle.receive(datagram, self.now_us)
        ]
        for frame in answers + self.vehicle.tick(self.now_us):
            self.link.vehicle.send(frame, GROUND_ADDRESS)
        received = [m for datagram, _ in self.link.ground.receive() for m in self._read(datagram)]
        for system, client in clients.items():
            for message in received:
                if getattr(message, "target_system", system) == system:
                    self.send(client.receive(message, self._now_s), system)
            self.send(client.tick(self._now_s), system)

    def pass_seconds(self, seconds: float) -> None:
        """Advance time without a client."""
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.pass_time(STEP_US, {})

    @property
    def _now_s(self) -> float:
        return self.now_us * 1e-6

    def _codec(self, system: int) -> Any:
        if system not in self._codecs:
            self._codecs[system] = common.MAVLink(None, srcSystem=system, srcComponent=190)
        return self._codecs[system]

    def _read(self, datagram: bytes) -> list[Message]:
        message = self._codec(0).decode(bytearray(datagram))
        return [message] if message.get_type().startswith("MISSION_") else []

    def send(self, messages: Sequence[Message], system: int) -> None:
        """Send messages with a system id."""
        codec = self._codec(system)
        for message in messages:
            self.link.ground.send(message.pack(codec), VEHICLE_ADDRESS)
            codec.seq = (codec.seq + 1) % 256


def plan_of(count: int, *, height_m: float = 10.0, mission_type: int = MISSION) -> list[Message]:
    """Waypoints, each different from the others."""
    return [
        common.MAVLink_mission_item_int_message(
            *(1, 1, seq, 6, 16, int(seq == 0), 1, float(seq), 0.0, 0.0, 0.0),
            *(404_434_000 + seq, -37_382_000 - seq, height_m, mission_type),
        )
        for seq in range(count)
    ]
