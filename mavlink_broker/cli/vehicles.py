"""`vehicles`: who is heard on the link.

It listens as the broker does and flies nothing. It changes no rate of a message and is nobody's
ground station: what does not come by itself is asked for once at a time. Where the
configured port is taken, by a broker that runs, that broker's edge server is asked instead.
"""

import argparse
import json
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from http import HTTPStatus
from typing import Any, Final

from ulid import ULID

from mavlink_broker import config
from mavlink_broker.app import App
from mavlink_broker.cli.local_edge import LocalEdge
from mavlink_broker.cli.program import (
    FAILED,
    SUCCEEDED,
    BusyError,
    Signals,
    SystemClock,
    UsageError,
    begin_log,
    connected,
    open_link,
    put,
    terminal_parser,
)
from mavlink_broker.cli.vehicle_table import page, row
from mavlink_broker.config import Config
from mavlink_broker.edge.bounded_http import BoundedHttp
from mavlink_broker.link_settings import TrafficSettings

LISTEN_S: Final = 5.0
"""Five heartbeats, and time to ask for a version and a position."""
_ASK_WITHIN_S: Final = 5.0
_MOST_BYTES: Final = 16 << 20


def run(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """List the vehicles; 1 if there is none.

    Raises:
        UsageError: if nobody can be asked.
    """
    settings, options = _options(arguments, environment)
    begin_log(settings.log_level)
    try:
        rows = _heard(settings, options.seconds)
    except BusyError as busy:
        if options.connect is not None:
            raise
        print(f"{busy}; asking {settings.edge_url}/vehicles/ instead", file=sys.stderr)
        rows = _asked(settings)
    if options.json:
        put(json.dumps({"vehicles": rows}, indent=1))
    elif rows:
        put("\n".join(page(rows)))
    if not rows:
        print("no vehicle is heard", file=sys.stderr)
    return SUCCEEDED if rows else FAILED


def _heard(settings: Config, seconds: float) -> list[dict[str, Any]]:
    """Listen for some time; a signal ends it early."""
    link, signals, clock = open_link(settings), Signals(), SystemClock()
    app = App(settings, link, LocalEdge((), _ignore), clock, lambda: str(ULID()))
    end = clock.monotonic() + seconds
    while clock.monotonic() < end and not signals.stop:
        app.step()
    now = time.monotonic()
    app.close()
    link.close()
    heard = (session.vehicle for _, session in sorted(app.sessions.items()))
    return [row(vehicle, now) for vehicle in heard]


def _asked(settings: Config) -> list[dict[str, Any]]:
    """Ask the edge server of the broker that has the link."""
    url = f"{settings.edge_url.rstrip('/')}/vehicles/"
    http = BoundedHttp(True if settings.edge_ca_file is None else str(settings.edge_ca_file))
    try:
        key = settings.key_file.read_text(encoding="ascii").strip()
        answer = http.exchange(
            "GET",
            url,
            within_s=_ASK_WITHIN_S,
            timeouts_s=(_ASK_WITHIN_S, _ASK_WITHIN_S),
            most_bytes=_MOST_BYTES,
            headers={"Authorization": f"Bearer {key}"},
        )
        if answer.status_code != HTTPStatus.OK:
            raise UsageError(f"{url} cannot be asked: it answers HTTP {answer.status_code}")
        return list(answer.json())
    except (OSError, UnicodeDecodeError, TypeError) as error:  # requests' errors are OSErrors
        raise UsageError(f"{url} cannot be asked: {error}") from error


def _ignore(kind: str, body: dict[str, Any]) -> None:
    """Tell nobody: only the vehicles themselves are looked at."""
    del kind, body


def _options(
    arguments: Sequence[str], environment: Mapping[str, str]
) -> tuple[Config, argparse.Namespace]:
    parser = terminal_parser(
        environment,
        word="vehicles",
        description="List the vehicles that are heard on the link.",
    )
    parser.add_argument(
        "--seconds", type=float, default=LISTEN_S, help="how long to listen: %(default)s"
    )
    options = parser.parse_args(arguments)
    if not 0 < options.seconds <= 3600:
        parser.error("--seconds must be above 0, at most 3600")
    settings = connected(config.settings(parser, options), options.connect)
    traffic = TrafficSettings(links=settings.traffic.links)
    return replace(settings, traffic=traffic, observes=True), options
