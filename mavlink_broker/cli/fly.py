"""`fly`: a plan on its vehicles without an edge server, from here and now to its end.

The same sessions fly it as under an edge server; only the door is another. A plan needs its
broker to its end where commands are flown live, so an interruption says what it leaves behind.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from ulid import ULID

from afarcloud.enumerations import EventType
from afarcloud.plan import Mission, Plan
from mavlink_broker import config
from mavlink_broker.app import App
from mavlink_broker.cli.local_edge import LocalEdge
from mavlink_broker.cli.plan_file import chosen, read_plan
from mavlink_broker.cli.program import (
    FAILED,
    SUCCEEDED,
    Signals,
    SystemClock,
    UsageError,
    Voice,
    begin_log,
    connected,
    open_link,
    terminal_parser,
)
from mavlink_broker.cli.progress_text import JsonPage, ProgressPage
from mavlink_broker.config import Config
from mavlink_broker.microservices.heartbeat import LinkState
from mavlink_broker.mission.states import State
from mavlink_broker.recovery.folder import JournalFolder
from mavlink_broker.recovery.writer import JournalWriter
from mavlink_broker.routing.routing import Clock
from mavlink_broker.worker_pool import Workshop

HEARD_WITHIN_S: Final = 30.0
QUIET_FOR_S: Final = 2.0
"""A camera is asked behind a mission whether all its pictures are known."""
QUIET_WITHIN_S: Final = 300.0
"""For a landing, pictures and whatever else comes behind the last report of the last mission."""
LEAVE: Final = "leave"
_ON_INTERRUPT: Final[Mapping[str, EventType | None]] = {
    LEAVE: None,
    "land": EventType.ABORT_MISSION,
    "home": EventType.SOFT_ABORT_MISSION,
}


class Sortie:
    """One plan that is being flown."""

    def __init__(
        self, app: App, edge: LocalEdge, missions: Sequence[Mission], settings: Config
    ) -> None:
        self._app = app
        self._edge = edge
        self._systems = {m.vehicle_id: settings.system_of(m.vehicle_id) for m in missions}
        self._over_at: float | None = None
        self._quiet_at: float | None = None

    def missing(self, now: float) -> list[int]:
        """Give the vehicles that are not heard yet, or have not told what they are."""
        sessions = self._app.sessions
        return [
            vehicle_id
            for vehicle_id, system in self._systems.items()
            if system not in sessions
            or sessions[system].vehicle.link_state(now) is not LinkState.CONNECTED
            or not sessions[system].vehicle.is_identified
        ]

    def gather(self, clock: Clock, signals: Signals, within_s: float) -> None:
        """Wait until all vehicles are heard.

        Raises:
            UsageError: if some are not in time.
        """
        end = clock.monotonic() + within_s
        while self.missing(clock.monotonic()) and not signals.stop:
            if clock.monotonic() >= end:
                raise UsageError(self._absence(clock.monotonic(), within_s), FAILED)
            self._app.step()

    def fly(self, clock: Clock, signals: Signals, on_interrupt: EventType | None) -> None:
        """Fly until all missions have ended; the first signal interrupts, the second quits."""
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
    def hovering(self) -> tuple[str, ...]:
        """Say of every vehicle that is armed still what it does."""
        vehicles = (session.vehicle for session in self._app.sessions.values())
        return tuple(
            f"vehicle {vehicle.vehicle_id} is still armed, in mode {vehicle.mode}"
            for vehicle in vehicles
            if vehicle.snapshot.armed and vehicle.vehicle_id in self._systems
        )

    def _is_over(self, now: float) -> bool:
        """Whether everything has ended, and what comes after it too, or has had its time."""
        if not self._edge.is_over:
            return False
        if self._over_at is None:
            self._over_at = now
        if not self._is_quiet:
            self._quiet_at = None
        elif self._quiet_at is None:
            self._quiet_at = now
        is_late = now - self._over_at > QUIET_WITHIN_S
        return is_late or (self._quiet_at is not None and now - self._quiet_at >= QUIET_FOR_S)

    @property
    def _is_quiet(self) -> bool:
        """Whether no vehicle is told anything any more, nor has pictures that can be fetched.

        One that was aborted is told where to go, for a while; one that has landed gets back the
        fence and the parameters that it had before.
        """
        return not any(
            one.state is not State.IDLE
            or one.pictures.is_fetching
            or one.is_giving_back
            or not one.vehicle.parameters.is_idle
            for one in self._app.sessions.values()
        )

    def _absence(self, now: float, within_s: float) -> str:
        absent = ", ".join(
            f"vehicle {vehicle_id} (system {self._systems[vehicle_id]})"
            for vehicle_id in self.missing(now)
        )
        heard = ", ".join(str(system) for system in sorted(self._app.sessions)) or "none"
        return f"not heard within {within_s:g} s: {absent}; heard systems: {heard}"


def run(arguments: Sequence[str], environment: Mapping[str, str]) -> int:
    """Fly the plan; 0 only if every mission was flown to its end.

    Raises:
        UsageError: if it cannot be begun.
    """
    settings, options = _options(arguments, environment)
    clock = SystemClock()
    plan, warnings = read_plan(options.plan, clock.utc())
    missions = chosen(plan, options.mission_id, options.vehicle_id)
    _refuse_unknown(missions, settings)
    begin_log(settings.log_level, settings.log_file)
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
        _page(missions, options).take,
        expires_at=plan.expires_at,
        geofence=plan.geofence,
        rally_points=plan.rally_points,
        folder=options.out,
    )
    link = open_link(settings)
    workshop = Workshop(link.wake)
    workshop.start()
    journal = JournalWriter(JournalFolder(settings.journal), link.wake)
    app = App(settings, link, edge, clock, lambda: str(ULID()), workshop, journal)
    sortie = Sortie(app, edge, missions, settings)
    try:
        sortie.gather(clock, signals, options.wait)
        for line in sortie.hovering:
            print(f"{line}: its mission waits until it is down", file=sys.stderr)
        if not signals.stop:
            sortie.fly(clock, signals, _ON_INTERRUPT[options.on_interrupt])
    finally:
        workshop.stop()
        app.close()
        journal.close()
        link.close()
    if signals.stop:
        _say_what_is_left(edge, missions)
    for line in sortie.hovering:
        print(line, file=sys.stderr)
    if signals.stop:
        return signals.status
    return SUCCEEDED if edge.all_finished else FAILED


def _say_what_is_left(edge: LocalEdge, missions: Sequence[Mission]) -> None:
    """Say what nobody looks after any more."""
    for mission in missions:
        status = edge.statuses[mission.mission_id]
        if not status.is_terminal:
            print(
                f"vehicle {mission.vehicle_id} was left in mission {mission.mission_id}, which is "
                f"{status.name}: it flies its mission items to their end by itself, and a command "
                "that is flown live, such as a hotpoint or a follow, until somebody ends it",
                file=sys.stderr,
            )


def _page(missions: tuple[Mission, ...], options: argparse.Namespace) -> ProgressPage | JsonPage:
    say = Voice().say
    return JsonPage(say) if options.json else ProgressPage(missions, say)


def _refuse_unknown(missions: Sequence[Mission], settings: Config) -> None:
    for mission in missions:
        if settings.system_of(mission.vehicle_id) is None:
            raise UsageError(f"no system is vehicle {mission.vehicle_id}: see --vehicle-ids")


def _options(
    arguments: Sequence[str], environment: Mapping[str, str]
) -> tuple[Config, argparse.Namespace]:
    parser = terminal_parser(
        environment,
        word="fly",
        description="Fly a plan without an edge server: 0 if every mission was finished, else 1.",
    )
    parser.add_argument("plan", help="a plan as JSON, or - for the standard input")
    parser.add_argument("--mission-id", type=int, help="only this mission of the plan")
    parser.add_argument("--vehicle-id", type=int, help="only the mission of this vehicle")
    parser.add_argument(
        "--wait",
        type=float,
        default=HEARD_WITHIN_S,
        help="seconds until all are heard: %(default)s",
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
    return connected(config.settings(parser, options), options.connect), options


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"--out {folder}: {error.strerror}") from error
