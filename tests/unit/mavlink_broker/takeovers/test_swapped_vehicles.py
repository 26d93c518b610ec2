"""Another aircraft takes the place of one that stands, while the broker runs; simulated time.

It has the same system id and address, and a hardware number and settings of its own. What the
broker notes from then on is of the new one, so that a restarted broker restores that one.
"""

from collections.abc import Callable
from pathlib import Path

import pytest

from afarcloud.enumerations import EventType, Status
from tests.support.broker_world import World, first_flight, follow, go_home, mission, takeoff
from tests.support.fenced_vehicle import FencedVehicle, fenced_vehicle
from tests.support.geofences import RALLY_POINT, fence, placed, square
from tests.support.overridden_settings import WITH_FOLLOW
from tests.support.scripted_disk import DISK_LAG_S
from tests.support.vehicle_script import PX4, PX4_FOLLOW

FIRST, SECOND = "vehicle-1-0000000000000006.json", "vehicle-1-0000000000000007.json"


class SwappedFarm:
    """A vehicle that stands, and is swapped for another one."""

    def __init__(self, folder: Path) -> None:
        self.world = World(journal=folder, disk_lag_s=DISK_LAG_S)
        self.vehicle: FencedVehicle = fenced_vehicle(self.world, PX4, values=WITH_FOLLOW)
        self.vehicle.uid = 6
        placed(self.vehicle, square(half_m=90.0))
        self.fence = self.vehicle.fence  # Of its owner
        self.world.run(10.0)

    def swap(self, away_s: float, *, on_for_s: float = 0.0) -> None:
        """Put another aircraft in its place, with a fence and values of its owner's.

        It has been switched on for a while.
        """
        self.vehicle.silent = True
        self.world.run(away_s)
        self.vehicle.silent = False
        self.vehicle.uid = 7
        self.vehicle.values = dict(WITH_FOLLOW, FLW_TGT_HT=9.0)
        placed(self.vehicle, square(half_m=80.0))
        self.vehicle.reboot(self.world.clock.now)
        self.vehicle.booted_at = self.world.clock.now - on_for_s
        self.settings = dict(self.vehicle.values), self.vehicle.fence

    def post(self) -> None:
        """Post a plan that changes fence and values."""
        self.world.edge.plan(
            mission(takeoff(), follow(altitude=12.0), go_home(3)),
            geofence=fence(max_altitude=60.0),
            rally_points=[RALLY_POINT],
        )

    def has_own_settings(self) -> bool:
        """Whether the second aircraft has again what its owner had set."""
        return (dict(self.vehicle.values), self.vehicle.fence) == self.settings


def _before(farm: SwappedFarm, away_s: float) -> None:
    farm.post()
    farm.world.run(1.0)
    farm.swap(away_s)


def _at_once(farm: SwappedFarm, away_s: float) -> None:
    farm.swap(away_s)
    farm.post()


def _a_second_later(farm: SwappedFarm, away_s: float) -> None:
    farm.swap(away_s)
    farm.world.run(1.0)
    farm.post()


def _value_set(farm: SwappedFarm) -> bool:
    return "GF_MAX_VER_DIST" in dict(farm.vehicle.set)


def _fence_stored(farm: SwappedFarm) -> bool:
    return farm.vehicle.fence != farm.fence


def _mission_stored(farm: SwappedFarm) -> bool:
    return bool(farm.vehicle.items)


@pytest.mark.first_case
@pytest.mark.parametrize("away_s", [3.0, 0.0, 0.5, 30.0])
@pytest.mark.parametrize("post_and_swap", [_at_once, _before, _a_second_later])
def test_a_swapped_vehicle_is_restored_by_a_restarted_broker(
    tmp_path: Path, post_and_swap: Callable[[SwappedFarm, float], None], away_s: float
) -> None:
    farm = SwappedFarm(tmp_path)
    post_and_swap(farm, away_s)
    farm.world.run_until(lambda: farm.vehicle.custom_mode == PX4_FOLLOW)
    assert (tmp_path / SECOND).exists()
    farm.world.kill_broker()
    farm.world.run(1.0)
    farm.world.restart_broker()
    farm.world.run_until_over(1201)
    assert farm.world.edge.status(1201) == Status.FINISHED
    farm.world.run_until(lambda: farm.has_own_settings() and not (tmp_path / SECOND).exists())


