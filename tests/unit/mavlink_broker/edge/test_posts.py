"""Messages as requests to the edge server."""

from datetime import UTC, datetime
from random import Random
from typing import Any

from afarcloud.state import Pose
from mavlink_broker.edge.outbox import Outbox, Post, Urgency
from mavlink_broker.edge.wire import post_for
from mavlink_broker.effects import Acknowledgement, EdgeMessage, VehicleUpdate

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
