"""Puts a plan's fence and rally points onto a vehicle, and gives back what was there before.

One protocol after the other: what the vehicle holds is read, replaced where it differs, and
proved; then come the parameters that guard the fence. What was there before is remembered in the
vehicle's loan. A fence that somebody else has put there since is theirs, and stays.
"""

import math
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Protocol, TypeAlias

from afarcloud.plan import Geofence
from mavlink_broker.dialect import Message
from mavlink_broker.protocol.command import Accepted, CommandOutcome, Refused
from mavlink_broker.protocol.float_items import POSITION_STEP_DEG, floats_only
from mavlink_broker.protocol.mission_clear import MissionClear, NotCleared
from mavlink_broker.protocol.mission_download import Downloaded, MissionDownload, NotDownloaded
from mavlink_broker.protocol.mission_upload import MissionUpload, NotStored, Stored
from mavlink_broker.protocol.mission_verify import Different, MissionVerify
from mavlink_broker.protocol.parameter_read import ParameterRead, Told
from mavlink_broker.protocol.parameter_write import ParameterWrite, Setting
from mavlink_broker.protocol.plan_kinds import FENCE, PLAN_NAMES, RALLY
from mavlink_broker.translation import fence
from mavlink_broker.translation.guarding import Guarding
from mavlink_broker.translation.loan import ExchangedPlan, ExchangedValue, Items
from mavlink_broker.translation.mission_item import to_message
from mavlink_broker.vehicle import Vehicle

_ALONE: Final = {FENCE: "the broker alone has checked the mission", RALLY: "they were left out"}


class _Step(Protocol):
    """A protocol that has an outcome."""

    @property
    def outcome(self) -> Any:
        """How it ended; None while it runs."""

    def start(self, now: float) -> list[Message]:
        """Begin."""

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""


_Course: TypeAlias = Generator[_Step, Any, None]


class _StopError(Exception):
    """The vehicle refuses something."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a plan wants on its vehicle; nothing: what was there before the plan before it."""

    geofence: Geofence | None = None
    rally: Items = ()
    highest_m: float = 0.0  # Greatest height of the mission

    def items(self, kind: int) -> Items:
        """Give the items of a kind of plan."""
        return self.rally if kind == RALLY else fence.fence_items(self.geofence)


