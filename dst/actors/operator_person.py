"""The operator: posts plans, repeats requests, cancels, aborts, pauses, releases held vehicles."""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from datetime import timedelta
from http import HTTPStatus
from typing import Any, Final

from dst.actors.plans import ALTITUDE_M, PlannedCommands, Planner, place_in_field
from dst.faults.kinds import Fault
from dst.vehicles.autopilot import Mode
from dst.vehicles.flight import place
from dst.world.edge_process import EdgeDownError, Response
from dst.world.world import World
from mavlink_broker.mission.states import State

MEAN_PAUSE_S: Final = 20.0
FIRST_PLAN_S: Final = 6.0
"""Mean time from the start of a shift to its first plan: faults are to meet vehicles that fly."""
MEAN_LOOK_S: Final = 8.0
"""Between two looks at the vehicles: one that is out of reach is aborted, others sometimes."""
ABORT_SHARES: Final = (0.0, 0.25)
"""How often a vehicle in reach is aborted at a look, of which a seed draws one."""
UNAWARE_SHARE: Final = 0.5
"""How often a vehicle is aborted that a pilot has flown for a while, who has informed nobody."""
UNAWARE_AFTER_S: Final = 18.0
REGRET_SHARE: Final = 0.3
MEAN_REGRET_S: Final = 1.0
"""From a plan that is posted by mistake to its cancellation."""
RELEASE_PERIOD_S: Final = 15.0
RESCUE_S: Final = 60.0
"""A vehicle that has hovered or circled so long without a mission is landed by its pilot."""
PATIENCE_S: Final = 180.0
"""A mission that hovers or circles so long is aborted."""
RESUMES: Final = 3
"""After so many requests to resume, a mission that stays paused is aborted."""
SOFT_ABORT: Final = 2
ABORT: Final = 1
SPEED: Final = 3
PLACE_SHARE: Final = 0.5
"""How often an abort names a place."""
SPEEDS_M_S: Final = 2.0, 8.0
MEAN_SPEED_S: Final = 20.0
"""Between two changes of the speed."""
ENDING_EVENTS: Final = (ABORT, SOFT_ABORT, 103)
"""Abort, soft abort and return home: `event_type_id`."""
PAUSE: Final = 101
RESUME: Final = 102

NO_FIELDS: Final[Mapping[str, Any]] = {}


@dataclass
class PostedPlan:
    """A plan that the edge server has acknowledged."""

    number: int
    mission_id: int
    vehicle_id: int
    commands: PlannedCommands
    posted_s: float = 0.0
    cancelled_s: float | None = None
    """When its deletion was acknowledged."""
    expires_s: float = math.inf
    """A vehicle that was not armed for it by then is not armed for it any more."""


@dataclass(frozen=True, slots=True)
class PostedAbort:
    """An event that ends missions, and that the edge server has acknowledged."""

    number: int
    vehicle_id: int
    posted_s: float
    waits: bool
    """Whether the running command comes to its end first."""
    place_m: tuple[float, float] | None = None
    """Where the vehicle goes first: north and east of home; None: nowhere."""


@dataclass(slots=True)
class PostedPause:
    """An event that pauses a mission, and that the edge server has acknowledged."""

    number: int
    vehicle_id: int
    posted_s: float
    resumes: int = 0
    resumed_s: float | None = None
    """When the operator first asked for the mission to go on."""


