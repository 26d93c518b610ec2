"""Puts a plan's fence and rally points onto a vehicle, and gives back what was there before.

What the vehicle holds is read, replaced where it differs, and proved; then come the parameters
that guard the fence. What was there before is remembered in the vehicle's loan, and noted for good
before anything changes. A fence or a value that somebody else has put there since is theirs, and
stays.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from afarcloud.plan import Geofence
from mavlink_broker.autopilots.geofence_parameters import Guarding
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.borrowed_config import ExchangedPlan, Items
from mavlink_broker.microservices.borrowed_parameters import Borrowed, is_same
from mavlink_broker.microservices.command import CommandOutcome
from mavlink_broker.microservices.parameter_write import Setting
from mavlink_broker.microservices.plan_kinds import FENCE, PLAN_NAMES, RALLY
from mavlink_broker.mission.transfer_sequence import (
    Course,
    CourseRun,
    StepRefusedError,
    VehicleSteps,
)
from mavlink_broker.planning import geofence
from mavlink_broker.vehicle.vehicle import Vehicle

_ALONE: Final = {FENCE: "the broker alone has checked the mission", RALLY: "they were left out"}


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a plan wants on its vehicle; nothing: what was there before the plan before it."""

    geofence: Geofence | None = None
    rally: Items = ()
    highest_m: float = 0.0  # Greatest height of the mission

    @property
    def is_nothing(self) -> bool:
        """Whether the plan has neither fence nor rally points."""
        return self.fence is None and not self.rally

    @property
    def fence(self) -> Geofence | None:
        """The geofence, unless it forbids nothing."""
        return None if self.geofence == Geofence() else self.geofence

    def items(self, kind: int) -> Items:
        """Give the items of a kind of plan."""
        return self.rally if kind == RALLY else geofence.fence_items(self.fence)


@dataclass(slots=True)
class Fencing:
    """One vehicle on its way to what is wanted."""

    wanted: Wanted
    vehicle: Vehicle
    notes: list[str] = field(default_factory=list)
    own_limit_m: float | None = None  # The vehicle's height limit, narrower than the plan's
    _steps: VehicleSteps = field(init=False)
    _run: CourseRun = field(init=False)

    def __post_init__(self) -> None:
        """Plan the course."""
        self._steps = VehicleSteps(self.vehicle)
        self._run = CourseRun(self._go())

    @property
    def outcome(self) -> CommandOutcome | None:
        """How it ended; None while it runs."""
        return self._run.outcome

    @property
    def is_needless(self) -> bool:
        """Whether nothing is wanted, and nothing to be given back."""
        return self.wanted.is_nothing and not self.vehicle.loan.is_open

    def start(self, now: float) -> list[Message]:
        """Begin; it may be over at once."""
        return self._run.start(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        return self._run.receive(message, now)

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""
        return self._run.tick(now)

    def _go(self) -> Course:
        for kind in (FENCE, RALLY):
            yield from self._see_to_plan(kind)
        yield from self._see_to_values()

    def _keeps(self, kind: int) -> bool:
        """Whether the vehicle says that it keeps such plans."""
        return bool(self.vehicle.capabilities & geofence.CAPABILITIES[kind])

    def _see_to_plan(self, kind: int) -> Course:
        items, plans = self.wanted.items(kind), self.vehicle.loan.plans
        wants_any = bool(items) or (kind == FENCE and self.wanted.fence is not None)
        if not self._keeps(kind):
            plans.pop(kind, None)
            if wants_any:
                self.notes.append(f"the vehicle keeps no {PLAN_NAMES[kind]}: {_ALONE[kind]}")
        elif items or kind in plans:
            held = yield from self._steps.held(kind)
            yield from self._replace(kind, held, items)

    def _replace(self, kind: int, held: Items, items: Items) -> Course:
        plans = self.vehicle.loan.plans
        loan = plans.get(kind)
        if loan and loan.placed is not None and self._steps.difference(loan.placed, held):
            del plans[kind]  # Somebody else's now
            loan = None
            if not items:
                return
        before = held if loan is None else loan.before
        wanted = items or before
        if self._steps.difference(wanted, held):
            plans[kind] = ExchangedPlan(before, None)
            yield from self._steps.noted()
            yield from self._steps.put(kind, wanted)
        if items:
            plans[kind] = ExchangedPlan(before, items)
        else:
            plans.pop(kind, None)
        if items and before and self._steps.difference(items, before):
            name = PLAN_NAMES[kind]
            self.notes.append(f"the vehicle's own {name} come back after the mission")

    def _see_to_values(self) -> Course:
        """Set what guards the fence; give back what guards it no more."""
        family, geofence = self.vehicle.family, self.wanted.fence
        if geofence is None or not self._keeps(FENCE):
            yield from self._give_back(kept=frozenset())
            return
        held: dict[str, float] = {}
        for name in family.guard_parameters:
            value = yield from self._steps.value(name)
            if value is not None:
                held[name] = value
        self._forget_others(held)
        loan = self.vehicle.loan.values
        before = {name: loan[name].before if name in loan else held[name] for name in held}
        guarding = family.guard(before, geofence, self.wanted.highest_m)
        if guarding.lacks is not None:
            raise StepRefusedError(guarding.lacks)
        yield from self._guard(guarding, held, before)

    def _guard(
        self, guarding: Guarding, held: Mapping[str, float], before: Mapping[str, float]
    ) -> Course:
        self.own_limit_m = guarding.own_limit_m
        self.notes += [guarding.note] if guarding.note else []
        yield from self._give_back(kept=frozenset(setting.name for setting in guarding.settings))
        others = [s for s in guarding.settings if not is_same(held[s.name], s.value)]
        loan = self.vehicle.loan.values
        for name, value in others:
            loan[name] = (loan.get(name) or Borrowed(before[name], ())).and_then(value)
        if others:
            yield from self._steps.noted()
        for setting in others:
            yield from self._steps.set(setting)

    def _give_back(self, kept: frozenset[str]) -> Course:
        """Put the values back that no fence needs any more, the last one first."""
        loan = self.vehicle.loan.values
        for name in [name for name in reversed(loan) if name not in kept]:
            value = yield from self._steps.value(name)
            if value is None:
                raise StepRefusedError(f"parameter {name}: no answer")
            if loan[name].is_ours(value):
                yield from self._steps.set(Setting(name, loan[name].before))
            del loan[name]

    def _forget_others(self, held: Mapping[str, float]) -> None:
        """What somebody else has set since is theirs."""
        loan = self.vehicle.loan.values
        for name in [n for n in loan if n in held and not loan[n].is_ours(held[n])]:
            del loan[name]
