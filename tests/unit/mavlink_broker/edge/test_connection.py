"""Requests to the edge server: its key, its headers, its data."""

import http.server
import threading
from pathlib import Path

from mavlink_broker.edge.connection import INSTANCE_HEADER, EdgeConnection

RECEIVED: list[tuple[dict[str, str], bytes]] = []


class _Recorder(http.server.BaseHTTPRequestHandler):
    """Keeps the headers and the body of each request."""

    def do_PATCH(self) -> None:  # http.server's name
        body = self.rfile.read(int(self.headers["Content-Length"]))
        RECEIVED.append((dict(self.headers), body))
        self.send_response(200)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, format: str, *values: object) -> None:  # noqa: A002  # as above
        """Be silent."""


def test_data_are_sent_as_they_are_with_the_key_and_the_instance(tmp_path: Path) -> None:
    (tmp_path / "broker.key").write_text("SECRET")
    with http.server.HTTPServer(("127.0.0.1", 0), _Recorder) as listener:
        RECEIVED.clear()
        thread = threading.Thread(target=listener.handle_request)
        thread.start()
        url = f"http://127.0.0.1:{listener.server_port}"
        with EdgeConnection(url, tmp_path / "broker.key", None, "01BROKER") as edge:
            edge.request("PATCH", "/logs/1", data=b"\0\xff", headers={"Upload-Offset": "7"})
        thread.join()
    ((headers, body),) = RECEIVED
    assert body == b"\0\xff"
    assert headers["Content-Type"] == "application/octet-stream"
    assert headers["Authorization"] == "Bearer SECRET"
    assert headers["Upload-Offset"] == "7"
    assert headers[INSTANCE_HEADER] == "01BROKER"
