"""The live view of the simulated vehicle: there as soon as it is shown, gone when it is closed."""

import io
import socket
import subprocess
import threading
import urllib.request
from itertools import count
from threading import Thread

import pytest
from PIL import Image

from sim.config import SimulationConfig
from sim.simulation import Simulation
from tests.support.system import free_ports, wait_for
from tests.unit.uav_firmware.drivers.test_jsbsim_recorder import exposure
from uav_firmware.drivers.jsbsim_streamer import JsbsimStreamer


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


def test_a_port_that_is_taken_is_said_at_once() -> None:
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


def test_closing_a_view_waits_for_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """The control loop closes it: the process beside may hang as long as it likes."""
    live, port = streamer()
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
    socket.create_server(("127.0.0.1", port)).close()
