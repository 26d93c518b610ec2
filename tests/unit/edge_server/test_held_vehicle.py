"""The broker beside the real edge server, in simulated time: a fault holds the vehicle's queue."""

from collections.abc import Callable

import pytest

from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.wire import AcceptanceResult
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.autopilot_families import SLOW_PX4
from tests.support.broker_world import World, first_flight
from tests.support.fake_edge import FakeEdge
from tests.unit.edge_server.conftest import Edge

LOOK_EVERY_S = 0.5


class RealEdge(FakeEdge):
    """Passes everything on to an edge server, under the broker's key and by the world's clock."""

    def __init__(self, edge: Edge) -> None:
        super().__init__()
        self.real = edge
        self.world: World | None = None
        self._cursor = 0
        self._look_at = 0.0
        self._answers: list[AcceptanceResult] = []
        self.fails_acceptances = False

    def take_work(self) -> list[dict[str, object]]:
        assert self.world is not None
        self.real.clock.now = self.world.clock.utc().timestamp()
        if self.world.clock.now < self._look_at:
            return []
        self._look_at = self.world.clock.now + LOOK_EVERY_S
        answer = self.real.get(f"/broker/commands?after={self._cursor}", "broker")
        self._cursor = answer["cursor"]
        return list(answer["commands"])

    def take_acceptance_results(self) -> list[AcceptanceResult]:
        answers, self._answers = self._answers, []
        return answers

    def post(self, post: Post) -> None:
        if self.fails_acceptances and post.accepted_work_id is not None:
            failed = AcceptanceResult(post.accepted_work_id, False, "HTTP 500", has_failed=True)
            self._answers.append(failed)
            return
        headers = {"Idempotency-Key": post.idempotency_key} if post.idempotency_key else {}
        answer = self.real.ask(post.method, post.path, "broker", json=post.body, headers=headers)
        self.posts.append(post)
        if post.accepted_work_id is not None:
            holds = answer.status_code == 200
            self._answers.append(
                AcceptanceResult(post.accepted_work_id, is_confirmed=holds, reason=answer.text)
            )
        elif post.path == "/mission_report/":
            assert answer.status_code == 201, answer.json


def status(edge: Edge, plan: int) -> str:
    (mission,) = edge.get(f"/plans/{plan}")["missions"]
    return str(mission["mission_status_name"])


def run_until(world: World, condition: Callable[[], bool]) -> None:
    """Let time pass until the edge server shows something; it is looked at once a second."""
    for _ in range(240):
        if condition():
            return
        world.run(1.0)
    pytest.fail("it does not come")


@pytest.mark.thorough
def test_a_mission_whose_acceptance_fails_has_failed_and_the_next_one_flies(
    edge: Edge,
) -> None:
    world = World()
    real = RealEdge(edge)
    real.world = world
    real.fails_acceptances = True
    world.edge = real
    world.start_broker()
    world.add_vehicle()
    world.run(5.0)
    assert edge.post_plan({"plan": {"missions": [first_flight(1)]}}).status_code == 201
    run_until(world, lambda: status(edge, 1) == "FAILED")
    real.fails_acceptances = False
    assert edge.post_plan({"plan": {"missions": [first_flight(2)]}}).status_code == 201
    run_until(world, lambda: status(edge, 2) == "FINISHED")
    assert status(edge, 1) == "FAILED"


@pytest.mark.thorough
def test_after_a_fault_in_flight_nothing_flies_until_an_operator_releases(
    edge: Edge, caplog: pytest.LogCaptureFixture
) -> None:
    world = World()
    real = RealEdge(edge)
    real.world = world
    world.edge = real
    world.start_broker()
    vehicle = world.add_vehicle(script=SLOW_PX4)
    world.run(5.0)
    for number in (1, 2):
        assert edge.post_plan({"plan": {"missions": [first_flight(number)]}}).status_code == 201
    run_until(world, lambda: vehicle.airborne and status(edge, 1) == "RUNNING")
    vehicle.ill = mavlink.MAV_SYS_STATUS_SENSOR_GPS
    run_until(world, lambda: status(edge, 1) == "FAILED")
    assert "GPS lost" in edge.get("/vehicles/1")["held"]["reason"]
    vehicle.ill = 0
    world.run_until(lambda: not vehicle.airborne)
    armed = vehicle.commands.count(mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
    world.run(20.0)
    assert vehicle.commands.count(mavlink.MAV_CMD_COMPONENT_ARM_DISARM) == armed
    assert not vehicle.airborne
    assert status(edge, 2) == "NOT_STARTED"
    (waiting,) = edge.get("/plans/2")["missions"]
    assert "GPS lost" in waiting["waiting"]
    assert "mission 2 is not flown" in caplog.text
    answer = edge.post("/vehicles/1/release", {"reason": "antenna fixed"}, "operator")
    assert answer.status_code == 200
    run_until(world, lambda: status(edge, 2) == "FINISHED")
