"""Events over HTTP: before missions, expire after seconds, end once."""

import threading
from datetime import UTC, datetime
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from edge_server.app import context_of, create_app
from edge_server.services.fleet import broker_work, events
from edge_server.services.fleet.event_states import State
from edge_server.store.rows import work
from tests.unit.edge_server.conftest import NOON, Clock, Edge
from tests.unit.edge_server.documents import event, mission, mission_report, plan, speed_event

PAUSE, RESUME, RETURN_HOME = 101, 102, 103
POINT = {"latitude": 40.4434, "longitude": -3.7382, "altitude": 5.0}


def at(epoch_s: float) -> str:
    return datetime.fromtimestamp(epoch_s, UTC).isoformat().replace("+00:00", "Z")


def fly(edge: Edge, mission_id: int = 1201, vehicle_id: int = 1) -> None:
    """Have the broker at work on a mission."""
    answer = edge.post_plan(plan(mission(mission_id, vehicle_id)))
    assert answer.status_code == 201
    edge.acknowledge(edge.work()[-1]["id"], "accepted")


def send(edge: Edge, body: Any = None, role: str = "operator") -> Any:
    answer = edge.post("/events/", event() if body is None else body, role)
    assert answer.status_code == 201, answer.json
    return answer.json


def state(edge: Edge, identifier: int = 1) -> str:
    return str(edge.get(f"/events/{identifier}")["state"])


def refused(edge: Edge, body: Any, status: int) -> Any:
    answer = edge.post("/events/", body, "operator")
    assert answer.status_code == status
    assert edge.get("/events/") == []
    return answer.json


def test_an_event_is_kept_and_shown(edge: Edge) -> None:
    fly(edge)
    answer = edge.post("/event", {"event": event(abort=POINT)}, "cloud")
    assert answer.status_code == 201
    assert answer.headers["Location"] == "/events/1/"
    assert answer.json == {
        "id": 1,
        **event(abort=POINT),
        "event_type_name": "ABORT_MISSION",
        "received_at": "2026-11-21T12:00:00Z",
        "expires_at": "2026-11-21T12:00:10Z",
        "state": "queued",
    }
    assert edge.get("/events/1") == answer.json
    assert edge.get("/events/") == [answer.json]


@pytest.mark.thorough
def test_an_event_comes_before_the_missions_that_wait(edge: Edge) -> None:
    for number in range(3):
        edge.post_plan(plan(mission(1201 + number, 2)))
    fly(edge)
    send(edge, speed_event())
    first = edge.work()[0]
    assert first["kind"] == "event"
    assert first["event"]["maximum_speed"] == 2.5
    assert first["event"]["expires_at"] == first["expires_at"]
    kinds = [item["kind"] for item in edge.work()]
    assert kinds == ["event", "mission", "mission", "mission", "mission"]


