"""Each MAV_MISSION_RESULT where it belongs: the vehicle's judges behind its mission server.

The masks are PX4's: a parameter that is set and not honoured is refused with its number.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

import pytest
from pymavlink.dialects.v20 import common, development

from tests.support.mission_field import Vehicle
from uav_firmware.lib import fence_rules, mission_rules
from uav_firmware.lib.mission_rules import DistanceLimits
from uav_firmware.modules.mavlink.missions.mission_server import MissionServer
from uav_firmware.modules.mavlink.missions.mission_store import PlanCheck, PlanStore
from uav_firmware.modules.mavlink.wire.dialect import Message, frame, pack
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.msg.mission import MissionItem, PlanReview
from uav_firmware.msg.status import HomePosition
from uav_firmware.parameters import Registry

ACCEPTED, UNSUPPORTED_FRAME, UNSUPPORTED, INVALID = 0, 2, 3, 5
P1, P2, P3, P4, P5, P6, P7 = range(6, 13)
MISSION, FENCE, RALLY = 0, 1, 2
NAN: Final = math.nan
HOME: Final = HomePosition(0, 40.4434, -3.7382, 650.0, (0.0, 0.0, 0.0), 0.0)
INT32_MAX: Final = 0x7FFFFFFF
FRAMES: Final = sorted({*development.enums["MAV_FRAME"], 22, 255})
PLACES: Final = {0, 3, 5, 6}
"""Frames that hold a place: above mean sea level and above home, in both spellings."""


def with_judges(checks: Sequence[PlanCheck]) -> Vehicle:
    """A vehicle whose plans of all three types are judged."""
    vehicle = Vehicle()
    stores = {
        kind: PlanStore(kind, check=check, publish=lambda _: None)
        for kind, check in enumerate(checks)
    }
    vehicle.server = MissionServer(
        system_id=1, stores=stores, current_seq=lambda: 0, texts=StatusTexts()
    )
    vehicle.server.load()
    return vehicle


def judges() -> list[PlanCheck]:
    registry = Registry()
    registry.add(NavigatorParams)
    params = registry.read(NavigatorParams)
    limits = DistanceLimits(params.farthest_first_position, params.longest_leg)

    def rally(items: Sequence[MissionItem]) -> PlanReview:
        yield 1
        return fence_rules.check_rally_points(items)

    return [
        PlanCheck(
            lambda item: mission_rules.check_item(item, HOME),
            lambda items: mission_rules.review(items, HOME, limits),
        ),
        PlanCheck(fence_rules.check_fence_item, fence_rules.review_fence),
        PlanCheck(fence_rules.check_rally_point, rally),
    ]


class Uploader:
    """Uploads plans and returns the answer and its item."""

    def __init__(self) -> None:
        self.vehicle = with_judges(judges())
        self._now_us = 0

    def send(self, message: Message) -> list[Message]:
        """Send a message and return the answers of the vehicle's next ticks."""
        self._now_us += 1_000_000
        answers = self.vehicle.receive(frame(pack(message), 0, 255, 190), self._now_us)
        for _ in range(20):
            self._now_us += 1_000
            answers += self.vehicle.tick(self._now_us)
        return [Vehicle.read(answer) for answer in answers]

    def upload(self, items: Sequence[Message]) -> tuple[int, int]:
        """The result, and the number of items that had been sent by then."""
        kind = items[0].mission_type
        answers = self.send(common.MAVLink_mission_count_message(1, 1, len(items), kind))
        for sent, item in enumerate([None, *items]):
            if item is not None:
                item.seq = sent - 1
                answers = self.send(item)
            acks = [message for message in answers if message.get_type() == "MISSION_ACK"]
            if acks:
                assert len(acks) == 1
                assert acks[0].mission_type == kind
                return acks[0].type, sent
        raise AssertionError("no answer")


def item(command: int, *p: float, **fields: Any) -> Message:
    """An item at a place 10 m above home, unless given otherwise."""
    given = [*p, *[0.0] * (4 - len(p))]
    values: dict[str, Any] = {
        "target_system": 1,
        "target_component": 1,
        "seq": 0,
        "frame": 6,
        "command": command,
        "current": 0,
        "autocontinue": 1,
        "mission_type": MISSION,
        **{f"param{number}": value for number, value in enumerate(given, start=1)},
        "x": 404_434_000,
        "y": -37_382_000,
        "z": 10.0,
    }
    return common.MAVLink_mission_item_int_message(**{**values, **fields})


def order(command: int, *p: float, **fields: Any) -> Message:
    """An item without a place."""
    return item(command, *p, **{"frame": 2, "x": 0, "y": 0, "z": 0.0, **fields})


