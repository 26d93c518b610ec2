"""A camera that sends Motion JPEG over HTTP: pictures as fast as somebody takes them."""

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from PIL import Image

PAUSE_S = 0.05


def jpeg(colour: tuple[int, int, int]) -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (64, 48), colour).save(out, "JPEG", quality=95)
    return out.getvalue()


class MjpegCamera:
    """Its address, and how many requests it has had; `frame` is what it sends."""

    def __init__(self, url: str, ending: threading.Event) -> None:
        self.url = url
        self.frame = jpeg((200, 40, 40))
        self.status = 200
        self.content_type = "multipart/x-mixed-replace; boundary=cut"
        self.requests = 0
        self.connected = 0
        self.ending = ending


@contextmanager
def mjpeg_camera() -> Iterator[MjpegCamera]:
    """Run a camera on a free port."""
    ending = threading.Event()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            camera.requests += 1
            camera.connected += 1
            try:
                self.send_response(camera.status)
                self.send_header("Content-Type", camera.content_type)
                self.end_headers()
                while not ending.wait(PAUSE_S):
                    self.wfile.write(b"--cut\r\nContent-Type: image/jpeg\r\n\r\n")
                    self.wfile.write(camera.frame + b"\r\n")
            except OSError:
                pass  # The viewer has gone
            finally:
                camera.connected -= 1

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    camera = MjpegCamera(f"http://127.0.0.1:{server.server_port}/stream", ending)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield camera
    finally:
        ending.set()
        server.shutdown()
        server.server_close()
