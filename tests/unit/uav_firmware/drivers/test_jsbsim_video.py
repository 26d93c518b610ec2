"""Video of the simulated vehicle: recordings in real files, and a live view that closes at once."""

import io
import socket
import subprocess
import threading
import urllib.request
from itertools import count, pairwise
from pathlib import Path
from threading import Thread

import pytest
from PIL import Image

from sim.config import SimulationConfig
from sim.fault_schedule import Fault, Kind
from sim.simulation import Simulation
from tests.support.system import free_ports, wait_for
from tests.unit.sim.camera.film.test_motion_jpeg import played
from uav_firmware.cal.camera import Exposure, FilmGrowth, SecondPicture
from uav_firmware.drivers.file_tree import image_tree
from uav_firmware.drivers.jsbsim_video import RECORDER_PENDING_MAX, JsbsimRecorder, JsbsimStreamer
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
    for number in range(1, 3 * RECORDER_PENDING_MAX):
        films.add_frame(exposure(200_000 * number))
    films.end_film()
    size = all_growth(films)
    content = (tmp_path / "image" / name).read_bytes()
    assert len(played(content)[1]) == 3 * RECORDER_PENDING_MAX
    assert 0 <= len(content) - size < 400
    films.close()


@pytest.mark.thorough
def test_in_real_time_the_film_stands_still_where_frames_are_left_out(tmp_path: Path) -> None:
    films = recorder(tmp_path, Simulation(SimulationConfig()), in_step=False)
    (name,) = films.begin_film(exposure(), 5.0)
    for number in range(1, 20 * RECORDER_PENDING_MAX):
        films.add_frame(exposure(200_000 * number))
    films.end_film()
    all_growth(films)
    _, frames = played((tmp_path / "image" / name).read_bytes())
    assert len(frames) == 20 * RECORDER_PENDING_MAX
    made = sum(a is None or a != b for a, b in pairwise([None, *frames]))
    assert made < 20 * RECORDER_PENDING_MAX
    films.close()


def test_a_dead_camera_records_nothing(tmp_path: Path) -> None:
    simulation = Simulation(SimulationConfig())
    films = recorder(tmp_path, simulation)
    simulation.add_fault(Fault(kind=Kind.CAMERA_FAILURE))
    with pytest.raises(OSError, match="does not answer"):
        films.begin_film(exposure(), 5.0)
    assert films.film_growth() == FilmGrowth(0)


def streamer() -> tuple[JsbsimStreamer, int]:
    (port,) = free_ports(1)
    return JsbsimStreamer(Simulation(SimulationConfig()), port), port


def test_who_looks_as_soon_as_it_is_shown_sees_a_frame() -> None:
    live, port = streamer()
    live.show(exposure(), 4.0)
    seen: list[bytes] = []
    address = f"http://127.0.0.1:{port}/snapshot.jpg"
    viewer = Thread(target=lambda: seen.append(urllib.request.urlopen(address).read()), daemon=True)
    viewer.start()
    times = count(250_000, 250_000)

    def has_seen() -> bool:
        assert live.show(exposure(next(times)), 4.0) == ""
        return bool(seen)

    wait_for(has_seen, "a frame")
    assert Image.open(io.BytesIO(seen[0])).size == (160, 120)
    live.close()


def test_an_occupied_port_is_reported_at_once() -> None:
    live, port = streamer()
    with socket.create_server(("127.0.0.1", port)), pytest.raises(OSError, match="in use"):
        live.show(exposure(), 4.0)
    live.close()


def test_a_view_that_is_closed_gives_its_port_back_and_may_begin_again() -> None:
    live, port = streamer()
    for _ in range(2):
        live.show(exposure(), 4.0)
        live.close()
        socket.create_server(("127.0.0.1", port)).close()


def test_a_view_that_nobody_looks_at_costs_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    live, _port = streamer()
    monkeypatch.setattr(subprocess, "Popen", None)
    for _ in range(3):
        assert live.show(exposure(), 4.0) == ""
    live.close()


def test_closing_a_view_waits_for_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """The control loop closes it: the process beside may hang as long as it likes."""
    live, port = streamer()
    live.show(exposure(), 4.0)
    viewer = socket.create_connection(("127.0.0.1", port))
    live.show(exposure(), 4.0)
    main_thread = threading.get_ident()
    ended = threading.Event()
    wait = subprocess.Popen.wait

    def watched_wait(process: "subprocess.Popen[bytes]", timeout: float | None = None) -> int:
        assert threading.get_ident() != main_thread
        code = wait(process, timeout)
        ended.set()
        return code

    monkeypatch.setattr(subprocess.Popen, "wait", watched_wait)
    live.close()
    live.show(exposure(), 4.0)  # Its port is free although the former process still ends
    live.close()
    assert ended.wait(30.0)
    viewer.close()
    socket.create_server(("127.0.0.1", port)).close()
