"""Films of the simulated vehicle: real files, and no frame that holds up a flight."""

from itertools import pairwise
from pathlib import Path

import pytest

from sim.config import SimulationConfig
from sim.fault_schedule import Fault, Kind
from sim.simulation import Simulation
from tests.unit.sim.camera.film.test_motion_jpeg import played
from uav_firmware.cal.camera import Exposure, FilmGrowth, SecondPicture
from uav_firmware.drivers.jsbsim_recorder import UNDER_WAY, JsbsimRecorder
from uav_firmware.drivers.storage_card import image_tree
from uav_firmware.msg.payload import CameraLens

LEVEL = (1.0, 0.0, 0.0, 0.0)
LENS = CameraLens(4.5, 6.3, 4.725, 160, 120)


def exposure(time_us: int = 0) -> Exposure:
    return Exposure(
        time_us, 1_780_308_000_000_000, 1, LENS, 40.4434, -3.7382, 650.0, 0.0, LEVEL, LEVEL,
        SecondPicture.NONE,
    )  # fmt: skip


def recorder(folder: Path, simulation: Simulation, *, in_step: bool = True) -> JsbsimRecorder:
    tree = image_tree(folder)
    return JsbsimRecorder(simulation, folder / "image", tree.room, in_step=in_step)


def all_growth(films: JsbsimRecorder) -> int:
    """Bytes stored until everything ordered has been."""
    size = 0
    while films.is_busy:
        size += films.film_growth().size_bytes
    return size + films.film_growth().size_bytes


@pytest.mark.thorough
def test_a_film_is_a_file_that_holds_every_frame_when_time_waits(tmp_path: Path) -> None:
    films = recorder(tmp_path, Simulation(SimulationConfig()))
    (name,) = films.begin_film(exposure(), 5.0)
    for number in range(1, 3 * UNDER_WAY):
        films.add_frame(exposure(200_000 * number))
    films.end_film()
    size = all_growth(films)
    content = (tmp_path / "image" / name).read_bytes()
    assert len(played(content)[1]) == 3 * UNDER_WAY
    assert 0 <= len(content) - size < 400
    films.close()


@pytest.mark.thorough
def test_in_real_time_the_film_stands_still_where_frames_are_left_out(tmp_path: Path) -> None:
    films = recorder(tmp_path, Simulation(SimulationConfig()), in_step=False)
    (name,) = films.begin_film(exposure(), 5.0)
    for number in range(1, 20 * UNDER_WAY):
        films.add_frame(exposure(200_000 * number))
    films.end_film()
    all_growth(films)
    _, frames = played((tmp_path / "image" / name).read_bytes())
    assert len(frames) == 20 * UNDER_WAY
    made = sum(a is None or a != b for a, b in pairwise([None, *frames]))
    assert made < 20 * UNDER_WAY
    films.close()


def test_a_dead_camera_records_nothing(tmp_path: Path) -> None:
    simulation = Simulation(SimulationConfig())
    films = recorder(tmp_path, simulation)
    simulation.add_fault(Fault(kind=Kind.CAMERA_FAILURE))
    with pytest.raises(OSError, match="does not answer"):
        films.begin_film(exposure(), 5.0)
    assert films.film_growth() == FilmGrowth(0)
