"""The simulated vehicle's camera: true pose, believed place, files, memory, failure."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from sim.camera.film.orders import Frame, Order
from sim.camera.film.render_process import Rendered, RenderProcess
from sim.config import SimulationConfig
from sim.fault_schedule import Fault, Kind
from sim.physics.truth import quaternion_from_euler
from sim.simulation import Simulation
from tests.unit.sim.camera.surveyor import read
from uav_firmware.cal.camera import Exposure, Outcome, SecondPicture
from uav_firmware.drivers.file_tree import image_folder, image_tree
from uav_firmware.drivers.jsbsim_camera import ERASED_AT_ONCE, MEMORY, STORING_US, JsbsimCamera
from uav_firmware.modules.payload.camera.lens import lens

LEVEL = (1.0, 0.0, 0.0, 0.0)
DOWN = quaternion_from_euler(0.0, -0.5 * math.pi, 0.0)


def exposure(index: int = 0, time_us: int = 0, width_px: int = 1152) -> Exposure:
    return Exposure(
        time_us,
        1_780_300_800_000_000 + time_us,
        index,
        lens(width_px),
        40.44341,
        -3.73821,
        651.5,
        1.5,
        DOWN,
        LEVEL,
        SecondPicture.NONE,
    )


class Notebook(RenderProcess):
    """Notes the orders; they end when the test says so."""

    def __init__(self) -> None:
        super().__init__()
        self.orders: list[Order] = []
        self.ends: list[Rendered] = []
        self.waited = 0

    def begin(self, order: Order | Frame) -> None:
        assert isinstance(order, Order)
        self.orders.append(order)

    def finished(self, *, wait: bool = False) -> list[Rendered]:
        self.waited += wait
        if wait and not self.ends:
            self.end()
        found, self.ends = self.ends, []
        return found

    def end(self, error: str = "") -> None:
        self.ends += [Rendered(order.number, 1000, 2, error) for order in self.orders]
        self.orders.clear()


class Rig:
    """A camera on a simulation, with a notebook for a render_process or a real one."""

    def __init__(
        self,
        folder: Path,
        render_process: RenderProcess,
        *,
        in_step: bool,
        hurried: bool = False,
        broken: Kind | None = None,
    ) -> None:
        faults = () if broken is None else (Fault(kind=broken),)
        self.simulation = Simulation(SimulationConfig(faults=faults))
        self.images = image_tree(folder)
        self.camera = JsbsimCamera(
            self.simulation,
            image_folder(folder),
            self.images.room,
            serial="F450-0007",
            in_step=in_step,
            hurried=hurried,
            render_process=render_process,
        )


@pytest.fixture
def real(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path, RenderProcess(), in_step=True)
    yield rig
    rig.camera.close()


@pytest.mark.thorough
def test_a_picture_lies_on_the_card_with_what_the_vehicle_believes(
    real: Rig, tmp_path: Path
) -> None:
    real.camera.expose(exposure())
    (outcome,) = real.camera.collect(STORING_US)
    assert outcome.picture is not None
    (name,) = outcome.picture.place
    survey, pixels = read((tmp_path / "image" / name).read_bytes())
    assert survey.latitude_deg == pytest.approx(40.44341, abs=1e-8)
    assert survey.longitude_deg == pytest.approx(-3.73821, abs=1e-8)
    assert survey.altitude_m == pytest.approx(651.5)
    assert pixels.shape == (864, 1152, 3)
    assert [entry.name for entry in real.images.entries(())] == [name, "thumbnail"]
    assert real.camera.used_bytes == outcome.picture.size_bytes
    assert real.camera.erase()
    assert real.camera.used_bytes == 0
    assert [entry.name for entry in real.images.entries(())] == ["thumbnail"]


def test_a_full_card_is_erased_few_files_at_a_time_and_what_comes_meanwhile_stays(
    tmp_path: Path,
) -> None:
    rig = Rig(tmp_path, Notebook(), in_step=False)
    folder = tmp_path / "image"
    folder.mkdir(exist_ok=True)
    for number in range(3 * ERASED_AT_ONCE):
        (folder / f"{number:03}.jpg").write_bytes(b"picture")
    assert not rig.camera.erase()
    assert len(list(folder.glob("*.jpg"))) == 2 * ERASED_AT_ONCE
    (folder / "new.jpg").write_bytes(b"picture")
    next(folder.glob("0*.jpg")).unlink()  # By a peer, over MAVFTP
    assert not rig.camera.erase()
    assert rig.camera.erase()
    assert [path.name for path in folder.glob("*.jpg")] == ["new.jpg"]


def test_the_picture_is_taken_from_the_true_place_and_attitude(tmp_path: Path) -> None:
    notebook = Notebook()
    rig = Rig(tmp_path, notebook, in_step=False)
    truth = rig.simulation.truth
    believed = quaternion_from_euler(0.0, 0.0, math.radians(4.0))  # Four degrees off in yaw
    rig.camera.expose(exposure()._replace(q_ned_frd=believed))
    (order,) = notebook.orders
    assert order.pose[:3] == (truth.latitude_deg, truth.longitude_deg, truth.altitude_amsl_m)
    seen, reported = order.pose.q_ned_camera, order.estimate.q_ned_camera
    apart = 2.0 * math.degrees(
        math.acos(min(1.0, abs(sum(a * b for a, b in zip(seen, reported, strict=True)))))
    )
    assert reported == DOWN
    assert apart == pytest.approx(4.0, abs=0.5)  # The vehicle stands a third of a degree nose down
    assert order.estimate.serial == "F450-0007"


def test_an_unknown_place_is_left_out(tmp_path: Path) -> None:
    notebook = Notebook()
    rig = Rig(tmp_path, notebook, in_step=False)
    nan = math.nan
    rig.camera.expose(exposure()._replace(latitude_deg=nan, longitude_deg=nan, altitude_amsl_m=nan))
    assert notebook.orders[0].estimate.latitude_deg is None
    assert notebook.orders[0].estimate.altitude_amsl_m is None


def indices(outcomes: Sequence[Outcome]) -> list[int]:
    return [outcome.image_index for outcome in outcomes]


def test_in_step_a_picture_is_stored_at_its_time_and_not_before(tmp_path: Path) -> None:
    notebook = Notebook()
    camera = Rig(tmp_path, notebook, in_step=True).camera
    camera.expose(exposure(0, 1_000_000))
    camera.expose(exposure(1, 1_500_000))
    assert camera.collect(1_000_000 + STORING_US - 1) == []
    assert indices(camera.collect(1_000_000 + STORING_US)) == [0]
    assert notebook.waited == 1
    assert indices(camera.collect(1_500_000 + STORING_US)) == [1]


def test_in_real_time_nobody_waits_and_a_full_memory_says_so(tmp_path: Path) -> None:
    notebook = Notebook()
    camera = Rig(tmp_path, notebook, in_step=False).camera
    for index in range(MEMORY):
        assert camera.is_ready
        camera.expose(exposure(index))
    assert not camera.is_ready
    with pytest.raises(OSError, match="memory"):
        camera.expose(exposure(MEMORY))
    assert camera.collect(10**9) == []
    notebook.end()
    assert indices(camera.collect(10**9)) == list(range(MEMORY))
    assert notebook.waited == 0
    assert camera.is_ready


def test_a_hurried_flight_waits_when_the_memory_is_full_and_only_then(tmp_path: Path) -> None:
    notebook = Notebook()
    camera = Rig(tmp_path, notebook, in_step=False, hurried=True).camera
    for index in range(MEMORY):
        assert not camera.collect(0)
        camera.expose(exposure(index))
    assert notebook.waited == 0
    assert indices(camera.collect(0)) == list(range(MEMORY))
    assert notebook.waited == 1


def test_a_picture_that_is_lost_is_told_with_its_reason(tmp_path: Path) -> None:
    notebook = Notebook()
    camera = Rig(tmp_path, notebook, in_step=False).camera
    camera.expose(exposure(4))
    notebook.end("No space left on device")
    assert camera.collect(0) == [Outcome(4, None, "No space left on device")]
    assert camera.used_bytes == 0


def test_a_broken_camera_does_not_expose_until_it_is_mended(tmp_path: Path) -> None:
    notebook = Notebook()
    rig = Rig(tmp_path, notebook, in_step=False, broken=Kind.CAMERA_FAILURE)
    with pytest.raises(OSError, match="does not answer"):
        rig.camera.expose(exposure())
    rig.simulation.clear_faults(Kind.CAMERA_FAILURE)
    rig.camera.expose(exposure())
    assert len(notebook.orders) == 1


def test_no_picture_takes_the_name_of_another(tmp_path: Path) -> None:
    notebook = Notebook()
    camera = Rig(tmp_path, notebook, in_step=False).camera
    camera.expose(exposure())
    (first,) = notebook.orders
    Path(first.path).parent.mkdir(parents=True)
    Path(first.path).write_bytes(b"of an earlier flight")
    camera.expose(exposure())
    assert notebook.orders[1].path != first.path
    assert Path(notebook.orders[1].path).name.startswith("20260601_080000_0000")
