"""A restarted broker restores everything that it has changed on a vehicle; simulated time.

The disk is a slow one, so that a broker may die between a change and its note.
"""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from afarcloud.enumerations import EventType, Status
from mavlink_broker.mission.states import State
from tests.support.broker_world import World, first_flight
from tests.support.fenced_vehicle import fenced_vehicle
from tests.support.geofences import fence, placed, square
from tests.support.overridden_settings import WITH_FOLLOW, WITH_RATE, Farm
from tests.support.scripted_disk import DISK_LAG_S
from tests.support.vehicle_script import ARDUPILOT, PX4, PX4_FOLLOW, Script


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "values", "killed_after_s"),
    [
        *((PX4, WITH_FOLLOW, at_s) for at_s in (0.5, 30.0)),
        (ARDUPILOT, WITH_RATE, 0.6),
    ],
)
def test_a_vehicles_own_settings_are_restored_whenever_the_broker_dies(
    tmp_path: Path, script: Script, values: Mapping[str, Any], killed_after_s: float
) -> None:
    farm = Farm(tmp_path, script, values)
    farm.world.run(killed_after_s)
    farm.world.kill_broker()
    farm.world.run(1.0)
    farm.world.restart_broker()
    farm.world.run_until_over(1201)
    farm.world.run_until(farm.is_as_before)
    assert farm.world.edge.status(1201) == Status.FINISHED


@pytest.mark.first_case
@pytest.mark.parametrize(
    ("script", "values"), [(PX4, WITH_FOLLOW), (ARDUPILOT, WITH_RATE)], ids=["px4", "ardupilot"]
)
def test_a_vehicle_that_receives_nothing_at_first_gets_back_everything(
    tmp_path: Path, script: Script, values: Mapping[str, Any]
) -> None:
    """Over a link of one direction nobody knows what it can keep."""
    farm = Farm(tmp_path, script, values)
    farm.world.run_until_over(1201)
    farm.world.kill_broker()
    assert farm.held != farm.before
    farm.world.air.is_uplink_up = False
    farm.world.restart_broker()
    farm.world.run(30.0)
    farm.world.air.is_uplink_up = True
    farm.world.run_until(farm.is_as_before, within_s=200.0)


def test_nothing_is_changed_before_the_journal_holds_what_it_was(tmp_path: Path) -> None:
    farm = Farm(tmp_path, PX4, WITH_FOLLOW)
    assert farm.world.disk is not None
    farm.world.disk.is_stuck = True
    farm.world.run(1.9)
    assert farm.held == farm.before
    farm.world.disk.is_stuck = False
    farm.world.run_until(lambda: farm.held != farm.before)


@pytest.mark.first_case
@pytest.mark.parametrize("how", ["refuses", "is_stuck"])
def test_a_disk_that_is_full_or_does_not_answer_stops_no_flight(
    tmp_path: Path, how: str, caplog: pytest.LogCaptureFixture
) -> None:
    farm = Farm(tmp_path, PX4, WITH_FOLLOW)
    assert farm.world.disk is not None
    setattr(farm.world.disk, how, True)
    with caplog.at_level(logging.WARNING):
        farm.world.run_until_over(1201)
    assert farm.world.edge.status(1201) == Status.FINISHED
    farm.world.run_until(lambda: farm.held == farm.before)
    assert sum("nobody waits for it" in line for line in caplog.messages) <= 1


@pytest.mark.thorough
def test_what_a_command_needs_stays_until_the_mission_is_found_again(tmp_path: Path) -> None:
    """The edge server is away for longer than the broker: the vehicle follows on meanwhile."""
    farm = Farm(tmp_path, PX4, WITH_FOLLOW)
    farm.world.run_until(lambda: farm.vehicle.custom_mode == PX4_FOLLOW)
    farm.world.restart_broker()
    farm.world.edge.take_work()
    farm.world.run(20.0)
    assert farm.vehicle.values["FLW_TGT_HT"] == 12.0
    farm.world.edge.hand_out_again()
    farm.world.run_until_over(1201)
    farm.world.run_until(farm.is_as_before)


