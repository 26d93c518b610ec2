"""`python -m sim.camera.film.live_view SOCKET`: what the camera sees now, as a stream.

A process beside the vehicle. Frames are ordered on its standard input, a line each, and answered a
line each; they are rendered only while a viewer is connected. On a listening socket, whose file
descriptor it inherits and gets as an argument, it serves

    /stream         Motion JPEG, `multipart/x-mixed-replace`: browsers, VLC and OpenCV play it
    /snapshot.jpg   the newest frame
"""

import signal

if __name__ == "__main__":  # The vehicle decides when it ends, also while the rest is loaded
    signal.signal(signal.SIGINT, signal.SIG_IGN)

import json
import os
import socket
import sys
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Final

from sim.camera.film.orders import Frame, from_line
from sim.camera.film.video_files import jpeg_of

QUALITY: Final = 70
PATIENCE_S: Final = 10.0
"""A viewer that receives no frame for so long is disconnected."""
VIEWERS_MAX: Final = 16
"""How many may look at once."""
_NICENESS: Final = 5
_BOUNDARY: Final = "frame"


class Screen:
    """The newest frame, and how many wait for the next."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._jpeg = b""
        self._number = 0
        self._viewers = 0

    @property
    def is_watched(self) -> bool:
        """Whether a viewer is connected."""
        return self._viewers > 0

    def show(self, jpeg: bytes) -> None:
        """Give a frame to everybody who waits."""
        with self._changed:
            self._jpeg, self._number = jpeg, self._number + 1
            self._changed.notify_all()

    def enter(self) -> int | None:
        """Begin to look; gives the number of the newest frame, None where too many look."""
        with self._changed:
            if self._viewers >= VIEWERS_MAX:
                return None
            self._viewers += 1
            return self._number

    def leave(self) -> None:
        """Look no more."""
        with self._changed:
            self._viewers -= 1

    def next(self, after: int, patience_s: float = PATIENCE_S) -> tuple[int, bytes] | None:
        """The first frame newer than a number, with its own; None if none comes in time."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._number > after, patience_s):
                return None
            return self._number, self._jpeg


class _Handler(BaseHTTPRequestHandler):
    screen: Screen
    patience_s: float
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        """Serve the two addresses; nothing else is there."""
        if self.path not in {"/stream", "/snapshot.jpg"}:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self.close_connection = True
        seen = self.screen.enter()
        if seen is None:
            self.send_error(HTTPStatus.SERVICE_UNAVAILABLE, f"{VIEWERS_MAX} viewers look already")
            return
        try:
            if self.path == "/stream":
                self._stream(seen)
            else:
                self._snapshot(seen)
        except (ConnectionError, TimeoutError):
            return  # The viewer has gone, or does not look
        finally:
            self.screen.leave()

    def _snapshot(self, seen: int) -> None:
        frame = self.screen.next(seen, self.patience_s)
        if frame is None:
            self.send_error(HTTPStatus.SERVICE_UNAVAILABLE)
            return
        self._begin("image/jpeg", len(frame[1]))
        self.wfile.write(frame[1])

    def _stream(self, seen: int) -> None:
        self._begin(f"multipart/x-mixed-replace; boundary={_BOUNDARY}")
        frame = self.screen.next(seen, self.patience_s)
        while frame is not None:
            number, jpeg = frame
            head = (
                f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
            )
            self.wfile.write(head.encode() + jpeg + b"\r\n")
            frame = self.screen.next(number, self.patience_s)

    def _begin(self, content_type: str, size: int | None = None) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", content_type)
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        if size is not None:
            self.send_header("Content-Length", str(size))
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class's name
        """Say nothing: the vehicle's console is for the flight."""


def serve(
    screen: Screen, listening: socket.socket, *, patience_s: float = PATIENCE_S
) -> ThreadingHTTPServer:
    """Start to serve the clients of a socket."""
    # `timeout` is the base class's: of reading a question, and of writing to a stalled viewer
    handler = type(
        "Handler", (_Handler,), {"screen": screen, "patience_s": patience_s, "timeout": patience_s}
    )
    address = listening.getsockname()
    server = ThreadingHTTPServer(address, handler, bind_and_activate=False)
    server.socket.close()
    server.socket, server.server_address, server.server_port = listening, address, address[1]
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


def main() -> int:
    """Show frames until there are no more orders."""
    os.nice(_NICENESS)
    screen = Screen()
    serve(screen, socket.socket(fileno=int(sys.argv[1])))
    for line in sys.stdin:
        frame = from_line(line)
        if screen.is_watched and isinstance(frame, Frame):
            screen.show(jpeg_of(frame, QUALITY))
        answer = {"number": frame.number, "size_bytes": 0, "files": 0, "error": ""}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
