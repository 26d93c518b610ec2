"""The broker's uploader against the vehicle's mission server, over links that do their worst.

Both ends are the real ones, each with its own codec; time is simulated. What the vehicle holds
at the end must be what was meant, item by item.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import pytest

from mavlink_broker.autopilots.families import PX4
from mavlink_broker.mavlink import codec as broker_codec
from mavlink_broker.mavlink.dialect import Message, Route
from mavlink_broker.mavlink.mission_item import waypoint
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.mission_download import (
    Downloaded,
    MissionDownload,
    MissionVerify,
    Verified,
)
from mavlink_broker.microservices.mission_upload import (
    MissionUpload,
    NotStored,
    Stored,
    Uncertain,
    UploadOutcome,
)
from mavlink_broker.mission.exchanges import difference
from mavlink_broker.planning.mission import FlightPlan
from tests.support.lossy_link import GROUND_ADDRESS, VEHICLE_ADDRESS, Conditions, LossyLink
from tests.support.mission_field import any_plan
from uav_firmware.bus import Topic
from uav_firmware.modules.mavlink.missions.mission_server import MissionServer
from uav_firmware.modules.mavlink.missions.mission_store import PlanCheck, PlanStore
from uav_firmware.modules.mavlink.wire import dialect as vehicle_dialect
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect_extensions import MissionCurrent
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.msg.mission import Mission

ROUTE = Route(own_system=254, own_component=191, target_system=1, target_component=1)
STEP_US = 5_000
MISSION = 0
PATIENCE_S = 300.0

Activity = MissionUpload | MissionVerify | MissionDownload


@dataclass(frozen=True, kw_only=True)
class Trouble:
    """Conditions of both directions."""

    duplication: float = 0.0
    reordering: float = 0.0
    delay_s: float = 0.0

    def at(self, loss: float) -> Conditions:
        return Conditions(
            loss=loss,
            duplication=self.duplication,
            reordering=self.reordering,
            delay_us=round(self.delay_s * 1e6),
            hold_us=80_000,
        )


TROUBLES = [
    Trouble(),
    Trouble(duplication=0.2),
    Trouble(reordering=0.2),
    Trouble(delay_s=0.3),
    Trouble(delay_s=1.5),
    Trouble(duplication=0.2, reordering=0.2, delay_s=0.3),
]


class Vehicle:
    """The firmware's mission server with as much around it as puts it on the wire."""

    def __init__(self) -> None:
        self.topic: Topic[Mission] = Topic()
        missions = PlanStore(
            MISSION,
            check=PlanCheck(lambda _: None, any_plan),
            publish=lambda plan: self.topic.publish(Mission(*plan)),
        )
        self.server = MissionServer(
            system_id=1,
            stores={MISSION: missions},
            current_seq=lambda: 0,
            texts=StatusTexts(),
        )
        self._sequence = 0

    def receive(self, datagram: bytes, now_us: int) -> list[bytes]:
        answers: list[Outgoing] = []
        for message in vehicle_dialect.parse(datagram).messages:
            if message.get_type() in self.server.message_types:
                sender = Sender(ROUTE.own_system, ROUTE.own_component, GROUND_ADDRESS)
                answers += self.server.handle(message, sender, now_us)
            elif message.get_type() == "COMMAND_LONG":
                answers.append(self._current())
        return [self._frame(answer) for answer in answers]

    def tick(self, now_us: int) -> list[bytes]:
        return [self._frame(answer) for answer in self.server.tick(now_us)]

    def _current(self) -> Outgoing:
        mission = self.topic.value
        return Outgoing(MissionCurrent(seq=0, mission_id=mission.mission_id if mission else 0))

    def _frame(self, outgoing: Outgoing) -> bytes:
        self._sequence = (self._sequence + 1) % 256
        payload = vehicle_dialect.pack(outgoing.message)
        return vehicle_dialect.frame(payload, self._sequence, 1, 1)


class Field:
    """Broker, vehicle and the air between them."""

    def __init__(self, trouble: Trouble, loss: float, seed: int, *, step_us: int = STEP_US) -> None:
        self.vehicle = Vehicle()
        self._step_us = step_us
        self.now_us = 0
        self._link = LossyLink(trouble.at(loss), trouble.at(loss), seed=seed)
        self._encoder = broker_codec.Encoder(ROUTE.own_system, ROUTE.own_component)
        self._decoder = broker_codec.Decoder()

    def run(self, activity: Activity, patience_s: float = PATIENCE_S) -> None:
        """Let time pass until the activity has its outcome."""
        end_us = self.now_us + round(patience_s * 1e6)
        self._send(activity.start(self.now_us / 1e6))
        while activity.outcome is None:
            assert self.now_us < end_us, "no outcome"
            self.now_us += self._step_us
            self._step(activity)

    def _step(self, activity: Activity) -> None:
        self._link.advance(self.now_us)
        for datagram, _ in self._link.vehicle.receive():
            for frame in self.vehicle.receive(datagram, self.now_us):
                self._link.vehicle.send(frame, GROUND_ADDRESS)
        for frame in self.vehicle.tick(self.now_us):
            self._link.vehicle.send(frame, GROUND_ADDRESS)
        for datagram, _ in self._link.ground.receive():
            for message in self._decoder.decode(datagram):
                self._send(activity.receive(message, self.now_us / 1e6))
        self._send(activity.tick(self.now_us / 1e6))

    def _send(self, messages: Sequence[Message]) -> None:
        for message in messages:
            self._link.ground.send(self._encoder.encode(message), VEHICLE_ADDRESS)


