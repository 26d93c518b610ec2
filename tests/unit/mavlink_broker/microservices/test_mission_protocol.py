"""A vehicle of the old protocol, which sends MISSION_REQUEST and supports MISSION_ITEM only."""

from collections.abc import Sequence

import pytest

from mavlink_broker.autopilots.families import GENERIC
from mavlink_broker.mavlink.dialect import Message, MissionAck, MissionCount, mavlink
from mavlink_broker.mavlink.mission_item import hold, waypoint
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.mission_download import Different, MissionVerify, Verified
from mavlink_broker.microservices.mission_protocol import supports_only_float_items
from mavlink_broker.microservices.mission_upload import MissionUpload, Stored
from mavlink_broker.mission.exchanges import difference
from mavlink_broker.planning.mission import FlightPlan
from tests.unit.mavlink_broker.microservices.harness import ROUTE, received

FLOAT, INT = 1, 4  # MAV_PROTOCOL_CAPABILITY


class OldVehicle:
    """Its end of the mission protocol, over a perfect link."""

    def __init__(self) -> None:
        self.items: list[Message] = []
        self._count = 0

    def answer(self, message: Message) -> list[Message]:
        match message.get_type():
            case "MISSION_COUNT":
                self.items, self._count = [], message.count
                return [self._request()]
            case "MISSION_ITEM":
                self.items.append(message)
                return [self._request() if len(self.items) < self._count else MissionAck(0, 0, 0)]
            case "MISSION_REQUEST_LIST":
                return [MissionCount(0, 0, len(self.items))]
            case "MISSION_REQUEST":
                item = self.items[message.seq]
                item.target_system = item.target_component = 0
                return [item]
        return []

    def _request(self) -> Message:
        return mavlink.MAVLink_mission_request_message(0, 0, len(self.items))


def a_plan(north_deg: float = 0.0) -> FlightPlan:
    place = {"longitude_deg": -173.738251, "relative_altitude_m": 5.0}
    items = (
        waypoint(latitude_deg=40.4434567 + north_deg, **place),
        hold(latitude_deg=40.4434567 + north_deg, **place),
    )
    return FlightPlan(
        items=items,
        command_of_item=(0, 0),
        done_item=(0,),
        notes=((),),
        first_item=0,
        ends_on_ground=False,
    )


def run(activity: MissionUpload | MissionVerify, vehicle: OldVehicle) -> None:
    waiting = activity.start(0.0)
    while waiting and activity.outcome is None:
        answers = [a for m in waiting for a in vehicle.answer(received(m))]
        waiting = [m for a in answers for m in activity.receive(received(a), 0.1)]


def test_it_gets_its_mission_and_proves_it_to_the_precision_of_floats() -> None:
    vehicle, plan = OldVehicle(), a_plan()
    upload = MissionUpload(
        plan.messages(1, 1), ROUTE, RoundTrip(), busy_pause_s=6.0, as_floats=True
    )
    run(upload, vehicle)
    assert upload.outcome == Stored(0)
    assert verified(plan, vehicle) == Verified()
    elsewhere = Different("item 0 on the vehicle differs in latitude", count=2)
    assert verified(a_plan(3e-5), vehicle) == elsewhere


def verified(plan: FlightPlan, vehicle: OldVehicle) -> object:
    def compare(held: Sequence[Message]) -> str | None:
        return difference(plan, held, GENERIC)

    verify = MissionVerify(0, compare, ROUTE, RoundTrip(), as_floats=True)
    run(verify, vehicle)
    return verify.outcome


@pytest.mark.parametrize(
    ("capabilities", "expected"),
    [(0, False), (FLOAT, True), (INT, False), (FLOAT | INT, False), (1 << 14, False)],
)
def test_only_a_vehicle_that_reports_it_gets_float_items(capabilities: int, expected: bool) -> None:
    assert supports_only_float_items(capabilities) is expected
