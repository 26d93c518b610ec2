"""Frames are made while somebody looks, and reach everybody who does."""

import http.client
import io
import queue
import socket
import sys
import threading
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest
from PIL import Image

from sim.camera.film.live_view import VIEWERS_MAX, Screen, serve
from sim.camera.film.render_process import RenderProcess
from tests.support.system import wait_for
from tests.unit.sim.camera.film.test_video_files import frame


class Viewer:
    """Somebody who looks, over HTTP."""

    def __init__(self, port: int, path: str) -> None:
        self._connection = http.client.HTTPConnection("127.0.0.1", port, timeout=30.0)
        self._connection.request("GET", path)

    def open(self) -> http.client.HTTPResponse:
        return self._connection.getresponse()

    def close(self) -> None:
        self._connection.close()


def parts(response: http.client.HTTPResponse, number: int) -> Iterator[bytes]:
    """Frames of a stream."""
    for _ in range(number):
        assert response.readline().strip() == b"--frame"
        headers = {}
        while line := response.readline().strip():
            name, _, value = line.partition(b": ")
            headers[name.lower()] = value
        assert headers[b"content-type"] == b"image/jpeg"
        yield response.read(int(headers[b"content-length"]))
        assert response.readline() == b"\r\n"


def listening() -> socket.socket:
    """On a port that the system chooses."""
    return socket.create_server(("127.0.0.1", 0))


def wait_for_viewers(screen: Screen) -> None:
    wait_for(lambda: screen.is_watched, "a viewer")


def test_everybody_sees_the_frames_in_their_order() -> None:
    screen = Screen()
    server = serve(screen, listening())
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
    server = serve(Screen(), listening())
    viewer = Viewer(server.server_port, "/../../etc/passwd")
    assert viewer.open().status == 404
    viewer.close()
    server.shutdown()
    server.server_close()


@pytest.mark.thorough
def test_who_comes_while_the_process_starts_is_kept_waiting(tmp_path: Path) -> None:
    port = listening()
    viewer = Viewer(port.getsockname()[1], "/snapshot.jpg")
    command = (sys.executable, "-m", "sim.camera.film.live_view", str(port.fileno()))
    render_process = RenderProcess(command, inherits=(port.fileno(),))
    answered = queue.Queue[bytes]()
    threading.Thread(target=lambda: answered.put(viewer.open().read()), daemon=True).start()
    numbers = count()

    def is_answered() -> bool:
        render_process.begin(frame(tmp_path, next(numbers)))
        assert render_process.finished(wait=True)[0].error == ""
        return not answered.empty()

    wait_for(is_answered, "a frame")
    picture = Image.open(io.BytesIO(answered.get()))
    assert picture.size == (160, 120)
    viewer.close()
    render_process.close()
    port.close()


@pytest.mark.thorough
def test_a_viewer_who_takes_no_frames_is_let_go() -> None:
    screen = Screen()
    server = serve(screen, listening(), patience_s=0.2)
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
    server = serve(screen, listening())
    for _ in range(VIEWERS_MAX):
        assert screen.enter() is not None
    viewer = Viewer(server.server_port, "/stream")
    assert viewer.open().status == 503
    viewer.close()
    screen.leave()
    assert screen.enter() is not None
    server.shutdown()
    server.server_close()


@pytest.mark.first_case
@pytest.mark.parametrize("path", ["/stream", "/snapshot.jpg"])
def test_nobody_looks_any_more_when_the_viewer_has_gone(path: str) -> None:
    screen = Screen()
    server = serve(screen, listening())
    viewer = Viewer(server.server_port, path)
    wait_for_viewers(screen)
    viewer.close()

    def nobody_looks() -> bool:
        screen.show(b"x" * 100_000)
        return not screen.is_watched

    wait_for(nobody_looks, "the viewer to be gone")
    server.shutdown()
    server.server_close()