def a_plan(count: int, shift: float = 0.0) -> FlightPlan:
    items = tuple(
        waypoint(
            latitude_deg=40.4434 + (i + shift) * 1e-5,
            longitude_deg=-3.7382 - i * 1e-5,
            relative_altitude_m=5.0 + i,
            acceptance_radius_m=1.0,
            yaw_deg=None if i % 2 else 90.0,
        )
        for i in range(count)
    )
    owners = tuple(range(count))
    return FlightPlan(
        items=items,
        command_of_item=owners,
        done_item=owners,
        notes=((),) * count,
        first_item=0,
        ends_on_ground=False,
    )


def uploaded(
    field: Field, plan: FlightPlan, patience_s: float = PATIENCE_S
) -> UploadOutcome | None:
    upload = MissionUpload(plan.messages(1, 1), ROUTE, RoundTrip(), busy_pause_s=6.0)
    field.run(upload, patience_s)
    return upload.outcome


def verified(field: Field, plan: FlightPlan, opaque_id: int) -> object:
    verify = MissionVerify(
        opaque_id, lambda messages: difference(plan, messages, PX4), ROUTE, RoundTrip()
    )
    field.run(verify)
    return verify.outcome


def assert_transferred(field: Field, plan: FlightPlan) -> None:
    outcome = uploaded(field, plan)
    assert isinstance(outcome, Stored | Uncertain), outcome
    opaque_id = outcome.opaque_id if isinstance(outcome, Stored) else 0
    assert verified(field, plan, opaque_id) == Verified()
    held = field.vehicle.topic.value
    assert held is not None
    assert len(held.items) == len(plan.items)
    for item, meant in zip(held.items, plan.items, strict=True):
        assert item.x == pytest.approx(meant.latitude_deg, abs=1e-7)
        assert item.z == pytest.approx(meant.altitude_m, abs=1e-4)


@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("trouble", TROUBLES, ids=str)
def test_a_mission_arrives_and_is_verified(trouble: Trouble, loss: float) -> None:
    for seed in range(3):
        assert_transferred(Field(trouble, loss, seed), a_plan(8))


@pytest.mark.thorough
def test_at_a_fifth_lost_in_each_direction_a_hundred_of_a_hundred_arrive() -> None:
    for seed in range(100):
        trouble = Trouble(duplication=0.05, reordering=0.05, delay_s=0.02)
        assert_transferred(Field(trouble, 0.2, seed), a_plan(100))


@pytest.mark.thorough
def test_over_a_slow_link_too_a_hundred_of_a_hundred_arrive() -> None:
    """A round trip of 1.5 s, and a fifth lost in each direction."""
    for seed in range(100):
        assert_transferred(Field(Trouble(delay_s=0.75), 0.2, seed, step_us=20_000), a_plan(10))


@pytest.mark.first_case
@pytest.mark.parametrize("trouble", TROUBLES, ids=str)
def test_at_three_tenths_lost_the_outcome_is_definite_and_the_plan_whole(trouble: Trouble) -> None:
    field, plan = Field(trouble, 0.3, seed=3), a_plan(100)
    outcome = uploaded(field, plan, patience_s=1500.0)
    held = field.vehicle.topic.value
    stored = held is not None and len(held.items) == len(plan.items)
    assert stored or (isinstance(outcome, NotStored | Uncertain) and held is None), outcome


@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_a_second_mission_takes_the_place_of_the_first(loss: float) -> None:
    field = Field(Trouble(), loss, seed=7)
    assert_transferred(field, a_plan(8))
    assert_transferred(field, a_plan(5, shift=3.0))


@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_what_was_uploaded_is_read_back_the_same(loss: float) -> None:
    field, plan = Field(Trouble(), loss, seed=5), a_plan(9)
    assert_transferred(field, plan)
    download = MissionDownload(ROUTE, RoundTrip())
    field.run(download)
    assert isinstance(download.outcome, Downloaded)
    assert difference(plan, download.outcome.items, PX4) is None


def test_another_mission_on_the_vehicle_is_not_taken_for_ours() -> None:
    field = Field(Trouble(), 0.0, seed=1)
    assert_transferred(field, a_plan(4))
    assert verified(field, a_plan(4, shift=1.0), 0) != Verified()


def test_five_hundred_items_need_no_retry_on_a_clean_link() -> None:
    field = Field(Trouble(), 0.0, seed=1)
    assert_transferred(field, a_plan(500))
    steps_per_item = 2
    assert field.now_us <= 500 * steps_per_item * STEP_US + 1_000_000
