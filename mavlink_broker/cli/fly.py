"""`fly`: flies a plan without an edge server.

The same sessions fly it as with an edge server, which `LocalEdge` replaces. Live commands need the
broker to their end, so an interruption prints what the vehicles go on doing.

The progress is printed as a line for every change, or as every report in JSON.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from ulid import ULID

from afarcloud.enumerations import AlarmCode, CommandType, EventType, Status
from afarcloud.plan import Mission, Plan
from mavlink_broker import config
from mavlink_broker.app import App
from mavlink_broker.cli.local_edge import LocalEdge, read_plan, select_missions
from mavlink_broker.cli.program import (
    FAILED,
    SUCCEEDED,
    OutputWriter,
    Signals,
    SystemClock,
    UsageError,
    configure_logging,
    offline_parser,
    open_database,
    open_link,
    with_link,
)
from mavlink_broker.config import Config
from mavlink_broker.journal import JournalTable, JournalWriter
from mavlink_broker.mission.states import State
from mavlink_broker.pictures.worker_pool import WorkerPool
from mavlink_broker.routing.router import Clock

_CODES: Final = frozenset(AlarmCode)
CONNECT_TIMEOUT_S: Final = 30.0
IDLE_FOR_S: Final = 2.0
"""After a mission a camera is asked whether all its pictures are known."""
IDLE_TIMEOUT_S: Final = 300.0
"""For a landing, pictures and restored parameters after the last mission's last report."""
LEAVE: Final = "leave"
_ON_INTERRUPT: Final[Mapping[str, EventType | None]] = {
    LEAVE: None,
    "land": EventType.ABORT_MISSION,
    "home": EventType.SOFT_ABORT_MISSION,
}


class ProgressPrinter:
    """Prints reports as lines; every change once."""

    def __init__(self, missions: tuple[Mission, ...], write: Callable[[str], None]) -> None:
        self._write = write
        self._kinds = {
            (mission.mission_id, command.command_id): command.command_type_id
            for mission in missions
            for command in mission.command_array
        }
        self._last: dict[tuple[Any, ...], Any] = {}

    def take(self, kind: str, body: dict[str, Any]) -> None:
        """Print a report; state vectors and poses are not printed."""
        match kind:
            case "mission_report":
                self._mission(body)
            case "vehicle":
                self._vehicle(body)
            case "alarm":
                code = body["alarm_code_id"]
                name = AlarmCode(code).name if code in _CODES else f"code {code}"
                self._write(
                    f"vehicle {body['vehicle_id']}: ALARM {name}: {body.get('message', '')}"
                )
            case "image":
                size = body["image_size"]
                self._write(f"vehicle {body['vehicle_id']}: image {body['name']}, {size} bytes")
            case "observation":
                for one in body["observation_array"]:
                    value = f"{one['result_value']:g} {one['result_uom']}"
                    self._write(f"vehicle {body['vehicle_id']}: {one['observed_property']} {value}")

    def _mission(self, report: dict[str, Any]) -> None:
        mission_id = report["mission_id"]
        for command in report["command_report_array"]:
            command_id, message = command["command_id"], command.get("message")
            state = Status(command["command_status_id"])
            if self._has_changed((mission_id, command_id), (state, message), Status.NOT_STARTED):
                name = CommandType(self._kinds[mission_id, command_id]).name
                self._write_status(
                    f"mission {mission_id}, command {command_id} {name}", state, message
                )
        state, message = Status(report["mission_status_id"]), report.get("message")
        if self._has_changed((mission_id,), (state, message), Status.NOT_STARTED):
            self._write_status(f"mission {mission_id}", state, message)

    def _vehicle(self, body: dict[str, Any]) -> None:
        state = body.get("link_state"), body.get("mode"), body.get("armed")
        if self._has_changed(("vehicle", body["vehicle_id"]), (state, None), None):
            link, mode, armed = state
            arms = "" if armed is None else ", armed" if armed else ", disarmed"
            text = f"{link}, {body.get('autopilot')}, {mode or 'mode unknown'}{arms}"
            self._write(f"vehicle {body['vehicle_id']}: {text}")

    def _has_changed(self, key: tuple[Any, ...], state: tuple[Any, str | None], first: Any) -> bool:
        before = self._last.get(key, (first, None))
        self._last[key] = state
        return bool(before != state)

    def _write_status(self, who: str, state: Status, message: str | None) -> None:
        self._write(f"{who}: {state.name}" + (f" ({message})" if message else ""))


