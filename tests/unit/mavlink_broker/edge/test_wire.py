"""The edge server's JSON: work is parsed once, posts have a path, a lane and a key."""

from contextlib import suppress
from datetime import UTC, datetime, timedelta
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.state import Pose
from mavlink_broker.edge.outbox import Outbox, Post, Urgency
from mavlink_broker.edge.wire import (
    EventWork,
    Inbox,
    MissionWork,
    StateVectorWork,
    WorkError,
    post_for,
)
from mavlink_broker.effects import Acknowledgement, EdgeMessage, VehicleUpdate
from tests.support.broker_world import first_flight

UTC_NOW = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)


def mission_work(**changed: Any) -> dict[str, Any]:
    work = {
        "id": 16,
        "kind": "mission",
        "vehicle_id": 1,
        "plan_id": "01PLAN",
        "expires_at": "2026-11-21T08:01:00Z",
        "state": "queued",
        "mission": first_flight(),
        "report": None,
    }
    return work | changed


def test_a_mission_is_read_with_its_expiry_on_our_clock() -> None:
    work = Inbox().read(mission_work(), 500.0, UTC_NOW)
    assert isinstance(work, MissionWork)
    assert work.expires_at == 560.0
    assert not work.was_accepted


@pytest.mark.parametrize("wrong_s", [-86_400.0, -30.0, 30.0, 86_400.0])
def test_it_expires_by_the_clock_of_the_edge_server(wrong_s: float) -> None:
    """An abort expires after 10 s, however wrong the clock of the broker's machine is."""
    ours = UTC_NOW + timedelta(seconds=wrong_s)
    work = Inbox().read(mission_work(edge_time=UTC_NOW), 500.0, ours)
    assert isinstance(work, MissionWork)
    assert work.expires_at == 560.0


def test_what_the_edge_server_adds_to_a_report_is_no_obstacle() -> None:
    report = {
        "id": 3,
        "received_at": "2026-11-21T08:00:00Z",
        "sequence_number": 1,
        "vehicle_id": 1,
        "mission_id": 1201,
        "mission_status_id": 2,
        "command_report_array": [],
    }
    work = Inbox().read(mission_work(state="accepted", report=report), 0.0, UTC_NOW)
    assert isinstance(work, MissionWork)
    assert work.was_accepted
    assert work.report is not None
    assert work.report.mission_status_id == 2


def test_the_same_work_is_given_once() -> None:
    inbox = Inbox()
    assert inbox.read(mission_work(), 0.0, UTC_NOW) is not None
    assert inbox.read(mission_work(state="accepted"), 9.0, UTC_NOW) is None


def test_the_same_number_of_a_fresh_edge_server_is_other_work() -> None:
    inbox = Inbox()
    inbox.read(mission_work(), 0.0, UTC_NOW)
    assert inbox.read(mission_work(plan_id="01OTHER"), 0.0, UTC_NOW) is not None


def test_an_answer_repeats_the_identity_of_its_work() -> None:
    work = Inbox().read(mission_work(identity="01PLAN"), 0.0, UTC_NOW)
    assert isinstance(work, MissionWork)
    post = sent(work.answer("refused", "no wings"))
    assert post.body == {"status": "refused", "message": "no wings", "identity": "01PLAN"}


def test_the_same_event_with_another_identity_is_another_event() -> None:
    event = {"sequence_number": 1, "vehicle_id": 1, "event_type_id": 1}
    raw = {"id": 2, "kind": "event", "event": event}
    inbox = Inbox()
    first, again, other = (
        inbox.read(raw | {"identity": identity}, 0.0, UTC_NOW) for identity in ("a", "a", "b")
    )
    assert isinstance(first, EventWork)
    assert isinstance(other, EventWork)
    assert again is None
    assert (first.answer("done").identity, other.answer("done").identity) == ("a", "b")


def test_a_wish_for_the_state_may_name_no_vehicle() -> None:
    raw = {"id": 4, "kind": "latest_state_vector", "vehicle_id": None, "sequence_number": 3}
    assert Inbox().read(raw, 0.0, UTC_NOW) == StateVectorWork(work_id=4, vehicle_id=None)


@pytest.mark.parametrize(
    "changed",
    [{"kind": "dance"}, {"mission": {}}, {"mission": None}, {"expires_at": "soon"}, {"report": 5}],
)
def test_work_that_cannot_be_read_is_refused_by_its_number(changed: dict[str, Any]) -> None:
    with pytest.raises(WorkError) as caught:
        Inbox().read(mission_work(**changed), 0.0, UTC_NOW)
    assert caught.value.work_id == 16


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda children: (
        st.lists(children, max_size=3) | st.dictionaries(st.text(max_size=5), children, max_size=3)
    ),
    max_leaves=5,
)


@given(st.sampled_from(sorted(mission_work())), json_values)
def test_any_fault_in_any_field_is_an_error_of_ours(field: str, value: Any) -> None:
    with suppress(WorkError):
        Inbox().read(mission_work(**{field: value}), 0.0, UTC_NOW)


AT = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
PLACE: dict[str, Any] = {"latitude": 40.0, "longitude": -3.0, "altitude": 5.0}


def sent(message: EdgeMessage) -> Post:
    return post_for(message, vehicle_id=7, recorded_at=AT, key="01KEY")


def test_a_report_carries_its_time_and_its_key() -> None:
    pose = Pose(sequence_number=0, vehicle_id=7, yaw=0, pitch=0, roll=0, **PLACE)
    post = sent(pose)
    assert (post.method, post.path, post.idempotency_key) == ("POST", "/pose/", "01KEY")
    assert post.body["recorded_at"] == "2026-11-21T08:00:00Z"
    assert post.needs_registration


def test_acknowledgements_and_reports_share_a_lane() -> None:
    post = sent(Acknowledgement(16, "refused", "no wings"))
    assert post.path == "/broker/commands/16/ack"
    assert post.body == {"status": "refused", "message": "no wings"}
    assert post.lane == "mission_report"


def test_an_event_that_is_done_at_once_is_accepted_first() -> None:
    outbox = Outbox(Random(1))
    for status in ("accepted", "done"):
        outbox.put(sent(Acknowledgement(16, status)))
    first = outbox.take(0.0)
    assert first is not None
    assert first.body == {"status": "accepted"}
    assert outbox.take(0.0) is None, "the edge server would refuse the acceptance of what is done"
    outbox.answered(first)
    second = outbox.take(0.0)
    assert second is not None
    assert second.body == {"status": "done"}


def test_an_acknowledgement_is_no_longer_than_the_edge_server_accepts() -> None:
    """A refused one would leave its work open for ever: it is not sent again."""
    post = sent(Acknowledgement(16, "refused", "an internal error: " + "x" * 2000))
    assert post.body["message"].startswith("an internal error: x")
    assert len(post.body["message"]) == 1000


def test_a_vehicle_is_registered_before_anything_else() -> None:
    post = sent(VehicleUpdate(7, {"link_state": "connected"}))
    assert (post.method, post.path) == ("PUT", "/vehicles/7")
    assert post.urgency is Urgency.REGISTRATION
    assert post.body == {"link_state": "connected", "recorded_at": "2026-11-21T08:00:00Z"}