def vertex(*, count: float = 3.0, corner: int = 0, command: int = 5001, **fields: Any) -> Message:
    """A corner of a triangular fence."""
    north, east = ((0, 0), (9000, 0), (0, 9000))[corner % 3]
    place = {"x": 404_434_000 + north, "y": -37_382_000 + east, "z": 0.0}
    return item(command, count, **{"mission_type": FENCE, **place, **fields})


def answer(*items: Message) -> int:
    return Uploader().upload(items)[0]


@pytest.mark.parametrize("number", FRAMES)
def test_every_frame_is_known_or_refused_as_such(number: int) -> None:
    place = ACCEPTED if number in PLACES else UNSUPPORTED_FRAME
    assert answer(item(16, frame=number, z=700.0)) == place
    assert answer(item(5003, 50.0, frame=number, mission_type=FENCE)) == place
    assert answer(item(5100, frame=number, mission_type=RALLY)) == place
    placeless = ACCEPTED if number in PLACES | {2} else UNSUPPORTED_FRAME
    assert answer(order(178, 1.0, 5.0, frame=number)) == placeless


ACCEPTED_ITEMS: Final = {
    "takeoff with place and yaw": item(22, 0.0, 0.0, 0.0, 45.0),
    "takeoff here": item(22, 0.0, 0.0, 0.0, NAN, x=INT32_MAX, y=INT32_MAX),
    "waypoint": item(16, 3.0, 2.0, 0.0, 90.0),
    "unset is NaN or 0": item(16, NAN, NAN, NAN, NAN),
    "loiter unlimited": item(17),
    "loiter turns": item(18, 2.0, 0.0, 15.0),
    "loiter time": item(19, 5.0),
    "return": order(20),
    "return with coordinates": item(20),
    "below home": item(16, z=-60.0),
    "land": item(21, 0.0, 0.0, 0.0, NAN, z=0.0),
    "land here": item(21, 0.0, 0.0, 0.0, NAN, x=INT32_MAX, y=-0x80000000, z=0.0),
    "spline": item(82),
    "delay": order(93, 5.0),
    "delay with an unset clock": order(93, 5.0, -1.0, -1.0, -1.0),
    "delay until near": order(114, 5.0),
    "delay between waypoints": order(112, 5.0),
    "yaw": order(115, 90.0, 0.0, 1.0, 0.0),
    "speed": order(178, 1.0, 5.0, -1.0),
    "home": item(179),
    "home here": order(179, 1.0),
    "look there": item(195),
    "look ahead": order(197),
    "look there, formerly": item(201, 3.0),
    "photo by distance": order(206, 25.0),
    "photos": order(2000, 0.0, 2.0, 3.0, 0.0),
    "one photo": order(2000, 0.0, 0.0, 1.0, 0.0),
    "no more photos": order(2001),
    "video": order(2500),
    "no more video": order(2501),
    "gimbal angles": order(1000, -45.0, 0.0, NAN, NAN),
    "gimbal control": order(1001, -2.0, 0.0, -1.0, -1.0),
    "mount angles": order(205, -45.0, z=2.0),
}


@pytest.mark.parametrize("one", ACCEPTED_ITEMS.values(), ids=ACCEPTED_ITEMS.keys())
def test_what_the_vehicle_flies_is_accepted(one: Message) -> None:
    assert answer(one) == ACCEPTED


REFUSED_ITEMS: Final = [
    (item(16, 0.0, 0.0, 1.0), P3),
    (item(16, -1.0), P1),
    (item(16, 0.0, -1.0), P2),
    (item(16, x=INT32_MAX), P5),
    (item(16, y=INT32_MAX), P6),
    (item(16, z=NAN), P7),
    (item(16, z=-101.0), P7),
    (item(16, math.inf), P1),
    (item(16, 0.0, 0.0, 0.0, -math.inf), P4),
    (item(16, x=900_000_001), P5),
    (item(16, y=-1_800_000_001), P6),
    (item(16, x=410_000_000), P5),
    (item(22, 0.0, 1.0), P2),
    (item(22, 0.0, 0.0, 1.0), P3),
    (item(22, z=0.5), P7),
    (item(21, 0.0, 0.0, 1.0), P3),
    (order(20, 1.0), P1),
    (order(93, 5.0, x=42), P5),
    (order(93, 5.0, y=42), P6),
    (order(93, -1.0), P1),
    (order(178, 7.0, 5.0), P1),
    (order(178, 1.0, 0.0), P2),
    (order(178, 1.0, 5.0, 50.0), P3),
    (order(178, 1.0, 5.0, -1.0, 1.0), P4),
    (order(177, 5.0, 1.0), P1),
    (item(18, 0.0), P1),
    (item(18, 1.0, 1.0), P2),
    (order(115, 720.0), P1),
    (order(115, 90.0, 0.0, 2.0), P3),
    (order(197, 0.0, 1.0), P2),
    (order(2000, 0.0, 1.0, 2.0, 0.0, x=5), P5),
]


