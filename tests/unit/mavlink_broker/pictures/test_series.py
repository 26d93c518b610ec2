"""A series is complete before the next command begins, and stays with its own mission."""

import dataclasses
import time
from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.pictures.announcements import MAX_NUMBERS, AnnouncementTracker, Capture
from tests.support.broker_world import World, go_home, mission, takeoff
from tests.support.scripted_camera import ScriptedCamera
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import PX4, PX4_POSITION
from tests.unit.mavlink_broker.microservices.harness import ROUTE

SLOW = dataclasses.replace(PX4, item_time_s=4.0)
ORBIT = mavlink.MAV_CMD_DO_ORBIT
MISSION = 1201


def image(command_id: int, count: int) -> dict[str, Any]:
    parameters = {"yaw_angle": 0, "pitch_angle": -90, "photo_count": count, "time_interval": 2}
    return {"command_id": command_id, "command_type_id": 4, "parameters": parameters}


def hotpoint(command_id: int) -> dict[str, Any]:
    parameters = {
        "latitude": 40.4434,
        "longitude": -3.7382,
        "orbit_altitude": 6,
        "radius": 6,
        "angular_velocity": 30,
        "start_point": 2,
        "orbit_type": 2,
    }
    return {"command_id": command_id, "command_type_id": 7, "parameters": parameters}


class Series:
    """A counted series, and a circle that is flown live behind it."""

    def __init__(self, *, with_camera: bool = True, loss: float = 0.0) -> None:
        self.world = World(loss=loss)
        self.vehicle: ScriptedVehicle = self.world.add_vehicle(script=SLOW)
        self.camera: ScriptedCamera | None = None
        if with_camera:
            self.camera = self.world.add_camera(self.vehicle, image_status=0)
        self.world.run(3.0)
        self.world.edge.plan(mission(takeoff(), image(2, 3), hotpoint(3), go_home(4)))

    def begin(self) -> None:
        """Fly until the items of the series are over, the camera still busy."""
        if self.camera is not None:
            self.camera.image_status = 3
        last = mavlink.MAV_CMD_NAV_DELAY
        self.world.run_until(lambda: last in [item.command for item in self.vehicle.items])
        delay = max(n for n, item in enumerate(self.vehicle.items) if item.command == last)
        self.world.run_until(lambda: self.vehicle.airborne and self.vehicle.current > delay)
        self.world.run(2.0)

    @property
    def has_circled(self) -> bool:
        return ORBIT in self.vehicle.commands

    @property
    def status(self) -> int:
        return self.world.edge.statuses(MISSION)[1]


@pytest.mark.first_case
@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_a_live_command_waits_until_the_camera_is_idle(loss: float) -> None:
    series = Series(loss=loss)
    series.begin()
    assert series.camera is not None
    series.world.run(8.0)
    assert not series.has_circled
    assert series.status == Status.RUNNING
    series.camera.image_status = 0
    # Its state is requested again and again, the less often the longer it takes
    series.world.run_until(lambda: series.has_circled, within_s=10.0 if loss == 0.0 else 30.0)
    assert series.status == Status.FINISHED


@pytest.mark.thorough
def test_a_camera_that_never_becomes_idle_is_not_waited_for_without_end() -> None:
    series = Series()
    series.begin()
    series.world.run_until(lambda: series.has_circled, within_s=40.0)


def test_a_camera_that_does_not_answer_is_not_waited_for() -> None:
    series = Series()
    assert series.camera is not None
    series.camera.is_silent = True
    series.begin()
    series.world.run_until(lambda: series.has_circled, within_s=10.0)


def test_a_vehicle_without_a_camera_goes_on() -> None:
    series = Series(with_camera=False)
    series.begin()
    series.world.run_until(lambda: series.has_circled, within_s=5.0)


def test_a_pilot_who_takes_over_meanwhile_ends_the_wait() -> None:
    series = Series()
    series.begin()
    series.vehicle.set_mode(PX4_POSITION)
    series.world.run_until_over(MISSION, within_s=20.0)
    assert series.world.edge.status(MISSION) == Status.FAILED
    assert not series.has_circled


