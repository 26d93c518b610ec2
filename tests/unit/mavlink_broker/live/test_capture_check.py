"""A panorama whose final answer is lost is judged by its pictures before it is ordered again."""

from typing import Any

import pytest

from afarcloud.enumerations import Status
from mavlink_broker.mavlink.dialect import Message, mavlink
from tests.support.autopilot_families import OWN
from tests.support.broker_world import World, go_home, mission, takeoff
from tests.support.scripted_camera import ScriptedCamera
from tests.support.scripted_vehicle import ScriptedVehicle
from tests.support.vehicle_script import Script

CREATE = mavlink.MAV_CMD_PANORAMA_CREATE
ANSWERS_KEPT_S = 5.0
"""As this project's vehicle: what comes again later is carried out again."""


class Panorama(ScriptedVehicle):
    """Takes pictures for some seconds on request, and loses its answers to that."""

    def __init__(self, script: Script, *, booted_at: float) -> None:
        super().__init__(1, script, booted_at=booted_at)
        self.camera: ScriptedCamera | None = None
        self.pictures = 6
        self.says_progress = True
        self.is_final_lost = True
        self.begun: list[float] = []  # When it began a panorama
        self.pictures_due: list[float] = []

    def _command(self, message: Message) -> None:
        if message.command != CREATE:
            super()._command(message)
        elif not self._is_known(message):
            self.begun.append(self._now)
            self.pictures_due = [self._now + 1.0 + number for number in range(self.pictures)]
            self._progress()
        elif self.pictures_due:
            self._progress()

    def _is_known(self, message: Message) -> bool:
        """Whether it is a repetition of what was answered a short while ago."""
        ended = self.begun[-1] + 1.0 + self.pictures if self.begun else -1e9
        return message.confirmation > 0 and self._now - ended < ANSWERS_KEPT_S

    def _progress(self) -> None:
        if self.says_progress:
            working = mavlink.MAV_RESULT_IN_PROGRESS
            self._send(mavlink.MAVLink_command_ack_message(CREATE, working))

    def step(self, now: float) -> list[bytes]:
        assert self.camera is not None
        self.camera.image_status = int(bool(self.pictures_due))
        while self.pictures_due and now >= self.pictures_due[0]:
            self.pictures_due.pop(0)
            self.camera.shoot()
            self._progress()
            if not self.pictures_due and not self.is_final_lost:
                self._send(mavlink.MAVLink_command_ack_message(CREATE, 0))
        return super().step(now)


def flown(**how: Any) -> tuple[World, Panorama]:
    world = World()
    vehicle = Panorama(OWN, booted_at=world.clock.now)
    for name, value in how.items():
        setattr(vehicle, name, value)
    world.air.vehicles["192.0.2.1", 14581] = vehicle
    vehicle.camera = world.add_camera(vehicle)
    world.run(3.0)
    panorama = {"command_id": 2, "command_type_id": 10, "parameters": {"panorama_mode": 1}}
    world.edge.plan(mission(takeoff(), panorama, go_home(3)))
    return world, vehicle


@pytest.mark.first_case
@pytest.mark.parametrize("says_progress", [True, False], ids=["progress", "pictures alone"])
def test_a_panorama_that_was_taken_is_not_ordered_again(says_progress: bool) -> None:
    world, vehicle = flown(says_progress=says_progress)
    world.run_until_over(1201)
    assert world.edge.statuses(1201) == [Status.FINISHED] * 3
    assert len(vehicle.begun) == 1
    assert vehicle.camera is not None
    assert len(vehicle.camera.taken) == 6


def test_a_final_answer_that_comes_is_not_waited_beyond() -> None:
    world, vehicle = flown(is_final_lost=False)
    world.run_until(lambda: vehicle.begun)
    world.run_until(lambda: world.edge.statuses(1201)[1] == Status.FINISHED, within_s=8.0)
    assert len(vehicle.begun) == 1


def test_one_of_which_nothing_was_captured_is_ordered_again() -> None:
    world, vehicle = flown(pictures=0)
    world.run_until(lambda: len(vehicle.begun) == 1)
    world.run_until(lambda: len(vehicle.begun) == 2, within_s=30.0)


@pytest.mark.thorough
def test_a_camera_at_work_is_waited_for_however_long_it_is_silent() -> None:
    world, vehicle = flown(says_progress=False, pictures=1)
    world.run_until(lambda: vehicle.begun)
    world.run(1.5)
    vehicle.pictures_due = [world.clock.now + 40.0]
    world.run(30.0)
    assert world.edge.statuses(1201)[1] != Status.FINISHED
    world.run_until_over(1201)
    assert len(vehicle.begun) == 1


@pytest.mark.first_case
@pytest.mark.parametrize(("pictures", "ends"), [(6, Status.FINISHED), (0, Status.FAILED)])
def test_a_second_camera_that_is_silent_does_not_hold_it_up_for_ever(
    pictures: int, ends: Status
) -> None:
    world, vehicle = flown(pictures=pictures)
    second = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 4, 3)
    world.send_from(vehicle, second, mavlink.MAV_COMP_ID_CAMERA2)
    world.run_until(lambda: vehicle.begun)
    world.run_until(lambda: world.edge.statuses(1201)[1] == ends, within_s=60.0)
    assert len(vehicle.begun) == 1
    if ends is Status.FAILED:
        message = world.edge.reports(1201)[-1]["message"]
        assert "camera 101 has not reported for 20 s whether it has ended" in message
