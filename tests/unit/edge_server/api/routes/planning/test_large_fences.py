"""A geofence has a bounded size, and its check does not delay other requests."""

from collections.abc import Iterator, Sequence
from threading import Event, Thread
from typing import Any

import pytest

from afarcloud import rules
from afarcloud.fence_check import FenceCheck, FenceFault
from afarcloud.plan import Plan
from afarcloud.rules import FenceVerdict
from tests.unit.edge_server.conftest import Edge
from tests.unit.edge_server.documents import mission, plan, telemetry

TRIANGLE = [[40.45, -3.73], [40.45, -3.729], [40.451, -3.729]]


def ring(corners: int) -> list[list[float]]:
    """A thin area far from the mission."""
    east = [[40.46, -3.74 + number * 1e-5] for number in range(corners - 1)]
    return [*east, [40.47, -3.74]]


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("fence", "field", "text"),
    [
        ({"exclusion": [TRIANGLE] * 65}, "exclusion", "65 polygons, at most 64"),
        ({"inclusion": [TRIANGLE] * 65}, "inclusion", "65 polygons, at most 64"),
        ({"inclusion": [TRIANGLE], "exclusion": [TRIANGLE] * 64}, "exclusion", "65 polygons"),
        ({"exclusion": [ring(1000), ring(998), TRIANGLE]}, "exclusion", "2001 corners"),
    ],
)
def test_a_fence_that_is_too_large_is_refused_by_its_field(
    edge: Edge, fence: dict[str, Any], field: str, text: str
) -> None:
    answer = edge.post_plan(plan(geofence=fence))
    assert answer.status_code == 422
    ((path, faults),) = (answer.json or {})["detail"]["json"].items()
    assert path == f"geofence.{field}"
    assert text in str(faults)


@pytest.mark.first_case
@pytest.mark.parametrize("exclusion", [[TRIANGLE] * 64, [ring(1000), ring(1000)]])
def test_a_fence_of_the_largest_size_is_kept(edge: Edge, exclusion: list[Any]) -> None:
    assert edge.post_plan(plan(geofence={"exclusion": exclusion})).status_code == 201


@pytest.mark.first_case
@pytest.mark.parametrize("way", ["post", "put", "dispatch"])
def test_an_alarm_is_taken_while_a_plan_is_judged(
    edge: Edge, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    body = plan(mission(1), geofence={"exclusion": [TRIANGLE]}, dispatch=False)
    stored = edge.post_plan(body).json or {}
    path = f"/plans/{stored['id']}"
    taken: list[int] = []
    law = FenceCheck.faults

    def slow(self: FenceCheck, commands: Sequence[Any], **known: Any) -> Iterator[FenceFault]:
        alarm = Thread(
            target=lambda: taken.append(
                edge.report("alarm", telemetry("alarm", vehicle_id=2)).status_code
            ),
            daemon=True,
        )
        alarm.start()
        alarm.join(timeout=3.0)
        taken.append(0)  # Behind the alarm if that was taken, or else before it
        return law(self, commands, **known)

    monkeypatch.setattr(FenceCheck, "faults", slow)
    answer = {
        "post": lambda: edge.post_plan(plan(mission(2), geofence=body["plan"]["geofence"])),
        "put": lambda: edge.ask("PUT", path, "operator", json=body),
        "dispatch": lambda: edge.post(f"{path}/dispatch", {}, "operator"),
    }[way]()
    assert answer.status_code in {200, 201}
    assert taken == [201, 0]


@pytest.mark.thorough
def test_plans_are_judged_one_at_a_time(edge: Edge, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many are posted at once, half of the interpreter is left to an abort."""
    law = rules.check_fence
    at_once: list[int] = []
    judged: list[int] = []
    let_go = Event()

    def slow(judged_plan: Plan) -> FenceVerdict:
        at_once.append(1)
        judged.append(len(at_once))
        let_go.wait(0.2)
        at_once.pop()
        return law(judged_plan)

    monkeypatch.setattr(rules, "check_fence", slow)
    bodies = [plan(mission(n), geofence={"exclusion": [TRIANGLE]}) for n in range(4)]
    posts = [Thread(target=edge.post_plan, args=(body,)) for body in bodies]
    for post in posts:
        post.start()
    for post in posts:
        post.join()
    assert judged == [1, 1, 1, 1]