def test_an_event_behind_a_full_page_comes_at_once_too(
    edge: Edge, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(broker_work, "PAGE", 2)
    for number in range(3):
        edge.post_plan(plan(mission(1201 + number, 2)))
    fly(edge)
    send(edge, speed_event())
    seen = edge.get("/broker/commands?after=0", "broker")
    assert [item["kind"] for item in seen["commands"]] == ["event", "mission", "mission"]
    rest = []
    while edge.work(seen["cursor"]):
        seen = edge.get(f"/broker/commands?after={seen['cursor']}", "broker")
        rest += [item["kind"] for item in seen["commands"] if item["kind"] == "mission"]
    assert rest == ["mission", "mission"]


def test_a_waiting_broker_is_woken(edge: Edge) -> None:
    fly(edge)
    cursor = edge.get("/broker/commands?after=0", "broker")["cursor"]
    answers: list[Any] = []
    thread = threading.Thread(
        target=lambda: answers.append(broker_work.poll(edge.context, cursor, 25.0, "broker/broker"))
    )
    thread.start()
    send(edge)
    thread.join(20.0)
    assert [item["kind"] for item in answers[0]["commands"]] == ["event"]


@pytest.mark.first_case
@pytest.mark.parametrize("state_sent", ["accepted", "done", "refused"])
def test_the_acknowledged_state_is_shown(edge: Edge, state_sent: str) -> None:
    fly(edge)
    send(edge)
    number = edge.work()[0]["id"]
    for _ in range(2):
        assert edge.acknowledge(number, state_sent, "why").status_code == 200
    assert state(edge) == state_sent
    assert edge.get("/events/1")["message"] == "why"


@pytest.mark.thorough
def test_an_accepted_event_may_take_its_time(edge: Edge) -> None:
    fly(edge)
    send(edge, event(2))
    number = edge.work()[0]["id"]
    edge.acknowledge(number, "accepted")
    edge.clock.pass_s(60)
    again = edge.work()[0]
    assert (again["id"], again["kind"], again["state"]) == (number, "event", "accepted")
    assert edge.acknowledge(number, "done").status_code == 200
    assert state(edge) == "done"
    assert [item["kind"] for item in edge.work()] == ["mission"]


@pytest.mark.parametrize("away_s", [events.RESULT_TIMEOUT_S, 86_400.0])
def test_an_accepted_event_is_handed_out_until_its_end_is_reported(
    edge: Edge, away_s: float
) -> None:
    """The broker's machine was away for longer than any flight takes: it has to report the end."""
    fly(edge)
    send(edge, event(2))
    number = edge.work()[0]["id"]
    edge.acknowledge(number, "accepted")
    edge.clock.pass_s(events.LIFETIME_S + away_s)
    assert [item["kind"] for item in edge.work()] == ["event", "mission"]
    assert edge.acknowledge(number, "refused").status_code == 200
    assert [item["kind"] for item in edge.work()] == ["mission"]
    assert state(edge) == "refused"


@pytest.mark.parametrize("is_accepted", [True, False])
@pytest.mark.parametrize("back_s", [60.0, 3600.0, 90_000.0])
def test_an_event_goes_on_when_the_clock_is_set_back(
    edge: Edge, back_s: float, *, is_accepted: bool
) -> None:
    fly(edge)
    send(edge)
    number = edge.work()[0]["id"]
    if is_accepted:
        assert edge.acknowledge(number, "accepted").status_code == 200
    edge.clock.pass_s(4.0)
    edge.clock.now -= back_s
    assert [item["id"] for item in edge.work() if item["kind"] == "event"] == [number]
    assert state(edge) == ("accepted" if is_accepted else "queued")
    for status in ("accepted", "done"):
        assert edge.acknowledge(number, status).status_code == 200
    assert state(edge) == "done"


def test_an_event_does_not_live_longer_when_the_clock_is_set_back(edge: Edge) -> None:
    fly(edge)
    send(edge)
    edge.clock.pass_s(events.LIFETIME_S - 5.0)
    edge.clock.now -= 3600.0
    assert [item["kind"] for item in edge.work()] == ["event", "mission"]
    edge.clock.pass_s(5.5)
    assert [item["kind"] for item in edge.work()] == ["mission"]
    assert state(edge) == "expired"


@pytest.mark.parametrize("is_accepted", [True, False])
def test_a_restart_behind_a_clock_that_was_set_back(edge: Edge, *, is_accepted: bool) -> None:
    """An order that may be of any age is not begun; one that was accepted comes to its end."""
    fly(edge)
    send(edge)
    number = edge.work()[0]["id"]
    if is_accepted:
        edge.acknowledge(number, "accepted")
    clock = Clock(NOON - 3600.0)
    app = create_app(edge.config, clock=clock, monotonic=clock.monotonic)
    again = Edge(app.test_client(), context_of(app), clock)
    handed_out = [item["id"] for item in again.work() if item["kind"] == "event"]
    assert handed_out == ([number] if is_accepted else [])
    if is_accepted:
        assert again.acknowledge(number, "done").status_code == 200
        assert state(again) == "done"
    else:
        assert again.get("/events/1")["message"] == broker_work.AGE_UNKNOWN
        assert again.acknowledge(number, "accepted").status_code == 409
    again.context.close()


def test_an_accepted_event_is_handed_out_with_later_work_behind_a_clock_that_was_set_back(
    edge: Edge,
) -> None:
    """A restarted broker reads on behind the last that it got: what is left out is never read."""
    fly(edge)
    send(edge)
    number = edge.work()[0]["id"]
    edge.acknowledge(number, "accepted")
    fly(edge, 1202)
    edge.clock.now -= 3600.0
    with edge.context.database.read() as connection:
        live = work.live_events(connection, edge.clock.now)
    assert [item.id for item in live] == [number]


def test_a_speed_that_is_done_stays_with_its_mission(edge: Edge) -> None:
    fly(edge)
    fly(edge, 1202)
    before = [item["mission"]["maximum_speed"] for item in edge.work()]
    send(edge, speed_event(maximum_speed=2.5))
    number = edge.work()[0]["id"]
    edge.acknowledge(number, "accepted")
    assert [item["mission"]["maximum_speed"] for item in edge.work()[1:]] == before
    edge.acknowledge(number, "done")
    assert [item["mission"]["maximum_speed"] for item in edge.work()] == [2.5, before[1]]
    assert edge.get("/plans/1")["missions"][0]["maximum_speed"] == before[0]


def test_a_speed_of_an_earlier_flight_is_not_the_next_ones(edge: Edge) -> None:
    fly(edge)
    send(edge, speed_event(maximum_speed=2.5))
    edge.acknowledge(edge.work()[0]["id"], "done")
    assert edge.post("/mission_report/", mission_report(3, 3, 3, 3), "broker").status_code == 201
    fly(edge)
    (item,) = edge.work()
    assert item["mission"]["maximum_speed"] == mission(1201)["maximum_speed"]


def test_an_end_is_for_good(edge: Edge) -> None:
    fly(edge)
    send(edge)
    number = edge.work()[0]["id"]
    edge.acknowledge(number, "refused", "not here")
    for state_sent in ("accepted", "done"):
        assert edge.acknowledge(number, state_sent).status_code == 409
    assert state(edge) == "refused"


@pytest.mark.thorough
def test_an_unaccepted_event_expires(edge: Edge) -> None:
    fly(edge)
    send(edge)
    number = edge.work()[0]["id"]
    edge.clock.pass_s(10.0)
    assert [item["kind"] for item in edge.work()] == ["mission"]
    assert state(edge) == "expired"
    for state_sent in ("accepted", "done", "refused"):
        assert edge.acknowledge(number, state_sent).status_code == 409
    assert state(edge) == "expired"


def test_a_shorter_life_counts_and_a_longer_one_does_not(edge: Edge) -> None:
    fly(edge)
    assert send(edge, event(expires_at=at(NOON + 3)))["expires_at"] == at(NOON + 3)
    assert send(edge, event(expires_at=at(NOON + 999)))["expires_at"] == at(NOON + 10)


@pytest.mark.thorough
@settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],  # Each example leaves nothing
)
@given(life_s=st.floats(0.1, 20), age_s=st.floats(-20, 20), accepted=st.booleans())
def test_nothing_stale_is_handed_out(
    stale_edge: Edge, life_s: float, age_s: float, *, accepted: bool
) -> None:
    """Whatever the age, the life and the clock: one that is set back leaves its age as it is."""
    edge = stale_edge
    edge.clock.now = NOON
    given_life_s = min(life_s, events.LIFETIME_S)
    sent = send(edge, event(expires_at=at(NOON + life_s)))
    (item,) = edge.work()
    if accepted:
        edge.acknowledge(item["id"], "accepted")
    edge.clock.now = NOON + age_s
    given_life_s += events.RESULT_TIMEOUT_S if accepted else 0.0
    alive = [item["id"]] if age_s < given_life_s - 0.001 else []
    if abs(age_s - given_life_s) > 0.001:
        assert [one["id"] for one in edge.work()] == alive
    edge.clock.now = NOON
    edge.acknowledge(item["id"], "done")
    assert edge.ask("DELETE", f"/events/{sent['id']}", "admin").status_code == 204