@pytest.mark.parametrize(("one", "result"), REFUSED_ITEMS)
def test_a_parameter_that_cannot_be_honoured_is_named(one: Message, result: int) -> None:
    assert answer(one) == result


@pytest.mark.parametrize(
    "command", [0, 32, 33, 34, 84, 192, 193, 400, 2004, 2005, 2800, 5001, 65535]
)
def test_what_the_vehicle_does_not_fly_is_unsupported(command: int) -> None:
    assert answer(order(command)) == UNSUPPORTED


def test_a_fault_is_answered_at_its_item_and_not_at_the_last() -> None:
    plan = [item(16) for _ in range(20)]
    plan[7].param3 = 1.0
    assert Uploader().upload(plan) == (P3, 8)


def test_a_fault_of_the_whole_plan_is_answered_when_it_is_complete() -> None:
    assert Uploader().upload([item(16), item(22), item(16)]) == (INVALID, 3)
    assert Uploader().upload([item(16), order(177, 9.0, 1.0), item(16)]) == (P1, 3)
    assert Uploader().upload([item(16), item(16), order(177, 0.0, 3.0)]) == (ACCEPTED, 3)


def test_a_fence_of_every_kind_of_area_is_accepted() -> None:
    triangle = [vertex(corner=corner) for corner in range(3)]
    hole = [vertex(corner=corner, command=5002) for corner in range(3)]
    circles = [item(kind, 30.0, mission_type=FENCE, z=0.0) for kind in (5003, 5004)]
    back = item(5000, mission_type=FENCE, z=0.0)
    assert answer(*triangle, *hole, *circles, back) == ACCEPTED


@pytest.mark.parametrize(
    ("fence", "result"),
    [([item(5003, radius, mission_type=FENCE)], P1) for radius in (NAN, 0.0, -5.0, 0.1, math.inf)]
    + [
        ([vertex(corner=c, count=count) for c in range(3)], P1)
        for count in (0.0, 2.0, -3.0, NAN, 3.5, 4.0)
    ]
    + [
        ([vertex(corner=0), vertex(corner=1), vertex(corner=2, command=5002)], P1),
        ([vertex(corner=0), vertex(corner=1), vertex(corner=2, count=4.0)], P1),
        ([vertex(corner=0), vertex(corner=1)], P1),
        ([vertex(corner=0) for _ in range(3)], INVALID),
        ([vertex(corner=c, param2=1.0) for c in range(3)], P2),
        ([vertex(corner=c, x=INT32_MAX) for c in range(3)], P5),
        ([item(5000, mission_type=FENCE), item(5000, mission_type=FENCE)], INVALID),
        ([item(5000, 1.0, mission_type=FENCE)], P1),
        ([item(16, mission_type=FENCE)], UNSUPPORTED),
        ([item(5100, mission_type=FENCE)], UNSUPPORTED),
        ([item(5100, mission_type=RALLY, y=INT32_MAX)], P6),
        ([item(5100, mission_type=RALLY, z=NAN)], P7),
        ([item(5100, 1.0, mission_type=RALLY)], P1),
        ([item(5003, 30.0, mission_type=RALLY)], UNSUPPORTED),
    ],
)
def test_a_faulty_fence_or_rally_point_is_refused(fence: list[Message], result: int) -> None:
    assert answer(*fence) == result


def test_the_deprecated_float_item_is_judged_alike() -> None:
    def old(**fields: Any) -> Message:
        values = item(16, **fields).to_dict()
        del values["mavpackettype"]
        return common.MAVLink_mission_item_message(**{**values, "x": 40.4434, "y": -3.7382})

    assert answer(old()) == ACCEPTED
    assert answer(old(frame=3)) == ACCEPTED
    assert answer(old(param3=1.0)) == P3
    assert answer(old(frame=1)) == UNSUPPORTED_FRAME


def test_three_plans_are_uploaded_at_once() -> None:
    uploader = Uploader()
    plans = {
        MISSION: [item(16) for _ in range(3)],
        FENCE: [vertex(corner=corner) for corner in range(3)],
        RALLY: [item(5100, mission_type=RALLY) for _ in range(3)],
    }
    for kind in plans:
        uploader.send(common.MAVLink_mission_count_message(1, 1, 3, kind))
    answers: list[Message] = []
    for seq in range(3):
        for plan in plans.values():
            plan[seq].seq = seq
            answers = uploader.send(plan[seq]) if seq < 2 else answers + uploader.send(plan[seq])
    acks = {m.mission_type: m.type for m in answers if m.get_type() == "MISSION_ACK"}
    assert acks == dict.fromkeys(plans, ACCEPTED)
