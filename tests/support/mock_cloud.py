"""The mock cloud over real sockets, with batches and TLS where a test wants them."""

import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from flask import request
from werkzeug.serving import WSGIRequestHandler, make_server

from sim.cloud.app import create_app
from sim.cloud.store import Store


class _Quiet(WSGIRequestHandler):
    protocol_version = "HTTP/1.1"

    def log(self, *_: object) -> None:
        """Log nothing."""


class MockCloud(NamedTuple):
    """Where it is and what it holds."""

    url: str
    store: Store
    requests: list[str]


@contextmanager
def running_mock_cloud(
    batch_records: int = 0, tls: ssl.SSLContext | None = None
) -> Iterator[MockCloud]:
    """Run it for a while."""
    store, requests = Store(None), list[str]()
    app = create_app(store, batch_records=batch_records)

    @app.before_request
    def note() -> None:

        requests.append(request.path)

    server = make_server(
        "127.0.0.1", 0, app, threaded=True, request_handler=_Quiet, ssl_context=tls
    )
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    scheme = "http" if tls is None else "https"
    try:
        yield MockCloud(f"{scheme}://127.0.0.1:{server.server_port}", store, requests)
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