@pytest.fixture
def stale_edge(edge: Edge) -> Edge:
    """Vehicle 1 reports that it flies, without a mission."""
    state = {"link_state": "connected", "armed": True}
    edge.ask("PUT", "/vehicles/1", "broker", json=state)
    return edge


def test_a_restarted_server_hands_out_nothing_stale(edge: Edge) -> None:
    fly(edge)
    send(edge)
    app = create_app(edge.config, clock=Clock(NOON + 11))
    again = Edge(app.test_client(), context_of(app), Clock(NOON + 11))
    assert [item["kind"] for item in again.work()] == ["mission"]
    assert state(again) == "expired"
    again.context.database.close()


@pytest.mark.thorough
def test_an_abort_empties_the_queue(edge: Edge) -> None:
    fly(edge, 1)
    edge.post_plan(plan(mission(2)))
    edge.post_plan(plan(mission(3, vehicle_id=2)))
    edge.post_plan(plan(mission(4), dispatch=False))
    send(edge)
    ends = [one["missions"][0]["mission_status_name"] for one in edge.get("/plans/")]
    assert ends == ["NOT_STARTED", "ABORTED", "NOT_STARTED", "NOT_STARTED"]
    assert edge.get("/plans/2")["missions"][0]["message"] == "aborted by event 1"
    (report,) = edge.get("/mission_report/")
    assert (report["mission_id"], report["mission_status_id"]) == (2, 5)


