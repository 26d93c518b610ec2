"""A whole vehicle takes pictures in step: the same flight, the same reports, no flight changed."""

from pathlib import Path
from typing import NamedTuple

import pytest

from sim.config import SimulationConfig
from sim.physics.truth import Truth
from sim.simulation import Simulation
from tests.support.ground_station import MemoryLink
from tests.support.messages import said
from uav_firmware.bus import Queue
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.file_tree import image_folder, image_tree
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.drivers.jsbsim_camera import STORING_US, JsbsimCamera
from uav_firmware.module_errors import end_flight
from uav_firmware.msg.payload import CameraEvent, ImageCaptured, PayloadCommand
from uav_firmware.msg.status import VehicleCommand
from uav_firmware.topology import Autopilot

ORDERED_US, PICTURES, END_US = 2_000_000, 2, 5_000_000


class Run(NamedTuple):
    """What a vehicle has done and reported."""

    truth: Truth
    reported: list[tuple[int, ImageCaptured]]  # When [us], what
    files: dict[str, bytes]


class PictureRecorder(Queue[CameraEvent]):
    """Records the reports of pictures, and when."""

    def __init__(self, vehicle: JsbsimVehicle) -> None:
        super().__init__()
        self.vehicle = vehicle
        self.reported: list[tuple[int, ImageCaptured]] = []

    def publish(self, item: CameraEvent) -> None:
        assert isinstance(item, ImageCaptured)
        self.reported.append((self.vehicle.time_us, item))


def run(folder: Path, *, with_camera: bool) -> Run:
    """Stand on the yard, and take two pictures after two seconds."""
    simulation = Simulation(SimulationConfig(seed=5))
    camera = JsbsimCamera(
        simulation, image_folder(folder), image_tree(folder).room, serial="1", in_step=True
    )
    vehicle = JsbsimVehicle(simulation, camera=camera if with_camera else None)
    autopilot = Autopilot(
        vehicle,
        MemoryLink(),
        FileStorage(folder),
        system_id=1,
        peers=(),
        boot_time_utc_us=simulation.config.start_time_utc_us,
        write_line=lambda _time_us, _text: None,
        on_error=end_flight,
    )
    autopilot.registry.set("CAM_IMAGE_WIDTH", 1152)
    recorder = PictureRecorder(vehicle)
    autopilot.payload._camera_event = recorder
    ordered = False
    while vehicle.time_us < END_US:
        if not ordered and vehicle.time_us >= ORDERED_US:
            ordered = True
            order = VehicleCommand(
                ORDERED_US, PayloadCommand.IMAGE_START_CAPTURE,
                0.0, 1.0, float(PICTURES), 0.0, 0.0, 0.0, 0.0, 0, 255, 190, 1,
            )  # fmt: skip
            autopilot.topics.payload_order.publish(order)
        autopilot.scheduler.step()
    vehicle.close()
    files = {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.jpg")}
    return Run(simulation.truth, recorder.reported, files)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(tmp_path_factory.mktemp("flown"), with_camera=True)


@pytest.mark.thorough
def test_the_same_flight_has_the_same_pictures_and_reports(flown: Run, tmp_path: Path) -> None:
    again = run(tmp_path, with_camera=True)
    assert said(again.truth) == said(flown.truth)
    assert (again.reported, again.files) == (flown.reported, flown.files)
    assert len(flown.reported) == PICTURES
    assert len(flown.files) == 2 * PICTURES  # Each with its small copy
    for reported_us, image in flown.reported:
        assert image.succeeded
        assert STORING_US <= reported_us - image.time_us <= STORING_US + 80_000
        assert f"image/{image.file_url.rpartition('/')[2]}" in flown.files


@pytest.mark.thorough
def test_no_flight_is_changed_by_its_camera(flown: Run, tmp_path: Path) -> None:
    assert said(run(tmp_path, with_camera=False).truth) == said(flown.truth)