@dataclass(slots=True)
class Fencing:
    """One vehicle on its way to what is wanted."""

    wanted: Wanted
    vehicle: Vehicle
    notes: list[str] = field(default_factory=list)
    own_limit_m: float | None = None  # The vehicle's height limit, narrower than the plan's
    outcome: CommandOutcome | None = None
    _course: _Course | None = None
    _running: _Step | None = None

    @property
    def is_needless(self) -> bool:
        """Whether nothing is wanted, and nothing to be given back."""
        return self.wanted == Wanted(highest_m=self.wanted.highest_m) and (
            not self.vehicle.loan.is_open
        )

    def start(self, now: float) -> list[Message]:
        """Begin; it may be over at once."""
        self._course = self._go()
        return self._advance(None, now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        if self.outcome is not None or self._running is None:
            return []
        return [*self._running.receive(message, now), *self._settle(now)]

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""
        if self.outcome is not None or self._running is None:
            return []
        return [*self._running.tick(now), *self._settle(now)]

    def _settle(self, now: float) -> list[Message]:
        outcome = None if self._running is None else self._running.outcome
        return [] if outcome is None else self._advance(outcome, now)

    def _advance(self, outcome: Any, now: float) -> list[Message]:
        if self._course is None:
            return []
        try:
            self._running = self._course.send(outcome)
        except StopIteration:
            self.outcome = Accepted()
            return []
        except _StopError as error:
            self.outcome = Refused(str(error))
            return []
        return self._running.start(now)

    def _go(self) -> _Course:
        for kind in (FENCE, RALLY):
            yield from self._see_to_plan(kind)
        yield from self._see_to_values()

    def _keeps(self, kind: int) -> bool:
        """Whether the vehicle says that it keeps such plans."""
        return bool(self.vehicle.capabilities & fence.CAPABILITIES[kind])

    def _see_to_plan(self, kind: int) -> _Course:
        items, plans = self.wanted.items(kind), self.vehicle.loan.plans
        if not self._keeps(kind):
            plans.pop(kind, None)
            if items:
                self.notes.append(f"the vehicle keeps no {PLAN_NAMES[kind]}: {_ALONE[kind]}")
            return
        if not items and kind not in plans:
            return
        floats = floats_only(self.vehicle.capabilities)
        download = MissionDownload(*self._link, mission_type=kind, as_floats=floats)
        match (yield download):
            case NotDownloaded(reason):
                raise _StopError(reason)
            case Downloaded(messages):
                yield from self._replace(kind, fence.items_of(messages), items)

    def _replace(self, kind: int, held: Items, items: Items) -> _Course:
        plans = self.vehicle.loan.plans
        loan = plans.get(kind)
        if loan and loan.placed is not None and self._difference(loan.placed, held):
            del plans[kind]  # Somebody else's now
            loan = None
            if not items:
                return
        before = held if loan is None else loan.before
        wanted = items or before
        if self._difference(wanted, held):
            plans[kind] = ExchangedPlan(before, None)
            yield from self._put(kind, wanted)
            loan = plans[kind] = ExchangedPlan(before, items)
        if loan and not items:
            del plans[kind]
        elif loan and before:
            name = PLAN_NAMES[kind]
            self.notes.append(f"the vehicle's own {name} come back after the mission")

    def _put(self, kind: int, items: Items) -> _Course:
        family = self.vehicle.family
        if not items:
            clear = MissionClear(*self._link, mission_type=kind, busy_pause_s=family.busy_pause_s)
            match (yield clear):
                case NotCleared(reason):
                    raise _StopError(reason)
            return
        route = self.vehicle.route
        messages = [
            to_message(
                item,
                seq=seq,
                first=None,
                system=route.target_system,
                component=route.target_component,
                mission_type=kind,
            )
            for seq, item in enumerate(items)
        ]
        upload = MissionUpload(
            messages,
            *self._link,
            busy_pause_s=family.busy_pause_s,
            mission_type=kind,
            as_floats=floats_only(self.vehicle.capabilities),
        )
        match (yield upload):
            case NotStored(reason, item):
                raise _StopError(reason if item is None else f"{reason} at item {item}")
            case Stored(opaque_id):
                yield from self._prove(kind, items, opaque_id)
            case _:
                yield from self._prove(kind, items, 0)

    def _prove(self, kind: int, items: Items, opaque_id: int) -> _Course:
        verify = MissionVerify(
            opaque_id,
            lambda messages: self._difference(items, fence.items_of(messages)),
            *self._link,
            mission_type=kind,
            as_floats=floats_only(self.vehicle.capabilities),
        )
        match (yield verify):
            case Different(reason):
                raise _StopError(f"{PLAN_NAMES[kind]}: {reason}")

    def _see_to_values(self) -> _Course:
        """Set what guards the fence; give back what guards it no more."""
        loan, family, geofence = self.vehicle.loan.values, self.vehicle.family, self.wanted.geofence
        guards = geofence is not None and self._keeps(FENCE)
        held: dict[str, float] = {}
        for name in family.guard_parameters if guards else tuple(loan):
            yield from self._read(name, held)
        for name in [n for n, value in loan.items() if not _same(held.get(n), value.placed)]:
            del loan[name]  # Somebody else's now
        before = {name: loan[name].before if name in loan else held[name] for name in held}
        guarding = Guarding()
        if geofence is not None and guards:
            guarding = family.guard(before, geofence, self.wanted.highest_m)
        if guarding.lacks is not None:
            raise _StopError(guarding.lacks)
        self.own_limit_m = guarding.own_limit_m
        self.notes += [guarding.note] if guarding.note else []
        yield from self._write(guarding.settings, held, before)

    def _write(
        self,
        settings: tuple[Setting, ...],
        held: Mapping[str, float],
        before: Mapping[str, float],
    ) -> _Course:
        loan = self.vehicle.loan.values
        kept = {setting.name for setting in settings}
        for name in [name for name in reversed(loan) if name not in kept]:
            yield from self._set(Setting(name, loan[name].before))
            del loan[name]
        for setting in settings:
            if not _same(held.get(setting.name), setting.value):
                loan[setting.name] = ExchangedValue(before[setting.name], setting.value)
                yield from self._set(setting)

    def _read(self, name: str, held: dict[str, float]) -> _Course:
        read = ParameterRead(name, *self._link, encoding=self.vehicle.parameter_encoding)
        match (yield read):
            case Told(value):
                held[name] = value

    def _set(self, setting: Setting) -> _Course:
        write = ParameterWrite(setting, *self._link, self.vehicle.parameter_encoding)
        match (yield write):
            case Refused(reason):
                raise _StopError(reason)

    def _difference(self, meant: Items, held: Items) -> str | None:
        if floats_only(self.vehicle.capabilities):
            return fence.difference(meant, held, POSITION_STEP_DEG)
        return fence.difference(meant, held)

    @property
    def _link(self) -> tuple[Any, Any]:
        return self.vehicle.route, self.vehicle.round_trip


def _same(held: float | None, value: float) -> bool:
    """Whether a vehicle has a value, to the single precision in which it travels."""
    return held is not None and math.isclose(held, value, rel_tol=1e-6, abs_tol=1e-6)