def test_a_new_speed_empties_no_queue(edge: Edge) -> None:
    fly(edge, 1)
    edge.post_plan(plan(mission(2)))
    send(edge, speed_event())
    assert edge.get("/plans/2")["plan_status_name"] == "NOT_STARTED"


@pytest.mark.parametrize("kind", [PAUSE, RESUME])
def test_a_pause_or_resume_empties_no_queue(edge: Edge, kind: int) -> None:
    fly(edge)
    edge.post_plan(plan(mission(1202)))
    assert send(edge, event(kind))["event_type_name"] in {"PAUSE_MISSION", "RESUME_MISSION"}
    assert [item["state"] for item in edge.work() if item["kind"] == "mission"] == [
        "accepted",
        "queued",
    ]


def test_a_return_home_empties_the_queue(edge: Edge) -> None:
    fly(edge)
    edge.post_plan(plan(mission(1202)))
    send(edge, event(RETURN_HOME))
    left = [item["mission"]["mission_id"] for item in edge.work() if item["kind"] == "mission"]
    assert left == [1201]


def test_a_farmer_may_stop_a_mission_and_not_make_it_fly_on(edge: Edge) -> None:
    fly(edge)
    for kind in (PAUSE, RETURN_HOME):
        assert send(edge, event(kind), "farmer")["state"] == "queued"
    answer = edge.post("/events/", event(RESUME), "farmer")
    assert answer.status_code == 403
    assert "not resume it" in answer.get_data(as_text=True)


def test_an_unknown_vehicle_is_not_found(edge: Edge) -> None:
    answer = refused(edge, event(vehicle_id=77), 404)
    assert "vehicle_id" in answer["detail"]["json"]


@pytest.mark.first_case
@pytest.mark.parametrize("body", [event(), event(2), speed_event()])
def test_an_idle_vehicle_has_nothing_to_interrupt(edge: Edge, body: Any) -> None:
    answer = refused(edge, body, 409)
    assert [error["name"] for error in answer["errors"]] == ["NO_ACTIVE_MISSION"]


def test_a_finished_mission_leaves_the_vehicle_idle(edge: Edge) -> None:
    fly(edge)
    edge.report("mission_report", mission_report(3, 3, 3, 3))
    refused(edge, event(), 409)


