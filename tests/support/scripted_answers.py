"""A server that reads a request and then plays back bytes: all of them, some of them, slowly.

It knows nothing of HTTP beyond the end of a request, so that an answer may be as broken as it
likes.
"""

import re
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TypeAlias

WriteAnswer: TypeAlias = Callable[[socket.socket], None]
_RESET_ON_CLOSE = struct.pack("ii", 1, 0)


class ScriptedAnswers:
    """Listens on the loopback; `write_answer` writes the answer to each request."""

    def __init__(self) -> None:
        self.write_answer: WriteAnswer = lambda _: None
        self.requests = 0
        self.read_pause_s = 0.0  # Before each piece of a body
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._thread.join()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                with connection, suppress(OSError):
                    connection.settimeout(10.0)
                    if _read_request(connection, self.read_pause_s):
                        self.requests += 1
                        self.write_answer(connection)


def _read_request(connection: socket.socket, pause_s: float) -> bool:
    """Read a head and the body that its Content-Length announces."""
    data = b""
    while b"\r\n\r\n" not in data:
        received = connection.recv(65_536)
        if not received:
            return False
        data += received
    head, _, body = data.partition(b"\r\n\r\n")
    length = re.search(rb"content-length: *([0-9]+)", head, re.IGNORECASE)
    left = int(length[1]) - len(body) if length else 0
    while left > 0:
        time.sleep(pause_s)
        left -= len(connection.recv(65_536))
    return True


def cut(answer: bytes) -> WriteAnswer:
    """Send data and close in order."""

    def write(connection: socket.socket) -> None:
        connection.sendall(answer)
        connection.shutdown(socket.SHUT_WR)
        connection.recv(1)

    return write


def reset(answer: bytes) -> WriteAnswer:
    """Send data and reset the connection."""

    def write(connection: socket.socket) -> None:
        connection.sendall(answer)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)

    return write


def stall(answer: bytes, note_gone: Callable[[bool], None]) -> WriteAnswer:
    """Send data, then nothing until the client goes, or longer than it should stay.

    Notes whether the client has gone by itself.
    """

    def write(connection: socket.socket) -> None:
        try:
            connection.sendall(answer)
            connection.recv(1)
        except TimeoutError:
            note_gone(False)
        except OSError:
            note_gone(True)
        else:
            note_gone(True)

    return write


def drip(answer: bytes, forever: bytes, pause: threading.Event) -> WriteAnswer:
    """Send data, then the same bytes again and again, each in time for a socket's timeout."""

    def write(connection: socket.socket) -> None:
        connection.sendall(answer)
        while not pause.wait(0.005):
            connection.sendall(forever)

    return write


@contextmanager
def scripted_answers() -> Iterator[ScriptedAnswers]:
    """Give a server, and end it."""
    server = ScriptedAnswers()
    try:
        yield server
    finally:
        server.close()