class JsonPrinter:
    """Prints every report as a line of JSON, in its envelope."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write

    def take(self, kind: str, body: dict[str, Any]) -> None:
        """Print a report."""
        self._write(json.dumps({kind: body}))


class PlanFlight:
    """The flight of one plan."""

    def __init__(
        self, app: App, edge: LocalEdge, missions: Sequence[Mission], settings: Config
    ) -> None:
        self._app = app
        self._edge = edge
        self._systems = {m.vehicle_id: settings.system_of(m.vehicle_id) for m in missions}
        self._over_at: float | None = None
        self._idle_at: float | None = None

    def missing(self, now: float) -> list[int]:
        """Give the vehicles that are not connected or not identified yet."""
        sessions = self._app.sessions
        return [
            vehicle_id
            for vehicle_id, system in self._systems.items()
            if system not in sessions
            or not sessions[system].vehicle.is_connected(now)
            or not sessions[system].vehicle.is_identified
        ]

    def wait_for_vehicles(self, clock: Clock, signals: Signals, within_s: float) -> None:
        """Wait until all vehicles are connected and identified.

        Raises:
            UsageError: if one is not in time.
        """
        end = clock.monotonic() + within_s
        while self.missing(clock.monotonic()) and not signals.stop:
            if clock.monotonic() >= end:
                raise UsageError(self._missing_text(clock.monotonic(), within_s), FAILED)
            self._app.step()

    def fly(self, clock: Clock, signals: Signals, on_interrupt: EventType | None) -> None:
        """Fly until all missions have ended; the first signal interrupts, the second ends it."""
        self._edge.dispatch()
        interrupted = False
        while signals.count < 2 and not self._is_over(clock.monotonic()):
            self._app.step()
            if signals.stop and not interrupted:
                interrupted = True
                if on_interrupt is None:
                    return
                self._edge.abort(on_interrupt)

    @property
    def armed_vehicles(self) -> tuple[str, ...]:
        """Give a sentence for every vehicle that is still armed."""
        vehicles = (session.vehicle for session in self._app.sessions.values())
        return tuple(
            f"vehicle {vehicle.vehicle_id} is still armed, in mode {vehicle.mode}"
            for vehicle in vehicles
            if vehicle.snapshot.armed and vehicle.vehicle_id in self._systems
        )

    def _is_over(self, now: float) -> bool:
        """Whether all missions have ended, and the vehicles are idle or the time is over."""
        if not self._edge.is_over:
            return False
        if self._over_at is None:
            self._over_at = now
        if not self._is_idle:
            self._idle_at = None
        elif self._idle_at is None:
            self._idle_at = now
        is_late = now - self._over_at > IDLE_TIMEOUT_S
        return is_late or (self._idle_at is not None and now - self._idle_at >= IDLE_FOR_S)

    @property
    def _is_idle(self) -> bool:
        """Whether the broker sends no more commands and downloads no more pictures.

        After an abort it sends commands for a while; after a landing it restores the vehicle's own
        geofence and parameters.
        """
        return not any(
            one.state is not State.IDLE
            or one.pictures.is_fetching
            or one.is_restoring
            or not one.vehicle.parameters.is_idle
            for one in self._app.sessions.values()
        )

    def _missing_text(self, now: float, within_s: float) -> str:
        missing = ", ".join(
            f"vehicle {vehicle_id} (system {self._systems[vehicle_id]})"
            for vehicle_id in self.missing(now)
        )
        connected = ", ".join(str(system) for system in sorted(self._app.sessions)) or "none"
        return f"not connected within {within_s:g} s: {missing}; connected systems: {connected}"


def run(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """Fly the plan; 0 only if every mission was flown to its end.

    Raises:
        UsageError: if the plan cannot be flown.
    """
    settings, options = _options(arguments, environment)
    clock = SystemClock()
    plan, warnings = read_plan(options.plan, clock.utc())
    missions = select_missions(plan, options.mission_id, options.vehicle_id)
    _refuse_unknown(missions, settings)
    configure_logging(settings.log_level, settings.log_file)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return _fly(plan, missions, settings, options, clock)


def _fly(
    plan: Plan,
    missions: tuple[Mission, ...],
    settings: Config,
    options: argparse.Namespace,
    clock: Clock,
) -> int:
    signals = Signals()
    edge = LocalEdge(
        missions,
        _printer(missions, options).take,
        expires_at=plan.expires_at,
        geofence=plan.geofence,
        rally_points=plan.rally_points,
        folder=options.out,
    )
    database = open_database(settings)
    link = open_link(settings)
    worker_pool = WorkerPool(link.wake)
    worker_pool.start()
    journal = JournalWriter(JournalTable(database), link.wake)
    journal.start()
    without_logs = replace(settings, vehicle_log_mib=0)  # There is no archive for them
    app = App(without_logs, link, edge, clock, lambda: str(ULID()), worker_pool, journal)
    plan_flight = PlanFlight(app, edge, missions, settings)
    try:
        plan_flight.wait_for_vehicles(clock, signals, options.wait)
        for line in plan_flight.armed_vehicles:
            print(f"{line}: its mission waits until it is down", file=sys.stderr)
        if not signals.stop:
            plan_flight.fly(clock, signals, _ON_INTERRUPT[options.on_interrupt])
    finally:
        worker_pool.stop()
        app.close()
        journal.close()
        database.close()
        link.close()
    if signals.stop:
        _print_unfinished(edge, missions)
    for line in plan_flight.armed_vehicles:
        print(line, file=sys.stderr)
    if signals.stop:
        return signals.status
    return SUCCEEDED if edge.all_finished else FAILED


def _print_unfinished(edge: LocalEdge, missions: Sequence[Mission]) -> None:
    for mission in missions:
        status = edge.statuses[mission.mission_id]
        if not status.is_terminal:
            print(
                f"vehicle {mission.vehicle_id} was left in mission {mission.mission_id}, which is "
                f"{status.name}: it flies its mission items to their end by itself, and a command "
                "that is flown live, such as a hotpoint or a follow, until a pilot ends it",
                file=sys.stderr,
            )


def _printer(
    missions: tuple[Mission, ...], options: argparse.Namespace
) -> ProgressPrinter | JsonPrinter:
    write = OutputWriter().write
    return JsonPrinter(write) if options.json else ProgressPrinter(missions, write)


def _refuse_unknown(missions: Sequence[Mission], settings: Config) -> None:
    for mission in missions:
        if settings.system_of(mission.vehicle_id) is None:
            raise UsageError(f"no system is vehicle {mission.vehicle_id}: see --vehicle-ids")


def _options(
    arguments: Sequence[str], environment: Mapping[str, str]
) -> tuple[Config, argparse.Namespace]:
    parser = offline_parser(
        environment,
        command="fly",
        description="Fly a plan without an edge server: 0 if every mission was finished, else 1.",
    )
    parser.add_argument("plan", help="a plan as JSON, or - for the standard input")
    parser.add_argument("--mission-id", type=int, help="only this mission of the plan")
    parser.add_argument("--vehicle-id", type=int, help="only the mission of this vehicle")
    parser.add_argument(
        "--wait",
        type=float,
        default=CONNECT_TIMEOUT_S,
        help="seconds until all are connected: %(default)s",
    )
    parser.add_argument(
        "--on-interrupt",
        choices=sorted(_ON_INTERRUPT),
        default=LEAVE,
        help="what the first Ctrl-C does: leave the vehicles flying, land them, send them home",
    )
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where pictures are saved")
    options = parser.parse_args(arguments)
    if not 0 < options.wait <= 3600:
        parser.error("--wait must be above 0, at most 3600")
    if options.out is not None:
        _make_folder(options.out)
    return with_link(config.settings(parser, options), options.connect), options


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"--out {folder}: {error.strerror}") from error
