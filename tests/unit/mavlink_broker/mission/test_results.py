"""What is posted for every finished command: in which order, of which moment, and how often."""

import dataclasses
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import Any

import pytest

from afarcloud.enumerations import ImageFormat, Status
from afarcloud.state import Image, Observation, ObservationList, Pose
from mavlink_broker.config import Config
from mavlink_broker.edge.outbox import Post, Urgency
from mavlink_broker.edge.wire import post_for
from mavlink_broker.effects import Result
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.broker_world import World, first_flight, flying_world, go_home, mission, takeoff
from tests.support.vehicle_script import HOME, PX4

SLOW = dataclasses.replace(PX4, item_time_s=5.0)
SET = ["/pose/", "/observation/", "/battery/"]
AT = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)


def air(world: World) -> None:
    """Let the vehicle measure the air, and let a second pass."""
    world.send_from(world.only_vehicle, mavlink.MAVLink_hygrometer_sensor_message(0, 2150, 4800))
    world.run(1.0)


def fly(world: World) -> None:
    while (world.edge.status(1201) or 0) < Status.FINISHED:
        air(world)


def result_posts(world: World) -> list[Post]:
    """Results and reports, in their order."""
    paths = {*SET, "/mission_report/"}
    return [post for post in world.edge.posts if post.path in paths]


def test_a_set_is_pose_observations_and_battery_ahead_of_the_report() -> None:
    world = flying_world(SLOW)
    air(world)
    fly(world)
    assert world.edge.status(1201) == Status.FINISHED
    posts = result_posts(world)
    begins = [place for place, post in enumerate(posts) if post.path == "/pose/"]
    assert len(begins) == 3
    for begin in begins:
        paths = [post.path for post in posts[begin : begin + 4]]
        assert paths == [*SET, "/mission_report/"]
    assert len({post.lane for post in posts}) == 1, "one line, or the report could overtake"


def test_the_report_behind_a_set_is_the_first_that_calls_its_command_finished() -> None:
    world = flying_world(SLOW)
    fly(world)
    finished = 0
    for post, following in pairwise(result_posts(world)):
        if post.path == "/battery/":
            finished += 1
            statuses = [c["command_status_id"] for c in following.body["command_report_array"]]
            assert statuses.count(Status.FINISHED) == finished


@pytest.mark.thorough
def test_on_request_it_measures_while_it_flies() -> None:
    counts = []
    for every_s in (0.0, 2.0):
        world = flying_world(SLOW, config=Config(observations_every_s=every_s))
        fly(world)
        in_flight = len(world.edge.bodies("/observation/"))
        world.only_vehicle.armed = False
        for _ in range(10):
            air(world)
        assert len(world.edge.bodies("/observation/")) <= in_flight + 1
        counts.append(in_flight)
    at_commands, often = counts
    assert at_commands == 3
    assert often > at_commands + 3


def test_a_result_is_of_the_place_where_its_command_ended() -> None:
    world = flying_world(SLOW)
    vehicle = world.only_vehicle
    vehicle.place = (HOME[0] + 1e-4, HOME[1])
    world.run(1.0)
    world.run_until(lambda: world.edge.bodies("/pose/"))
    vehicle.place = (HOME[0] + 2e-4, HOME[1])
    fly(world)
    latitudes = [body["latitude"] for body in world.edge.bodies("/pose/")]
    assert latitudes[0] == pytest.approx(HOME[0] + 1e-4, abs=1e-7)
    assert latitudes[1] == pytest.approx(HOME[0] + 2e-4, abs=1e-7)


@pytest.mark.thorough
def test_what_was_measured_long_ago_is_no_result() -> None:
    world = flying_world(dataclasses.replace(PX4, item_time_s=12.0))
    air(world)
    world.run_until_over(1201)
    assert world.edge.bodies("/pose/")
    assert world.edge.bodies("/observation/") == []


def keys(world: World) -> list[str | None]:
    return [post.idempotency_key for post in result_posts(world) if post.path in SET]


@pytest.mark.thorough
def test_no_two_results_have_the_same_key() -> None:
    world = flying_world(SLOW)
    fly(world)
    world.edge.plan(first_flight())
    world.run(5.0)
    world.run_until(lambda: len(world.edge.closed) == 2)
    assert len(set(keys(world))) == len(keys(world)) >= 9


def test_a_set_whose_report_was_lost_is_sent_again_under_the_same_keys() -> None:
    world = flying_world(SLOW)
    reports = len(world.edge.reports(1201))
    world.run_until(lambda: world.edge.bodies("/battery/"))
    first = keys(world)
    work = next(iter(world.edge.work.values()))
    work["report"] = world.edge.reports(1201)[reports - 1]  # The report FINISHED is lost
    world.restart_broker()
    world.run_until_over(1201)
    assert keys(world)[len(first) : 2 * len(first)] == first
    assert len(set(keys(world))) == 2 * 3


