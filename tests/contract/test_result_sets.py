"""What the broker posts of a finished command, at the edge server's own endpoint."""

import base64
import io
from datetime import UTC, datetime, timedelta

import pytest
from PIL import Image as Pictures

from mavlink_broker.edge.answers import KNOWN
from mavlink_broker.edge.wire import post_for
from mavlink_broker.effects import ConvertedPicture, ConvertPicture, EdgeReport
from mavlink_broker.mavlink.codec import Decoder, Encoder
from mavlink_broker.mavlink.dialect import Message, Route, mavlink
from mavlink_broker.pictures.worker_pool import run_job
from mavlink_broker.vehicle.reporter import Reporter
from mavlink_broker.vehicle.vehicle import Vehicle
from tests.unit.edge_server.conftest import (  # noqa: F401  # fixtures
    Edge,
    config,
    edge,
    engine_name,
    prepared,
)

AT = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
SESSION = "01K9Z4T1W8F6Q2M3N5P7R9S0VX"
SET = ["pose", "observation", "battery"]


def decoded(message: Message) -> Message:
    (decoded,) = Decoder().decode(Encoder(1, 1).encode(message))
    return decoded


def flying_vehicle() -> Vehicle:
    """A vehicle that has sent its position and its measurements."""
    vehicle = Vehicle(1, Route(254, 191, 1, 1))
    vehicle.snapshot.battery_capacity_ah = 5.2
    for message in (
        mavlink.MAVLink_global_position_int_message(
            9_000, 404_434_000, -37_382_000, 0, 5_000, 0, 0, 0, 0
        ),
        mavlink.MAVLink_attitude_message(9_000, 0.1, -0.1, 3.0, 0, 0, 0),
        mavlink.MAVLink_battery_status_message(
            0, 1, 1, 32767, [12000] + [65535] * 9, 100, 0, -1, 80
        ),
        mavlink.MAVLink_hygrometer_sensor_message(0, 2150, 4800),
        mavlink.MAVLink_named_value_float_message(9_000, b"soil_moist", 23.5),
        mavlink.MAVLink_named_value_float_message(9_000, b"leaf_wet", 0.5),
        mavlink.MAVLink_wind_cov_message(0, 3.0, -1.0, 0, 0, 0, 0, 0, 0),
    ):
        vehicle.take(decoded(message), 100.0)
    return vehicle


def statuses(server: Edge, reports: list[EdgeReport], at: datetime = AT) -> list[int]:
    """Post reports as the broker would; return the answers' status codes."""
    answers = []
    for report in reports:
        post = post_for(report, vehicle_id=1, recorded_at=at, key="unused")
        answer = server.report(post.path.strip("/"), post.body, post.idempotency_key)
        if answer.status_code == 422:
            assert KNOWN in answer.get_data(as_text=True)
        answers.append(answer.status_code)
    return answers


def a_picture() -> ConvertedPicture:
    out = io.BytesIO()
    Pictures.new("RGB", (640, 480), "green").save(out, "JPEG")
    outcome = run_job(ConvertPicture(1, out.getvalue()))
    assert isinstance(outcome, ConvertedPicture)
    return outcome


def test_a_result_set_is_accepted_whole(edge: Edge) -> None:  # noqa: F811  # the fixture
    reporter = Reporter(flying_vehicle(), SESSION)
    posts = reporter.results("1/01PLAN/7/3", 100.0)
    posts.append(reporter.image(a_picture(), "m7_c3_0000", "1/100/0", 99.0))
    assert statuses(edge, posts) == [201] * 4
    for kind in [*SET, "image"]:
        (row,) = edge.get(f"/{kind}/")
        assert row["session_id"] == SESSION
    (image,) = edge.get("/image/")
    whole = edge.get(f"/image/{image['id']}")
    assert base64.b64decode(whole["frame"]).startswith(b"\xff\xd8\xff")


@pytest.mark.first_case
@pytest.mark.parametrize("later_s", [0, 45])
def test_a_result_that_is_posted_again_after_a_crash_is_stored_once(
    edge: Edge,  # noqa: F811  # the fixture
    later_s: int,
) -> None:
    vehicle = flying_vehicle()
    first = Reporter(vehicle, SESSION).results("1/01PLAN/7/3", 100.0)
    statuses(edge, first)
    again = Reporter(vehicle, SESSION.replace("K", "M")).results("1/01PLAN/7/3", 100.0)
    assert statuses(edge, again, AT + timedelta(seconds=later_s)) == [422] * len(again)
    assert [len(edge.get(f"/{kind}/")) for kind in SET] == [1, 1, 1]
