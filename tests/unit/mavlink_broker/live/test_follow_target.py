"""A vehicle follows another one, or the track in a file."""

from pathlib import Path

import pytest

from afarcloud.geodesy import shifted
from mavlink_broker.config import Config
from mavlink_broker.live.follow_target import TargetSourceError, read_target_sources
from tests.support.broker_world import World, follow, go_home, mission, takeoff
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import HOME, PX4, PX4_FOLLOW

HEADER = "time_s,latitude_deg,longitude_deg\n"


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
