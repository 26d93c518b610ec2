"""Frames are made while somebody looks, and reach everybody who does."""

import http.client
import io
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from PIL import Image

from sim.camera.darkroom import Darkroom
from sim.camera.live import VIEWERS_MAX, Screen, serve
from tests.support.system import free_ports, wait_for
from tests.unit.sim.camera.test_studio import frame


class Viewer:
    """Somebody who looks, over HTTP."""

    def __init__(self, port: int, path: str) -> None:
        self._connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30.0)
        self._connection.request("GET", path)

    def open(self) -> http.client.HTTPResponse:
        return self._connection.getresponse()

    def close(self) -> None:
        self._connection.close()


def parts(response: http.client.HTTPResponse, count: int) -> Iterator[bytes]:
    """Frames of a stream."""
    for _ in range(count):
        assert response.readline().strip() == b"--frame"
        headers = {}
        while line := response.readline().strip():
            name, _, value = line.partition(b": ")
            headers[name.lower()] = value
        assert headers[b"content-type"] == b"image/jpeg"
        yield response.read(int(headers[b"content-length"]))
        assert response.readline() == b"\r\n"


def wait_for_viewers(screen: Screen) -> None:
    wait_for(lambda: screen.is_watched, "a viewer")


def test_everybody_sees_the_frames_in_their_order() -> None:
    screen = Screen()
    server = serve(screen, 0)
    viewer = Viewer(server.server_port, "/stream")
    wait_for_viewers(screen)
    screen.show(b"one")
    stream = parts(viewer.open(), 2)
    assert next(stream) == b"one"
    screen.show(b"two")
    assert next(stream) == b"two"
    viewer.close()
    server.shutdown()
    server.server_close()


def test_what_is_not_there_is_not_found() -> None:
    server = serve(Screen(), 0)
    viewer = Viewer(server.server_port, "/../../etc/passwd")
    assert viewer.open().status == 404
    viewer.close()
    server.shutdown()
    server.server_close()


def test_the_process_shows_the_farm_to_a_viewer(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    darkroom = Darkroom((sys.executable, "-m", "sim.camera.live", str(port)))
    darkroom.begin(frame(tmp_path, 0))
    assert darkroom.finished(wait=True)[0].error == ""
    viewer = Viewer(port, "/snapshot.jpg")
    for number in range(1, 400):
        darkroom.begin(frame(tmp_path, number))
        darkroom.finished(wait=True)
    picture = Image.open(io.BytesIO(viewer.open().read()))
    assert picture.size == (160, 120)
    viewer.close()
    darkroom.close()


def test_a_port_that_is_taken_is_said(tmp_path: Path) -> None:
    server = serve(Screen(), 0)
    darkroom = Darkroom((sys.executable, "-m", "sim.camera.live", str(server.server_port)))
    darkroom.begin(frame(tmp_path, 0))
    assert "in use" in darkroom.finished(wait=True)[0].error
    darkroom.close()
    server.shutdown()
    server.server_close()


def test_a_viewer_who_takes_no_frames_is_let_go() -> None:
    screen = Screen()
    server = serve(screen, 0, patience_s=0.2)
    viewer = Viewer(server.server_port, "/stream")
    wait_for_viewers(screen)

    def nobody_looks() -> bool:
        screen.show(b"x" * 1_000_000)
        return not screen.is_watched

    wait_for(nobody_looks, "the viewer to be let go")
    viewer.close()
    server.shutdown()
    server.server_close()


def test_more_viewers_than_are_served_are_told_so() -> None:
    screen = Screen()
    server = serve(screen, 0)
    for _ in range(VIEWERS_MAX):
        assert screen.enter() is not None
    viewer = Viewer(server.server_port, "/stream")
    assert viewer.open().status == 503
    viewer.close()
    screen.leave()
    assert screen.enter() is not None
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize("path", ["/stream", "/snapshot.jpg"])
def test_nobody_looks_any_more_when_the_viewer_has_gone(path: str) -> None:
    screen = Screen()
    server = serve(screen, 0)
    viewer = Viewer(server.server_port, path)
    wait_for_viewers(screen)
    viewer.close()

    def nobody_looks() -> bool:
        screen.show(b"x" * 100_000)
        return not screen.is_watched

    wait_for(nobody_looks, "the viewer to be gone")
    server.shutdown()
    server.server_close()