@pytest.mark.first_case
@pytest.mark.parametrize("kind", [1, RETURN_HOME])
def test_an_event_that_is_carried_out_can_be_replaced(edge: Edge, kind: int) -> None:
    """The mission has ended with it, and where the vehicle is may not be known."""
    fly(edge)
    send(edge, event(RETURN_HOME))
    (first,) = [item["id"] for item in edge.work() if item["kind"] == "event"]
    assert edge.acknowledge(first, "accepted").status_code == 200
    edge.report("mission_report", mission_report(4, 4, 4, 4))
    assert send(edge, event(kind))["state"] == "queued"
    for identifier in [item["id"] for item in edge.work() if item["kind"] == "event"]:
        assert edge.acknowledge(identifier, "done").status_code == 200
    assert edge.post("/events/", event(kind), "operator").status_code == 409


def test_an_event_whose_end_was_never_reported_shows_no_flight_for_ever(edge: Edge) -> None:
    fly(edge)
    send(edge, event(RETURN_HOME))
    (work,) = [item["id"] for item in edge.work() if item["kind"] == "event"]
    assert edge.acknowledge(work, "accepted").status_code == 200
    edge.report("mission_report", mission_report(4, 4, 4, 4))
    edge.clock.pass_s(events.LIFETIME_S + events.RESULT_TIMEOUT_S + 1.0)
    assert edge.post("/events/", event(1), "operator").status_code == 409


@pytest.mark.first_case
@pytest.mark.parametrize("reported", [{"armed": True}, {"mission_id": 7}])
def test_a_flight_that_only_the_vehicle_knows_can_be_aborted(
    edge: Edge, reported: dict[str, Any]
) -> None:
    edge.ask("PUT", "/vehicles/1", "broker", json={"link_state": "connected", **reported})
    assert send(edge)["state"] == "queued"


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("body", "field"),
    [
        (event(4), "event_type_id"),
        (event(True), "event_type_id"),
        (event(3), "maximum_speed"),
        (event(1, maximum_speed=2.0), "maximum_speed"),
        (speed_event(12.5), "maximum_speed"),
        (speed_event(0.0), "maximum_speed"),
        (speed_event(abort=POINT), "abort"),
        (event(PAUSE, abort=POINT), "abort"),
        (event(RETURN_HOME, abort=POINT), "abort"),
        (event(PAUSE, maximum_speed=2.0), "maximum_speed"),
        (event(100), "event_type_id"),
        (event(104), "event_type_id"),
        (event(abort={"latitude": 40.0}), "abort.longitude"),
        (event(abort=POINT | {"altitude": 121}), "abort.altitude"),
        (event(expires_at=at(NOON)), "expires_at"),
        (event(expires_at="soon"), "expires_at"),
        (event(colour="red"), "colour"),
    ],
)
def test_a_bad_event_is_refused_by_field(edge: Edge, body: Any, field: str) -> None:
    fly(edge)
    assert field in refused(edge, body, 422)["detail"]["json"]


def test_other_systems_spelling_is_read(edge: Edge) -> None:
    fly(edge)
    old = {"sequence_number": 1, "vethicle_id": 1, "event_type_id": 1, "param_array": [0, 0, 0]}
    assert "abort" not in send(edge, {"even": old})


@pytest.mark.thorough
def test_a_repeated_event_is_one_event(edge: Edge) -> None:
    fly(edge)
    first: Any = edge.post("/events/", event(), "farmer", key="one").json
    edge.clock.pass_s(20)
    answer = edge.post("/events/", event(), "farmer", key="one")
    again: Any = answer.json
    assert (answer.status_code, again["id"]) == (201, first["id"])
    assert again == first, "a repeated POST gets its first answer"
    assert edge.get(f"/events/{first['id']}")["state"] == "expired"
    assert edge.post("/events/", event(2), "farmer", key="one").status_code == 422


