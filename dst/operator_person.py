"""The operator: posts plans, repeats requests, cancels, aborts, releases held vehicles."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Final

from dst.edge_process import EdgeDownError, Response
from dst.faults import Fault
from dst.vehicle import place
from dst.world import World

MEAN_PAUSE_S: Final = 20.0
MEAN_LOOK_S: Final = 8.0
"""Between two looks at the vehicles: one that is out of reach is aborted, others sometimes."""
ABORT_SHARE: Final = 0.25
RELEASE_PERIOD_S: Final = 15.0
ALTITUDE_M: Final = 5.0
SOFT_ABORT: Final = 2
ENDING_EVENTS: Final = (1, SOFT_ABORT, 103)
"""Abort, soft abort and return home: `event_type_id`."""


@dataclass
class PostedPlan:
    """A plan that the edge server has acknowledged."""

    number: int
    mission_id: int
    vehicle_id: int
    waypoints: dict[int, tuple[int, int]]
    """By command id: latitude and longitude [1e-7 deg]."""
    posted_s: float = 0.0
    cancelled_s: float | None = None
    """When its deletion was acknowledged."""


@dataclass(frozen=True, slots=True)
class PostedAbort:
    """An event that ends missions, and that the edge server has acknowledged."""

    number: int
    vehicle_id: int
    posted_s: float
    waits: bool
    """Whether the running command comes to its end first."""


class Operator:
    """A person at the edge server's API."""

    def __init__(self, world: World, enabled: Collection[Fault]) -> None:
        self.plans: list[PostedPlan] = []
        self.aborts: list[PostedAbort] = []
        self.double_ids: list[str] = []
        """Repeated requests that were answered by another id."""
        self._world = world
        self._enabled = frozenset(enabled)
        self._random = world.scheduler.random("operator")
        self._orders = world.scheduler.random("aborts")
        self._numbers = world.scheduler.random("mission numbers")
        self._missions = 0
        self._events = 0
        self._shift = 0
        self._is_posting = False
        self.start()

    def start(self) -> None:
        """Begin a shift: post, cancel, abort and release."""
        self._shift += 1
        self._is_posting = True
        self._next(self._shift)
        self._watch(self._shift)
        self._release(self._shift)

    def stop(self) -> None:
        """Post nothing more, and go on releasing vehicles."""
        self._is_posting = False

    def go_home(self) -> None:
        """End the shift."""
        self.stop()
        self._shift += 1

    def _next(self, shift: int) -> None:
        pause_s = self._random.expovariate(1.0 / MEAN_PAUSE_S)
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
        """Abort now and then, above all what is out of reach or flies, whoever flies it."""
        if shift != self._shift or not self._is_posting or Fault.ABORTS not in self._enabled:
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
        self._missions += 1
        mission_id, random = self._mission_id(), self._random
        vehicle_id = random.choice(list(self._world.vehicles))
        home = place(0.0, 0.0)
        home_fields = {"latitude": home[0], "longitude": home[1]}
        commands: list[dict[str, Any]] = [_command(1, 1, home_fields | {"altitude": ALTITUDE_M})]
        waypoints: dict[int, tuple[int, int]] = {}
        for command_id in range(2, random.randint(3, 5)):
            latitude, longitude = place(random.uniform(5.0, 30.0), random.uniform(-30.0, 30.0))
            waypoints[command_id] = round(latitude * 1e7), round(longitude * 1e7)
            fields = {"latitude": latitude, "longitude": longitude, "altitude": ALTITUDE_M}
            commands.append(_command(command_id, 3, fields))
        commands.append(_command(9, 11, {"landing": True}))
        mission = {"mission_id": mission_id, "vehicle_id": vehicle_id, "maximum_speed": 5.0}
        body = {"name": "simulated", "missions": [mission | {"command_array": commands}]}
        key = f"plan-{self._missions}"
        response = self._request("POST", "/plans/", body, key)
        if response is None or response.status != 201:
            return
        number = int(response.json()["id"])
        now_s = self._world.scheduler.now_s
        self.plans.append(PostedPlan(number, mission_id, vehicle_id, waypoints, posted_s=now_s))
        if Fault.REPEATED_POSTS in self._enabled:
            pause_s = random.uniform(0.0, 60.0)
            self._world.scheduler.after(pause_s, lambda: self._repeat(body, key, number))

    def _mission_id(self) -> int:
        """Give a number, which another plan may have had before."""
        if Fault.REPEATED_MISSIONS not in self._enabled:
            return self._missions
        return self._numbers.randint(1, 2)

    def _repeat(self, body: Any, key: str, number: int) -> None:
        response = self._request("POST", "/plans/", body, key)
        if response is not None and response.status < 300 and response.json()["id"] != number:
            self.double_ids.append(f"plan {number} again as {response.json()['id']}")

    def _cancel(self, plan: PostedPlan) -> None:
        response = self._request("DELETE", f"/plans/{plan.number}")
        if response is not None and response.status == 204 and plan.cancelled_s is None:
            plan.cancelled_s = self._world.scheduler.now_s

    def _release(self, shift: int) -> None:
        """Release each vehicle that stands, in case it is held after a fault; then again."""
        if shift != self._shift:
            return
        self._world.scheduler.after(RELEASE_PERIOD_S, lambda: self._release(shift))
        for system, vehicle in self._world.vehicles.items():
            if not vehicle.is_flying:
                self._request("POST", f"/vehicles/{system}/release", {"reason": "checked"})

    def _abort(self, shift: int) -> None:
        self._watch(shift)
        world = self._world
        flying = [system for system, vehicle in world.vehicles.items() if vehicle.is_flying]
        lost = [
            system for system in flying if not (world.up[system].is_up and world.down[system].is_up)
        ]
        if not lost and self._orders.random() > ABORT_SHARE:
            return
        self._events += 1
        vehicle_id = self._orders.choice(lost or flying or list(world.vehicles))
        kind = self._orders.choice(ENDING_EVENTS)
        event = {"sequence_number": self._events, "vehicle_id": vehicle_id, "event_type_id": kind}
        response = self._request("POST", "/events/", event)
        if response is not None and response.status == 201:
            number, now_s = int(response.json()["id"]), self._world.scheduler.now_s
            self.aborts.append(PostedAbort(number, vehicle_id, now_s, waits=kind == SOFT_ABORT))


def _command(command_id: int, kind: int, parameters: dict[str, Any]) -> dict[str, Any]:
    return {"command_id": command_id, "command_type_id": kind, "parameters": parameters}