class Sorties:
    """Two missions with a picture each, and a restart of the vehicle between."""

    def __init__(self) -> None:
        self.world = World()
        self.vehicle = self.world.add_vehicle(script=SLOW)
        self.camera = self.world.add_camera(self.vehicle)
        self.world.run(3.0)

    def fly(self, number: int, *, announced: bool = True) -> None:
        self.world.edge.plan(mission(takeoff(), image(2, 1), go_home(3), mission_id=number))

        def takes() -> bool:
            items = self.vehicle.items if self.vehicle.armed else []
            return bool(items) and items[self.vehicle.current].command == 2000

        self.world.run_until(takes)
        self.world.run(1.0)
        self.camera.shoot(announced=announced)

    def swap_battery(self) -> None:
        """Restart the vehicle; its camera goes on with its numbers."""
        self.world.run_until(lambda: not self.vehicle.armed)
        self.world.run(20.0)
        self.vehicle.reboot(self.world.clock.now)
        self.world.run(5.0)

    @property
    def names(self) -> list[str]:
        return [body["name"] for body in self.world.edge.bodies("/image/")]


@pytest.mark.thorough
def test_pictures_of_a_mission_behind_a_battery_swap_are_its_own() -> None:
    sorties = Sorties()
    for number in (1, 2, 3):
        sorties.fly(number)
        sorties.world.run_until_over(number)
        sorties.swap_battery()
    assert [name[: len("m1_c2")] for name in sorties.names] == ["m1_c2", "m2_c2", "m3_c2"]


def test_a_picture_of_before_the_swap_that_is_announced_late_is_not_the_next_missions() -> None:
    sorties = Sorties()
    sorties.fly(1, announced=False)
    late = sorties.camera.taken[-1]
    sorties.world.run_until_over(1)
    sorties.swap_battery()
    before = set(sorties.names)
    sorties.fly(2, announced=False)
    sorties.world.run(0.5)
    sorties.world.send_from(sorties.vehicle, late, mavlink.MAV_COMP_ID_CAMERA)
    sorties.world.run_until_over(2)
    sorties.world.run(10.0)
    new = [name for name in sorties.names if name not in before]
    assert not [name for name in new if name.startswith("m2") and name.endswith("0000.jpeg")]


def capture(number: int) -> Capture:
    return Capture(
        component=100,
        index=number,
        taken_s=float(number),
        has_succeeded=True,
        url="",
        identity=f"picture {number}",
    )


def test_the_memory_for_picture_numbers_is_limited() -> None:
    """By the work done, not by the clock: what is remembered is bounded, gaps are still found."""
    camera = AnnouncementTracker(100, ROUTE, RoundTrip())
    for number in range(3 * MAX_NUMBERS):
        assert camera.take(capture(number), goes_back=False)
    assert len(camera._announced) <= MAX_NUMBERS
    assert not camera.is_requesting
    assert camera.take(capture(3 * MAX_NUMBERS + 2), goes_back=False)
    messages, _ = camera.tick(time.monotonic())
    assert [int(message.param2) for message in messages] == [3 * MAX_NUMBERS, 3 * MAX_NUMBERS + 1]


def test_the_first_picture_of_a_camera_that_was_empty_is_waited_for() -> None:
    """The camera had none when its count was asked for, and the first announcement is lost."""
    camera = AnnouncementTracker(100, ROUTE, RoundTrip())
    camera.request_count(go_back=True)
    camera.take_count(0)
    assert camera.take(capture(1), goes_back=True)
    assert camera.lacks_before(1)
    assert camera.take(capture(0), goes_back=True)
    assert not camera.lacks_before(1)


def test_pictures_of_before_the_first_one_that_matters_are_not_waited_for() -> None:
    camera = AnnouncementTracker(100, ROUTE, RoundTrip())
    camera.request_count(go_back=True)
    camera.take_count(5)
    assert camera.take(capture(5), goes_back=True)
    assert camera.goes_back
    assert not camera.lacks_before(5)
