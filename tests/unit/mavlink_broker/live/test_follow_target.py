"""A vehicle follows another one, or the track in a file: where that is, and how fast it goes."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.geodesy import shifted
from mavlink_broker.config import Config
from mavlink_broker.live.follow_target import (
    TargetFileError,
    TargetSourceError,
    VehicleTrack,
    read_target_sources,
    read_track,
)
from mavlink_broker.planning.target_commands import TargetState
from tests.support.broker_world import World, follow, go_home, mission, takeoff
from tests.support.geodesy import LocalGround
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import HOME, PX4, PX4_FOLLOW

HEADER = "time_s,latitude_deg,longitude_deg\n"
NORTHWARD = HEADER + "0,40.0,-3.0\n10,40.001,-3.0\n30,40.001,-2.999\n"


def test_it_moves_straight_from_mark_to_mark() -> None:
    seen = read_track(NORTHWARD).at(5.0)
    assert (seen.latitude_deg, seen.longitude_deg) == pytest.approx((40.0005, -3.0))
    north, east, down = seen.velocity_ned_m_s
    assert north == pytest.approx(11.1, abs=0.1)
    assert (east, down) == (0.0, 0.0)


def test_it_stands_before_and_after_its_track() -> None:
    track = read_track(NORTHWARD)
    assert track.at(-5.0) == TargetState(40.0, -3.0)
    assert track.at(31.0) == TargetState(40.001, -2.999)


def test_it_crosses_the_date_line_by_the_shorter_path() -> None:
    track = read_track(HEADER + "0,0.0,179.999\n10,0.0,-179.999\n")
    assert abs(track.at(5.0).longitude_deg) == pytest.approx(180.0)
    assert track.at(5.0).velocity_ned_m_s[1] == pytest.approx(22.3, abs=0.1)


@given(st.floats(0.0, 29.0), st.floats(0.01, 0.9))
def test_its_velocity_leads_to_where_it_is_a_little_later(time: float, step: float) -> None:
    track = read_track(NORTHWARD)
    if (time < 10.0) != (time + step < 10.0):
        return
    here, there = track.at(time), track.at(time + step)
    offset_m = LocalGround(*here[:2]).north_east_m(*there[:2])[:2]
    expected = (here.velocity_ned_m_s[0] * step, here.velocity_ned_m_s[1] * step)
    assert math.dist(offset_m, expected) < 0.01


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "the first line must be"),
        ("latitude,longitude\n", "the first line must be"),
        (HEADER, "it contains no position"),
        (HEADER + "0,40,north\n", "line 2: it must have three numbers"),
        (HEADER + "0,40\n", "line 2: it must have three numbers"),
        (HEADER + "nan,40,-3\n", "line 2: it is not a position"),
        (HEADER + "0,91,-3\n", "line 2: it is not a position"),
        (HEADER + "0,40,-3\n0,41,-3\n", "line 3: time_s must increase"),
    ],
)
def test_the_error_names_the_invalid_line(text: str, reason: str) -> None:
    with pytest.raises(TargetFileError, match=reason):
        read_track(text)


def test_another_vehicle_moves_on_from_its_last_report() -> None:
    track = VehicleTrack()
    for second in range(4):
        track.take(float(second), 40.0 + second * 9e-6, -3.0)
    seen = track.at(3.2)
    assert seen is not None
    assert seen.latitude_deg == pytest.approx(40.000027)
    assert seen.velocity_ned_m_s[0] == pytest.approx(1.0, abs=0.01)


def test_another_vehicle_that_is_silent_is_nowhere() -> None:
    track = VehicleTrack()
    assert track.at(0.0) is None
    track.take(0.0, 40.0, -3.0)
    assert track.at(0.5) is not None
    assert track.at(1.5) is None


def following(target: int | Path) -> tuple[World, ScriptedVehicle]:
    """A world whose vehicle 1 has just begun to follow."""
    world = World(config=Config(follow_targets={1: target}))
    follower = world.add_vehicle(1)
    world.add_vehicle(2)
    world.edge.plan(mission(takeoff(), follow(altitude=10.0), go_home(3)))
    world.run_until(lambda: follower.custom_mode == PX4_FOLLOW and follower.targets > 5)
    return world, follower


@pytest.mark.thorough
def test_another_vehicle_is_followed() -> None:
    world, follower = following(2)
    leader = world.air.vehicles["192.0.2.1", 14582]
    for step in range(1, 20):
        leader.place = shifted(*HOME[:2], 45.0, 2.0 * step)
        world.run(0.5)
    assert follower.last_target == pytest.approx(leader.place, abs=3e-5)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [3, 3, 3]


def test_no_target_is_sent_while_the_followed_vehicle_is_silent() -> None:
    world, follower = following(2)
    leader = world.air.vehicles["192.0.2.1", 14582]
    leader.silent = True
    world.run(5.0)
    received = follower.targets
    world.run(5.0)
    assert follower.targets == received
    leader.silent = False
    world.run(3.0)
    assert follower.targets > received


@pytest.mark.thorough
def test_the_track_in_a_file_starts_with_the_follow(tmp_path: Path) -> None:
    path = tmp_path / "tractor.csv"
    path.write_text(f"{HEADER}0,{HOME[0]},{HOME[1]}\n20,{HOME[0] + 0.001},{HOME[1]}\n")
    world, follower = following(path)
    world.run(10.0)
    assert follower.last_target[0] == pytest.approx(HOME[0] + 0.0005, abs=1.5e-4)
    world.run(15.0)
    assert follower.last_target == pytest.approx((HOME[0] + 0.001, HOME[1]), abs=1e-6)


def test_without_a_target_vehicle_the_position_of_the_command_is_sent() -> None:
    world = World(config=Config(follow_targets={7: 2}))
    follower = world.add_vehicle(script=PX4)
    world.edge.plan(mission(takeoff(), follow(altitude=10.0), go_home(3)))
    world.run_until(lambda: follower.targets > 5)
    assert follower.last_target == pytest.approx(HOME[:2], abs=1e-6)


@pytest.mark.parametrize(("content", "reason"), [(None, "No such file"), (b"\xff", "utf-8")])
def test_a_file_that_cannot_be_read_is_named(
    content: bytes | None, reason: str, tmp_path: Path
) -> None:
    path = tmp_path / "tractor.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(TargetSourceError, match=reason) as error:
        read_target_sources({1: path}, lambda _: None)
    assert "tractor.csv" in str(error.value)
