from dst.coverage import Coverage, text_of
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post, Urgency
from mavlink_broker.mission import mission_executor
from mavlink_broker.mission.states import TRANSITIONS, Event, State, follow


def acknowledgement(work_id: int, reason: str) -> Post:
    return Post(
        method="POST",
        path=f"/broker/commands/{work_id}/ack",
        body={"status": "refused", "message": reason},
        vehicle_id=1,
        lane="1",
        urgency=Urgency.REPORT,
    )


def test_a_transition_is_counted_while_it_still_takes_place() -> None:
    coverage = Coverage()
    with coverage.counting():
        after = vars(mission_executor)["follow"](State.IDLE, Event.MISSION_TAKEN)
    assert after is State.WAITING
    assert coverage.counts == {"transition IDLE --MISSION_TAKEN--> WAITING": 1}
    assert vars(mission_executor)["follow"] is follow


def test_transitions_that_were_not_reached_are_named() -> None:
    text = text_of({"transition IDLE --MISSION_TAKEN--> WAITING": 3})
    assert text.startswith(f"1 of {len(TRANSITIONS)} transitions")
    assert "IDLE --MISSION_TAKEN--> WAITING" not in text
    assert "IDLE --MISSION_RESUMED--> ATTACHING" in text


def test_refusals_are_counted_by_reason_whatever_their_numbers() -> None:
    coverage = Coverage()
    for work_id in (7, 12):
        post = acknowledgement(work_id, f"event {work_id} has expired")
        coverage.note_answer(post, Answer(200, b"{}"))
    assert coverage.counts == {
        "answer POST /broker/commands/N/ack 200": 2,
        "refusal event N has expired": 2,
    }