def test_a_vehicle_that_waits_with_the_firsts_fence_keeps_the_record_of_the_first(
    tmp_path: Path,
) -> None:
    farm = SwappedFarm(tmp_path)
    farm.post()
    farm.world.run_until(lambda: _fence_stored(farm))
    farm.swap(away_s=3.0)
    farm.world.run_until_over(1201)
    farm.world.run_until(lambda: farm.has_own_settings() and not (tmp_path / SECOND).exists())
    assert (tmp_path / FIRST).exists()


def test_an_abort_of_a_swapped_vehicle_is_known_behind_a_kill_of_the_broker(
    tmp_path: Path,
) -> None:
    farm = SwappedFarm(tmp_path)
    farm.swap(away_s=3.0)
    farm.world.edge.plan(first_flight())
    farm.world.run_until(lambda: farm.world.edge.status(1201) == Status.RUNNING)
    farm.world.run(5.0)
    farm.vehicle.silent = True
    farm.world.edge.event(EventType.ABORT_MISSION)
    farm.world.run(2.0)
    assert (tmp_path / SECOND).exists()
    assert not (tmp_path / FIRST).exists()
    farm.world.kill_broker()
    farm.vehicle.silent = False
    farm.world.restart_broker()
    farm.world.edge.take_work()  # It is out of reach: the journal alone knows of the abort
    farm.world.run_until(lambda: not farm.vehicle.armed)


def test_a_vehicle_that_shows_its_number_late_is_restored_all_the_same(tmp_path: Path) -> None:
    """The restarted broker receives the vehicle and is not received by it, for a while."""
    farm = SwappedFarm(tmp_path)
    farm.swap(away_s=3.0)
    farm.post()
    farm.world.run_until(lambda: farm.vehicle.custom_mode == PX4_FOLLOW)
    farm.world.kill_broker()
    farm.world.restart_broker()
    farm.world.air.is_uplink_up = False
    farm.world.run(20.0)
    farm.world.air.is_uplink_up = True
    farm.world.run_until(lambda: farm.has_own_settings() and not (tmp_path / SECOND).exists())


@pytest.mark.parametrize(("away_s", "deaf_s"), [(3.5, 0.0), (10.0, 0.0), (3.5, 12.0)])
@pytest.mark.parametrize("on_for_s", [20.0, 60.0])
@pytest.mark.parametrize("moment", [_value_set, _fence_stored, _mission_stored])
def test_an_aircraft_that_was_switched_on_before_is_no_continuation_of_the_first(
    tmp_path: Path,
    moment: Callable[[SwappedFarm], bool],
    on_for_s: float,
    away_s: float,
    deaf_s: float,
) -> None:
    """Its clock is ahead of the last one of the first, whose fence was placed already.

    It may be received for a while before it receives.
    """
    farm = SwappedFarm(tmp_path)
    farm.post()
    farm.world.run_until(lambda: moment(farm))
    farm.world.air.is_uplink_up = False
    farm.world.run(0.5)
    farm.swap(away_s, on_for_s=on_for_s)
    farm.world.run(deaf_s)
    farm.world.air.is_uplink_up = True
    farm.world.run_until(lambda: farm.vehicle.armed)
    assert farm.vehicle.fence != farm.settings[1]
    assert farm.vehicle.values["GF_MAX_VER_DIST"] == 60.0
    farm.world.run_until_over(1201)
    assert farm.world.edge.status(1201) == Status.FINISHED
    farm.world.run_until(farm.has_own_settings)
    assert (tmp_path / FIRST).exists()