@pytest.mark.thorough
def test_events_are_bounded(edge: Edge) -> None:
    fly(edge)
    for _ in range(events.EVENT_LIMIT):
        send(edge)
    answer = edge.post("/events/", event(), "operator")
    assert answer.status_code == 429
    assert answer.headers["Retry-After"] == "1"


def test_a_replaced_event_is_new_work_with_a_new_life(edge: Edge) -> None:
    fly(edge)
    send(edge)
    old = edge.work()[0]["id"]
    edge.clock.pass_s(8)
    answer = edge.ask("PUT", "/events/1", "operator", json=event(2, abort=POINT))
    assert answer.status_code == 200
    assert (answer.json or {})["expires_at"] == at(NOON + 18)
    assert edge.acknowledge(old, "accepted").status_code == 404
    (new,) = [item for item in edge.work(old) if item["kind"] == "event"]
    assert new["event"]["abort"] == POINT


def test_the_tag_of_an_event_guards_it(edge: Edge) -> None:
    fly(edge)
    send(edge)
    tag = edge.ask("GET", "/events/1", "operator").headers["ETag"]
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    changed = edge.ask("PUT", "/events/1", "operator", json=event(), headers={"If-Match": tag})
    assert changed.status_code == 412


def test_only_a_waiting_event_is_replaced_and_for_the_same_vehicle(edge: Edge) -> None:
    fly(edge)
    send(edge)
    other = edge.ask("PUT", "/events/1", "operator", json=event(vehicle_id=2))
    assert other.status_code == 409
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    assert edge.ask("PUT", "/events/1", "operator", json=event()).status_code == 409
    assert edge.ask("PUT", "/events/9", "operator", json=event()).status_code == 404


def test_a_cancelled_event_is_not_handed_out(edge: Edge) -> None:
    fly(edge)
    send(edge)
    number = edge.work()[0]["id"]
    assert edge.ask("DELETE", "/events/1", "operator").status_code == 204
    assert [item["kind"] for item in edge.work()] == ["mission"]
    assert edge.acknowledge(number, "accepted").status_code == 404
    assert edge.ask("GET", "/events/1", "operator").status_code == 404


def test_an_event_under_way_is_not_deleted(edge: Edge) -> None:
    fly(edge)
    send(edge)
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    assert edge.ask("DELETE", "/events/1", "operator").status_code == 409
    edge.acknowledge(edge.work()[0]["id"], "done")
    assert edge.ask("DELETE", "/events/1", "operator").status_code == 204


def test_an_event_that_the_broker_never_ended_can_go_in_the_end(edge: Edge) -> None:
    fly(edge)
    send(edge)
    edge.acknowledge(edge.work()[0]["id"], "accepted")
    edge.clock.pass_s(events.LIFETIME_S + events.RESULT_TIMEOUT_S - 1)
    assert edge.ask("DELETE", "/events/1", "operator").status_code == 409
    edge.clock.pass_s(2)
    assert edge.ask("DELETE", "/events/1", "operator").status_code == 204


def test_lists_are_filtered_and_continued(edge: Edge) -> None:
    fly(edge)
    fly(edge, 1301, 2)
    send(edge)
    edge.clock.pass_s(5)
    send(edge, event(vehicle_id=2))
    send(edge)
    assert [one["id"] for one in edge.get("/events/?vehicle_id=1")] == [1, 3]
    assert [one["id"] for one in edge.get(f"/events/?since={NOON + 5:.0f}")] == [2, 3]
    assert [one["id"] for one in edge.get("/events/?after=1&limit=1")] == [2]


def test_every_state_is_in_the_contract(edge: Edge) -> None:
    schemas = edge.get("/openapi.json")["components"]["schemas"]
    schema = schemas["StoredEvent"]
    name = schema["properties"]["state"]["$ref"].rpartition("/")[2]
    assert schemas[name]["enum"] == [one.value for one in State]
    fly(edge)
    assert set(schema["required"]) <= set(send(edge)) <= set(schema["properties"])