def test_what_somebody_else_has_set_meanwhile_stays(tmp_path: Path) -> None:
    farm = Farm(tmp_path, PX4, WITH_FOLLOW)
    farm.world.run_until(lambda: farm.vehicle.custom_mode == PX4_FOLLOW)
    farm.world.kill_broker()
    farm.vehicle.values["FLW_TGT_DST"] = 15.0
    farm.vehicle.values["FLW_TGT_HT"] = 30.0
    theirs = square(half_m=70.0)
    placed(farm.vehicle, theirs)
    farm.world.run(1.0)
    farm.world.restart_broker()
    farm.world.edge.event(EventType.ABORT_MISSION)
    farm.world.run_until(lambda: not farm.vehicle.armed)
    farm.world.run_until(lambda: not list(tmp_path.iterdir()))
    assert farm.vehicle.values["FLW_TGT_DST"] == 15.0
    assert farm.vehicle.values["FLW_TGT_HT"] == 30.0
    assert farm.vehicle.fence[0][1] == pytest.approx(theirs[0][0], abs=1e-7)


def test_another_vehicle_under_that_system_id_gets_nothing_of_it(tmp_path: Path) -> None:
    farm = Farm(tmp_path, PX4, WITH_FOLLOW, uid=6)
    world, first = farm.world, farm.vehicle
    world.run_until(lambda: first.custom_mode == PX4_FOLLOW)
    changed = dict(first.values)
    world.kill_broker()
    world.edge.closed.add(1)
    second = fenced_vehicle(world, PX4, values=changed)
    second.uid = 7
    world.restart_broker()
    world.run(20.0)
    assert second.values == changed
    assert second.set == []
    first.armed = first.airborne = False
    first.silent = False
    world.air.vehicles["192.0.2.1", 14581] = first
    world.restart_broker()
    world.run_until(farm.is_as_before)


def test_an_operators_fence_that_is_the_plans_own_stays(tmp_path: Path) -> None:
    world = World(journal=tmp_path, disk_lag_s=DISK_LAG_S)
    vehicle = fenced_vehicle(world)
    placed(vehicle, square())
    operators = vehicle.fence
    world.edge.plan(first_flight(), geofence=fence())
    world.run_until(lambda: world.edge.status(1201) == Status.RUNNING)
    world.restart_broker()
    world.run_until_over(1201)
    world.run_until(lambda: not list(tmp_path.iterdir()))
    assert vehicle.fence == operators


def test_nothing_is_written_before_a_start_and_nothing_is_left_behind_a_mission(
    tmp_path: Path,
) -> None:
    world = World(journal=tmp_path)
    world.add_vehicle()
    world.edge.plan(first_flight())
    world.run_until(lambda: any(s.state is State.ARMING for s in world.app.sessions.values()))
    assert list(tmp_path.iterdir()) == []
    world.run_until_over(1201)
    world.run_until(lambda: not list(tmp_path.iterdir()))


@pytest.mark.thorough
def test_a_vehicle_that_sends_its_number_late_keeps_its_page(tmp_path: Path) -> None:
    farm = Farm(tmp_path, PX4, WITH_FOLLOW)
    farm.world.run_until(lambda: farm.vehicle.custom_mode == PX4_FOLLOW)
    assert [page.name for page in tmp_path.iterdir()] == ["vehicle-1.json"]
    farm.vehicle.uid = 7
    farm.vehicle.send_version()
    farm.world.run(2.0)
    farm.world.restart_broker()
    farm.world.run_until((tmp_path / "vehicle-1-0000000000000007.json").exists)
    farm.world.run_until(lambda: not (tmp_path / "vehicle-1.json").exists())
    farm.world.run_until_over(1201)
    farm.world.run_until(farm.is_as_before)