def test_a_set_that_was_sent_is_not_sent_again_by_a_restarted_broker() -> None:
    world = flying_world(SLOW)
    world.run_until(lambda: world.edge.statuses(1201)[0] == Status.FINISHED)
    world.restart_broker()
    world.run_until_over(1201)
    assert len(keys(world)) == len(set(keys(world))) == 2 * 3


@pytest.mark.first_case
@pytest.mark.parametrize("step_s", [-3600.0, -2.0, 3600.0])
def test_the_time_of_results_does_not_go_back_in_flight(
    step_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The machine's clock is set; behind the landing what is recorded has its time."""
    world = flying_world(SLOW)
    world.run(2.0)
    true_utc, begun = world.clock.utc, world.clock.now
    monkeypatch.setattr(world.clock, "utc", lambda: true_utc() + timedelta(seconds=step_s))
    fly(world)
    times = [datetime.fromisoformat(body["recorded_at"]) for body in world.edge.bodies("/pose/")]
    assert times == sorted(times)
    ahead_s = (times[-1] - true_utc()).total_seconds()
    assert ahead_s == pytest.approx(max(0.0, step_s), abs=world.clock.now - begun)
    world.run_until(lambda: not world.only_vehicle.armed)
    world.run(2.0)
    world.edge.posts.clear()
    world.edge.plan(first_flight(mission_id=1202))
    world.run_until_over(1202)
    first = datetime.fromisoformat(world.edge.bodies("/pose/")[0]["recorded_at"])
    assert abs((first - world.clock.utc()).total_seconds()) < 200.0
    assert first < world.clock.utc()


def test_an_aborted_command_has_no_results() -> None:
    world = flying_world(SLOW, tick_s=0.02)
    world.edge.event(1)
    world.run_until(lambda: not world.only_vehicle.armed)
    world.run(1.0)
    assert [post.path for post in result_posts(world) if post.path in SET] == ["/pose/"], (
        "where it landed"
    )


def test_a_live_command_has_results_too() -> None:
    circle = {
        "latitude": HOME[0],
        "longitude": HOME[1],
        "orbit_altitude": 8.0,
        "radius": 10.0,
        "angular_velocity": 20.0,
    }
    hotpoint: dict[str, Any] = {"command_id": 2, "command_type_id": 7, "parameters": circle}
    world = World()
    world.add_vehicle()
    world.edge.plan(mission(takeoff(), hotpoint, go_home()))
    world.run_until_over(1201)
    assert world.edge.status(1201) == Status.FINISHED
    assert len(world.edge.bodies("/pose/")) == 3


def posted(report: Pose | ObservationList | Image, of: str = "1/01PLAN/7/3") -> Post:
    return post_for(Result(report, of), vehicle_id=1, recorded_at=AT, key="01KEY")


POSE = Pose(
    sequence_number=0, vehicle_id=1, latitude=0, longitude=0, altitude=0, yaw=0, pitch=0, roll=0
)


def test_a_key_follows_from_what_it_is_the_result_of() -> None:
    again = POSE.model_copy(update={"sequence_number": 9, "latitude": 1.0})
    assert posted(POSE).idempotency_key == posted(again).idempotency_key
    assert posted(POSE).idempotency_key != posted(POSE, "1/01PLAN/7/4").idempotency_key
    assert posted(POSE, "x" * 500).idempotency_key is not None
    assert len(posted(POSE, "x" * 500).idempotency_key or "") <= 64


def test_a_picture_holds_up_no_report() -> None:
    frame = "/9j/"
    image = Image(
        sequence_number=0, vehicle_id=1, format=ImageFormat.JPEG, image_size=3, frame=frame
    )
    post = posted(image)
    assert (post.path, post.lane, post.urgency) == ("/image/", "image", Urgency.PICTURE)


def test_a_measurement_without_a_time_of_day_has_the_time_of_its_report() -> None:
    measured = [
        Observation(
            resource_id="urn", observed_property="x", result_time=at, result_value=1, result_uom="1"
        )
        for at in (0, 1_700_000_000)
    ]
    observation_list = ObservationList(
        sequence_number=0,
        vehicle_id=1,
        latitude=0,
        longitude=0,
        altitude=0,
        observation_array=tuple(measured),
    )
    body = posted(observation_list).body
    times = [one["result_time"] for one in body["observation_array"]]
    assert times == [int(AT.timestamp()), 1_700_000_000]
