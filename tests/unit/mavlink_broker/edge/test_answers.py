"""What the edge server's answers mean for a post, and its time of day, read from late answers."""

import json
import logging
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.edge.answers import EdgeClock
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.client import EdgeClient, Pause
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.wire import post_for
from mavlink_broker.effects import Acknowledgement, EdgeMessage, VehicleUpdate
from tests.support import spooled_posts

NOWHERE = "http://127.0.0.1:1"
REFUSED: dict[str, Any] = {
    "message": "the document cannot be used",
    "detail": {
        "json": {
            "command_report_array.0.command_id": ["mission 7 has no such command"],
            "altitude": ["must be -1000 to 10000", "Extra inputs are not permitted"],
        }
    },
    "request_id": "01ABC",
}
IN_WORDS = (
    "HTTP 422: the document cannot be used: "
    "command_report_array.0.command_id mission 7 has no such command; "
    "altitude must be -1000 to 10000; altitude: Extra inputs are not permitted"
)


def logged(
    folder: Path, caplog: pytest.LogCaptureFixture, post: Post, answer: Answer
) -> list[tuple[str, str]]:
    """Have a client handle the answer to a post; gives what it logs."""
    client = EdgeClient(NOWHERE, folder / "broker.key", lambda: None)
    client.post(post)
    taken = client.take_post()
    assert taken is not None
    with caplog.at_level(logging.INFO):
        client.settle(taken, answer)
    lines = [(record.levelname, record.getMessage()) for record in caplog.records]
    assert lines.pop(0) == ("INFO", "the edge server answers")
    return lines


def answer(status: int, body: Any) -> Answer:
    return Answer(status, body if isinstance(body, bytes) else json.dumps(body).encode())


def of_message(message: EdgeMessage) -> Post:
    return post_for(message, vehicle_id=1, recorded_at=datetime(2026, 11, 21, tzinfo=UTC), key="K")


def test_a_refused_report_is_a_sentence_with_each_field_and_its_fault(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    report = spooled_posts.post("mission_report")
    lines = logged(tmp_path, caplog, report, answer(422, REFUSED))
    assert lines == [("ERROR", f"the mission report of vehicle 1 is given up: {IN_WORDS}")]


def test_an_answer_to_withdrawn_work_and_a_state_are_named_too(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    gone = answer(409, {"message": "work 16: an event that is expired cannot be done"})
    done = of_message(Acknowledgement(16, "refused", "no wings"))
    why = "HTTP 409: work 16: an event that is expired cannot be done"
    whole = f'the answer "refused" of vehicle 1 to work 16 is not accepted: {why}'
    assert logged(tmp_path, caplog, done, gone) == [("WARNING", whole)]
    caplog.clear()
    state = of_message(VehicleUpdate(1, {"link_state": "connected"}))
    lines = logged(tmp_path, caplog, state, answer(422, REFUSED))
    assert lines == [("ERROR", f"the state of vehicle 1 is refused: {IN_WORDS}")]


def test_the_reason_of_a_mission_that_is_not_accepted_is_in_words(tmp_path: Path) -> None:
    client = EdgeClient(NOWHERE, tmp_path / "broker.key", lambda: None)
    client.post(of_message(Acknowledgement(16, "accepted")))
    taken = client.take_post()
    assert taken is not None
    client.settle(taken, answer(409, {"message": "vehicle 1 is held", "request_id": "01ABC"}))
    (result,) = client.take_acceptance_results()
    assert result.reason == "vehicle 1 is held"


@pytest.mark.parametrize(
    ("body", "shown"),
    [
        (b"<html>\n <b>Bad  request</b>\n</html>", "<html> <b>Bad request</b> </html>"),
        (b"[1]", "[1]"),
        (b'{"message": "no", "detail": 3}', '{"message": "no", "detail": 3}'),
        (b'{"message": "no", "detail": {"json": {"a": null}}}', None),
        (b"\xff", "\ufffd"),
    ],
)
def test_what_is_of_somebody_else_is_one_line(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, body: bytes, shown: str | None
) -> None:
    client = EdgeClient(NOWHERE, tmp_path / "broker.key", lambda: None)
    assert client.take_answer(client.next_poll(), Answer(403, body)) is Pause.RETRY
    (line,) = (one for one in caplog.messages if "refuses work" in one)
    assert line == f"the edge server refuses work: HTTP 403: {shown or body.decode()}"


NOON = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)


def at(seconds: float) -> datetime:
    """The edge server's time so long after noon; the program's clock shows 100 s at noon."""
    return NOON + timedelta(seconds=seconds)


def test_it_is_not_known_without_an_answer() -> None:
    assert EdgeClock().time(100.0) is None


@given(st.lists(st.floats(0.0, 30.0), min_size=2, max_size=16))
def test_it_is_late_by_the_shortest_delay_at_most(delays_s: list[float]) -> None:
    clock = EdgeClock()
    for number, delay_s in enumerate(delays_s):
        received = 100.0 + 20.0 * number + delay_s
        clock.note(at(20.0 * number), received - delay_s, received)
    known = clock.time(1000.0)
    assert known is not None
    assert (at(900.0) - known).total_seconds() == pytest.approx(min(delays_s), abs=1e-3)


@given(st.floats(0.0, 10.0), st.floats(0.0, 86_400.0))
def test_the_first_answer_counts_as_written_when_it_was_asked_for(
    held_s: float, suspended_s: float
) -> None:
    """It was on its way for long, or the program was suspended: an order in it may have expired."""
    clock = EdgeClock()
    read = 100.0 + held_s + suspended_s
    clock.note(at(0.0), 100.0, read)
    known = clock.time(read)
    assert known is not None
    assert (known - at(held_s + suspended_s)).total_seconds() == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("step_s", [-3600.0, -2.0, 2.0, 3600.0])
def test_a_clock_that_was_set_is_followed_at_once(step_s: float) -> None:
    clock = EdgeClock()
    clock.note(at(0.0), 99.9, 100.0)
    clock.note(at(20.0 + step_s), 119.9, 120.0)
    assert clock.time(130.0) == at(30.0 + step_s)


def test_a_clock_that_was_set_back_a_little_is_followed_in_time() -> None:
    clock = EdgeClock()
    clock.note(at(0.0), 99.9, 100.0)
    for number in range(1, 17):  # Each answer is waited for longer than the clock was set back
        received = 100.0 + 20.0 * number
        clock.note(at(20.0 * number - 5.0), received - 20.0, received)
    assert clock.time(500.0) == at(395.0)


@given(st.floats(0.0, 5.0), st.floats(0.0, 86_400.0))
def test_an_answer_that_is_read_late_does_not_set_the_clock_back(
    waited_s: float, suspended_s: float
) -> None:
    """The program was suspended while an order lay in its socket: the order has expired."""
    clock = EdgeClock()
    clock.note(at(0.0), 99.9, 100.0)
    read = 120.0 + waited_s + suspended_s
    clock.note(at(20.0 + waited_s), 120.0, read)
    known = clock.time(read)
    assert known is not None
    assert abs((at(20.0 + waited_s + suspended_s) - known).total_seconds()) < 1e-3
