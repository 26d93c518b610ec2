"""`python -m sim.cloud`: run the mock cloud alone."""

import signal

if __name__ == "__main__":  # Ctrl-C while the rest is loaded ends the program without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import argparse
import logging
import os
import sys
import threading
from pathlib import Path

from werkzeug.serving import WSGIRequestHandler, make_server

from sim.cloud.app import create_app
from sim.cloud.mqtt import MqttReceiver
from sim.cloud.store import Store


class _KeepAliveHandler(WSGIRequestHandler):
    """HTTP/1.1, so that a sender keeps its connection; quiet about each request."""

    protocol_version = "HTTP/1.1"

    def log_request(self, code: int | str = "-", size: int | str = "-") -> None:
        """Log at debug level only: a vehicle sends every second."""
        logging.getLogger("sim.cloud").debug("%s %s %s", self.requestline, code, size)


def _mqtt_receiver(store: Store, url: str | None, login_file: Path | None) -> MqttReceiver | None:
    if not url:
        return None
    login = None if login_file is None else login_file.read_text(encoding="utf-8").strip()
    return MqttReceiver(store, url, login)


def main() -> int:
    """Serve until SIGINT or SIGTERM; 2 when the port is taken."""
    environment = os.environ
    parser = argparse.ArgumentParser(prog="sim.cloud", description="Run the mock cloud alone.")
    parser.add_argument(
        "--port",
        type=int,
        default=int(environment.get("CLOUD_PORT", "8100")),
        help="TCP port to listen on (environment: CLOUD_PORT)",
    )
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on: %(default)s")
    parser.add_argument(
        "--mqtt", default=environment.get("CLOUD_MQTT_URL"), help="mqtt://broker/<topics of a farm>"
    )
    parser.add_argument(
        "--mqtt-login-file",
        type=Path,
        default=environment.get("CLOUD_MQTT_LOGIN_FILE"),
        help="file with user:password for the MQTT broker",
    )
    parser.add_argument(
        "--state-dir",
        type=Path,
        default=Path(environment.get("STATE_DIR", "var")),
        help="folder of what it holds (environment: STATE_DIR)",
    )
    parser.add_argument(
        "--batch",
        type=int,
        default=int(environment.get("CLOUD_BATCH", "100")),
        help="records taken in one request; 0 offers no batches (CLOUD_BATCH)",
    )
    arguments = parser.parse_args()
    if not 0 <= arguments.port <= 65_535:
        parser.error(f"--port: {arguments.port} is not from 0 to 65535")
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s cloud %(message)s")
    store = Store(arguments.state_dir / "cloud" / "records.ndjson")
    try:
        server = make_server(
            arguments.host,
            arguments.port,
            create_app(store, batch_records=arguments.batch),
            threaded=True,
            request_handler=_KeepAliveHandler,
        )
    except SystemExit:
        print(f"port {arguments.port} is taken: set CLOUD_PORT", file=sys.stderr)
        return 2
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: threading.Thread(target=server.shutdown).start())
    logging.getLogger("sim.cloud").info("listening on http://%s:%d", arguments.host, arguments.port)
    receiver = _mqtt_receiver(store, arguments.mqtt, arguments.mqtt_login_file)
    if receiver is not None:
        receiver.open()
    server.serve_forever()
    if receiver is not None:
        receiver.close()
    server.server_close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