class Operator:
    """A person at the edge server's API."""

    def __init__(self, world: World, enabled: Collection[Fault]) -> None:
        self.plans: list[PostedPlan] = []
        self.aborts: list[PostedAbort] = []
        self.pauses: list[PostedPause] = []
        self.speeds: list[int] = []
        """Numbers of the events that change a speed."""
        self.on_sent_away: Callable[[PostedAbort], None] = lambda _abort: None
        """Called with each abort that names a place."""
        self.rescues = 0
        """How often a vehicle that hovered without a mission had to be landed by hand."""
        self._hovers_since_s: dict[int, float] = {}
        self.double_ids: list[str] = []
        """Repeated requests that were answered by another id."""
        self._world = world
        self._enabled = frozenset(enabled)
        self._random = world.scheduler.random("operator")
        self._planner = Planner(world.scheduler, list(world.vehicles), enabled, self._random)
        self._orders = world.scheduler.random("aborts")
        self._abort_share = world.scheduler.random("abort habits").choice(ABORT_SHARES)
        self._abort_places = world.scheduler.random("abort places")
        self._breaks = world.scheduler.random("pauses")
        self._speeds = world.scheduler.random("speeds")
        self._regrets = world.scheduler.random("regrets")
        self._events = 0
        self._shift = 0
        self._is_posting = False
        self.start()

    def start(self) -> None:
        """Begin a shift: post, cancel, abort and release."""
        self._shift += 1
        self._is_posting = True
        self._next(self._shift, FIRST_PLAN_S)
        self._watch(self._shift)
        self._pause_again(self._shift)
        self._change_speed_again(self._shift)
        self._release(self._shift)

    def stop(self) -> None:
        """Post nothing more, and go on releasing vehicles."""
        self._is_posting = False

    def go_home(self) -> None:
        """End the shift."""
        self.stop()
        self._shift += 1

    def _next(self, shift: int, mean_s: float = MEAN_PAUSE_S) -> None:
        pause_s = self._random.expovariate(1.0 / mean_s)
        self._world.scheduler.after(pause_s, lambda: self._act(shift))

    def _act(self, shift: int) -> None:
        if shift != self._shift or not self._is_posting:
            return
        self._next(shift)
        if self._random.random() < 0.3 and Fault.CANCELLATIONS in self._enabled and self.plans:
            self._cancel(self._random.choice(self.plans[-3:]))
        else:
            self._post_plan()

    def _watch(self, shift: int) -> None:
        """Abort now and then, mostly vehicles that are out of reach or fly, under any control."""
        is_wanted = self._enabled & {Fault.ABORTS, Fault.PILOT}
        if shift != self._shift or not self._is_posting or not is_wanted:
            return
        pause_s = self._orders.expovariate(1.0 / MEAN_LOOK_S)
        self._world.scheduler.after(pause_s, lambda: self._abort(shift))

    def _request(
        self, method: str, path: str, body: Any = None, key: str | None = None
    ) -> Response | None:
        """Send a request; None if the edge server does not run."""
        try:
            return self._world.request(method, path, body, key)
        except EdgeDownError:
            return None

    def _post_plan(self) -> None:
        drawn = self._planner.draw()
        body, expires_s = drawn.body, math.inf
        if drawn.lifetime_s is not None:
            expires_at = self._world.edge_machine.clock.utc() + timedelta(seconds=drawn.lifetime_s)
            body = body | {"expires_at": expires_at.isoformat()}
            if Fault.CLOCKS not in self._enabled:
                expires_s = self._world.scheduler.now_s + drawn.lifetime_s
        response = self._request("POST", "/plans/", body, drawn.key)
        if response is None or response.status != 201:
            return
        number = int(response.json()["id"])
        now_s = self._world.scheduler.now_s
        plan = PostedPlan(
            number,
            drawn.mission_id,
            drawn.vehicle_id,
            drawn.commands,
            now_s,
            expires_s=expires_s,
        )
        self.plans.append(plan)
        if Fault.CANCELLATIONS in self._enabled and self._regrets.random() < REGRET_SHARE:
            regret_s = self._regrets.expovariate(1.0 / MEAN_REGRET_S)
            self._world.scheduler.after(regret_s, lambda: self._cancel(plan))
        if Fault.REPEATED_POSTS in self._enabled:
            pause_s = self._random.uniform(0.0, 60.0)
            self._world.scheduler.after(pause_s, lambda: self._repeat(body, drawn.key, number))

    def _repeat(self, body: Any, key: str, number: int) -> None:
        response = self._request("POST", "/plans/", body, key)
        if response is not None and response.status < 300 and response.json()["id"] != number:
            self.double_ids.append(f"plan {number} again as {response.json()['id']}")

    def _cancel(self, plan: PostedPlan) -> None:
        response = self._request("DELETE", f"/plans/{plan.number}")
        if response is not None and response.status == 204 and plan.cancelled_s is None:
            plan.cancelled_s = self._world.scheduler.now_s

    def _release(self, shift: int) -> None:
        """Release each vehicle that stands and is held after a fault; then again."""
        if shift != self._shift:
            return
        self._world.scheduler.after(RELEASE_PERIOD_S, lambda: self._release(shift))
        shown = self._request("GET", "/vehicles/")
        known = [] if shown is None or shown.status != HTTPStatus.OK else shown.json()
        held = {one["vehicle_id"] for one in known if one["held"] is not None}
        for system, vehicle in self._world.vehicles.items():
            if system in held and not vehicle.is_flying:
                self._request("POST", f"/vehicles/{system}/release", {"reason": "checked"})
            self._rescue(system)
        newest = {pause.vehicle_id: pause for pause in self.pauses}
        for pause in newest.values():
            if pause.resumed_s is not None and self._is_paused(pause.vehicle_id):
                self._resume(pause)

    def _rescue(self, system: int) -> None:
        """Land a vehicle that hovers: by its pilot without a mission, else by an abort."""
        world, vehicle = self._world, self._world.vehicles[system]
        app = world.broker.app
        session = None if app is None else app.sessions.get(system)
        comes_down = vehicle.mode in {Mode.RETURN, Mode.LAND}
        is_left = vehicle.is_flying and vehicle.pilot_since_s is None and not comes_down
        if not is_left or session is None:
            self._hovers_since_s.pop(system, None)
            return
        since_s = self._hovers_since_s.setdefault(system, world.scheduler.now_s)
        hovered_s = world.scheduler.now_s - since_s
        if session.state is State.IDLE and hovered_s >= RESCUE_S:
            self.rescues += 1
            vehicle.take_over()
            vehicle.release()
        elif hovered_s >= PATIENCE_S and vehicle.mode is not Mode.MISSION:
            self._hovers_since_s.pop(system)
            self._post_abort(system, ABORT)

    def _pause_again(self, shift: int) -> None:
        """Pause a vehicle that flies, and resume it after a while; again and again."""
        if shift != self._shift or not self._is_posting or Fault.PAUSES not in self._enabled:
            return

        def act() -> None:
            self._pause_again(shift)
            vehicles = self._world.vehicles.items()
            flying = [system for system, vehicle in vehicles if vehicle.is_flying]
            if flying and shift == self._shift and self._is_posting:
                self._pause(self._breaks.choice(flying))

        self._world.scheduler.after(self._breaks.expovariate(1.0 / MEAN_LOOK_S), act)

    def _change_speed_again(self, shift: int) -> None:
        """Change the speed of a vehicle that flies, again and again."""
        if shift != self._shift or not self._is_posting or Fault.PAUSES not in self._enabled:
            return

        def act() -> None:
            self._change_speed_again(shift)
            vehicles = self._world.vehicles.items()
            flying = [system for system, vehicle in vehicles if vehicle.is_flying]
            if flying and shift == self._shift and self._is_posting:
                speed_m_s = self._speeds.uniform(*SPEEDS_M_S)
                fields = {"maximum_speed": speed_m_s}
                number = self._post_event(self._speeds.choice(flying), SPEED, fields)
                self.speeds += [] if number is None else [number]

        self._world.scheduler.after(self._speeds.expovariate(1.0 / MEAN_SPEED_S), act)

    def _pause(self, vehicle_id: int) -> None:
        number = self._post_event(vehicle_id, PAUSE)
        if number is None:
            return
        pause = PostedPause(number, vehicle_id, self._world.scheduler.now_s)
        self.pauses.append(pause)
        pause_s = self._breaks.uniform(2.0, 30.0)
        self._world.scheduler.after(pause_s, lambda: self._resume(pause))

    def _resume(self, pause: PostedPause) -> None:
        """Resume a mission; abort it if it stays paused."""
        for other in self.pauses:
            if other.vehicle_id == pause.vehicle_id and other.resumed_s is None:
                other.resumed_s = self._world.scheduler.now_s
        if not self._world.edge.is_up:
            return
        pause.resumes += 1
        if pause.resumes <= RESUMES:
            self._post_event(pause.vehicle_id, RESUME)
        else:
            self._post_abort(pause.vehicle_id, ABORT)

    def _is_paused(self, system: int) -> bool:
        app = self._world.broker.app
        session = None if app is None else app.sessions.get(system)
        return session is None or session.vehicle.recovery.paused is not None

    def _post_event(
        self, vehicle_id: int, kind: int, fields: Mapping[str, Any] = NO_FIELDS
    ) -> int | None:
        """Post an event; gives its number if it was acknowledged."""
        self._events += 1
        event = {"sequence_number": self._events, "vehicle_id": vehicle_id, "event_type_id": kind}
        response = self._request("POST", "/events/", event | dict(fields))
        if response is None or response.status != 201:
            return None
        number = int(response.json()["id"])
        text = f"event {number} of type {kind} for vehicle {vehicle_id}"
        self._world.scheduler.note("operator", "-", text)
        return number

    def _post_abort(self, vehicle_id: int, kind: int) -> None:
        place_m, fields = None, NO_FIELDS
        random = self._abort_places
        if kind in {ABORT, SOFT_ABORT} and random.random() < PLACE_SHARE:
            place_m = place_in_field(random)
            latitude, longitude = place(*place_m)
            there = {"latitude": latitude, "longitude": longitude, "altitude": ALTITUDE_M}
            fields = {"abort": there}
        number = self._post_event(vehicle_id, kind, fields)
        if number is not None:
            now_s, waits = self._world.scheduler.now_s, kind == SOFT_ABORT
            abort = PostedAbort(number, vehicle_id, now_s, waits, place_m)
            self.aborts.append(abort)
            if place_m is not None:
                self.on_sent_away(abort)

    def _abort(self, shift: int) -> None:
        self._watch(shift)
        world = self._world
        latest_s = world.scheduler.now_s - UNAWARE_AFTER_S
        for system, vehicle in world.vehicles.items():
            is_taken = vehicle.pilot_since_s is not None and vehicle.pilot_since_s < latest_s
            if is_taken and self._orders.random() < UNAWARE_SHARE:
                self._post_abort(system, self._orders.choice(ENDING_EVENTS))
        if Fault.ABORTS not in self._enabled:
            return
        flying = [system for system, vehicle in world.vehicles.items() if vehicle.is_flying]
        lost = [
            system
            for system in flying
            if not (world.up[system].is_up and world.down[system].is_up)
            or world.broker.is_suspended
        ]
        if not lost and self._orders.random() >= self._abort_share:
            return
        vehicle_id = self._orders.choice(lost or flying or list(world.vehicles))
        self._post_abort(vehicle_id, self._orders.choice(ENDING_EVENTS))
