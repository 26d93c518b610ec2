"""`vehicles`: lists the vehicles on the link.

It receives as the broker does and flies nothing. It changes no message rate and sends no heartbeat
of a ground station: it requests single messages that the vehicle does not stream. If a running
broker uses the configured port, the list comes from that broker's edge server.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
    LinkBusyError,
    Signals,
    SystemClock,
    UsageError,
    configure_logging,
    offline_parser,
    open_link,
    print_output,
    with_link,
)
from mavlink_broker.config import Config, LinkSettings
from mavlink_broker.edge.bounded_http import BoundedHttp
from mavlink_broker.mavlink.dialect import name_in
from mavlink_broker.vehicle.vehicle import Vehicle

COLUMNS: Final = (
    *("system_id", "vehicle_id", "autopilot", "type", "family", "version", "link_state"),
    *("mode", "armed", "latitude", "longitude", "altitude", "battery_percentage"),
)
"""Altitude in metres above home, the battery as a fraction; unknown values are null."""
_NOTHING: Final = "-"
LISTEN_S: Final = 5.0
"""Five heartbeats, and time to request a version and a position."""
_ASK_TIMEOUT_S: Final = 5.0
_MOST_BYTES: Final = 16 << 20


def run(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """List the vehicles; 1 if there is none.

    Raises:
        UsageError: if neither the link nor the edge server can be used.
    """
    settings, options = _options(arguments, environment)
    configure_logging(settings.log_level)
    try:
        rows = _connected(settings, options.seconds)
    except LinkBusyError as busy:
        if options.connect is not None:
            raise
        print(f"{busy}; asking {settings.edge_url}/vehicles/ instead", file=sys.stderr)
        rows = _rows_of_edge_server(settings)
    if options.json:
        print_output(json.dumps({"vehicles": rows}, indent=1))
    elif rows:
        print_output("\n".join(table(rows)))
    if not rows:
        print("no vehicle is connected", file=sys.stderr)
    return SUCCEEDED if rows else FAILED


def _connected(settings: Config, seconds: float) -> list[dict[str, Any]]:
    """Receive for some time; a signal ends it early."""
    link, signals, clock = open_link(settings), Signals(), SystemClock()
    app = App(settings, link, LocalEdge((), _ignore), clock, lambda: str(ULID()))
    end = clock.monotonic() + seconds
    while clock.monotonic() < end and not signals.stop:
        app.step()
    now = clock.monotonic()
    app.close()
    link.close()
    vehicles = (session.vehicle for _, session in sorted(app.sessions.items()))
    return [row(vehicle, now) for vehicle in vehicles]


def _rows_of_edge_server(settings: Config) -> list[dict[str, Any]]:
    url = f"{settings.edge_url.rstrip('/')}/vehicles/"
    authorities = True if settings.edge_ca_file is None else str(settings.edge_ca_file)
    try:
        key = settings.key_file.read_text(encoding="ascii").strip()
        with BoundedHttp(authorities) as http:
            answer = http.exchange(
                "GET",
                url,
                within_s=_ASK_TIMEOUT_S,
                timeouts_s=(_ASK_TIMEOUT_S, _ASK_TIMEOUT_S),
                max_bytes=_MOST_BYTES,
                headers={"Authorization": f"Bearer {key}"},
            )
        if answer.status_code != HTTPStatus.OK:
            raise UsageError(f"{url} cannot be asked: it answers HTTP {answer.status_code}")
        rows = answer.json()
    except (OSError, UnicodeDecodeError) as error:  # requests' errors are OSErrors
        raise UsageError(f"{url} cannot be asked: {error}") from error
    if not isinstance(rows, list) or not all(isinstance(one, dict) for one in rows):
        raise UsageError(f"{url} cannot be asked: its answer is not a list of vehicles")
    return rows


def _ignore(kind: str, body: dict[str, Any]) -> None:
    """Ignore reports: the rows come from the sessions."""
    del kind, body


def _options(
    arguments: Sequence[str], environment: Mapping[str, str]
) -> tuple[Config, argparse.Namespace]:
    parser = offline_parser(
        environment,
        command="vehicles",
        description="List the vehicles on the link.",
    )
    parser.add_argument(
        "--seconds", type=float, default=LISTEN_S, help="how long to receive: %(default)s"
    )
    options = parser.parse_args(arguments)
    if not 0 < options.seconds <= 3600:
        parser.error("--seconds must be above 0, at most 3600")
    settings = with_link(config.settings(parser, options), options.connect)
    traffic = LinkSettings(links=settings.traffic.links)
    return replace(settings, traffic=traffic, observes=True), options


def row(vehicle: Vehicle, now: float) -> dict[str, Any]:
    """Describe one vehicle."""
    snapshot = vehicle.snapshot
    position = snapshot.position
    values = (
        vehicle.route.target_system,
        vehicle.vehicle_id,
        _name("MAV_AUTOPILOT", vehicle.autopilot),
        _name("MAV_TYPE", vehicle.vehicle_type),
        vehicle.family.name,
        vehicle.version,
        vehicle.link.state(now).value,
        None if snapshot.armed is None else vehicle.mode,
        snapshot.armed,
        None if position is None else position.latitude_deg,
        None if position is None else position.longitude_deg,
        None if position is None else position.altitude_m,
        snapshot.battery_fraction,
    )
    return dict(zip(COLUMNS, values, strict=True))


def table(rows: Iterable[dict[str, Any]]) -> Iterator[str]:
    """Give the rows as a table."""
    cells = [[_cell(one.get(column)) for column in COLUMNS] for one in rows]
    rows_of_text: list[Sequence[str]] = [COLUMNS, *cells]
    widths = [max(len(line[i]) for line in rows_of_text) for i in range(len(COLUMNS))]
    for line in rows_of_text:
        yield "  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip()


def _name(enumeration: str, number: int | None) -> str | None:
    return None if number is None else (name_in(enumeration, number) or str(number)).lower()


def _cell(value: Any) -> str:
    match value:
        case None:
            return _NOTHING
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:.7g}" if abs(value) < 1 else f"{value:.7f}".rstrip("0").rstrip(".")
        case _:
            return str(value)
