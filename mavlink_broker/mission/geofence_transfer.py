"""Places a plan's geofence and rally points on a vehicle, and restores what was there before.

What the vehicle holds is read, replaced where it differs, and verified; then follow the parameters
that enforce the geofence. What was there before is kept in the vehicle's overrides, and is on the
disk before anything changes. A geofence or a value that another system has set since stays.

HeldOtherwiseError  the vehicle holds something else than was placed; a StepRefusedError
"""

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from afarcloud.plan import Geofence
from mavlink_broker.autopilots.parameter_settings import FenceParameters
from mavlink_broker.mavlink.dialect import Message, Route
from mavlink_broker.mavlink.mission_item import to_message
from mavlink_broker.microservices.command import Refused, RoundTrip
from mavlink_broker.microservices.config_overrides import (
    Items,
    OverriddenParameter,
    OverriddenPlan,
    is_same,
)
from mavlink_broker.microservices.mission_download import (
    Different,
    Downloaded,
    MissionDownload,
    MissionVerify,
    NotDownloaded,
)
from mavlink_broker.microservices.mission_protocol import (
    FENCE,
    PLAN_NAMES,
    POSITION_STEP_DEG,
    POSITION_TOLERANCE_DEG,
    RALLY,
    supports_only_float_items,
)
from mavlink_broker.microservices.mission_upload import (
    TRANSFERS,
    MissionClear,
    MissionUpload,
    NotBegun,
    NotCleared,
    NotStored,
    Stored,
)
from mavlink_broker.microservices.parameter import (
    ParameterRead,
    ParameterValue,
    ParameterWrite,
    Setting,
    Written,
)
from mavlink_broker.mission.exchanges import (
    ExchangeSequence,
    SequenceRun,
    Step,
    StepRefusedError,
    Wait,
)
from mavlink_broker.planning import geofence
from mavlink_broker.vehicle.vehicle import Vehicle

READ_ATTEMPTS: Final = 10
WRITE_ROUNDS: Final = 3
"""Attempts to read or set a parameter: at 20 % loss each way one in 20,000 fails."""
AGAIN_AFTER_S: Final = 30.0
OFF_FOR_S: Final = 0.5
"""A vehicle reads its switch ten times a second."""
_LOG = logging.getLogger(__name__)
_ALONE: Final = {FENCE: "the broker alone has checked the mission", RALLY: "they were left out"}


class HeldOtherwiseError(StepRefusedError):
    """The vehicle has acknowledged a plan, and holds something else."""


@dataclass(frozen=True, slots=True)
class VehicleSteps:
    """The steps on one vehicle; each raises StepRefusedError where the vehicle refuses."""

    vehicle: Vehicle

    def journal_stored(self) -> Step:
        """Wait until the journal holds what the sequence is about to change."""
        yield Wait(lambda _: self.vehicle.recovery.is_stored)

    def read_items(self, kind: int) -> Step:
        """Read a fence or rally points."""
        download = MissionDownload(*self._link, mission_type=kind, as_floats=self._floats)
        match (yield download):
            case Downloaded(messages):
                return geofence.items_of(messages)
            case NotDownloaded(reason):
                raise StepRefusedError(reason)

    def replace_items(self, kind: int, items: Items) -> Step:
        """Replace a fence or rally points, and prove it; no items remove them.

        Gives why it was not begun, or None: a busy vehicle may be taking those of another system.
        """
        if not items:
            match (yield MissionClear(*self._link, mission_type=kind)):
                case NotCleared(reason):
                    raise StepRefusedError(reason)
                case NotBegun(reason):
                    return reason
            return None
        upload = MissionUpload(
            self._messages(kind, items),
            *self._link,
            busy_pause_s=self.vehicle.family.busy_pause_s,
            mission_type=kind,
            yields=True,
            as_floats=self._floats,
        )
        match (yield upload):
            case NotStored(reason, item):
                raise StepRefusedError(reason if item is None else f"{reason} at item {item}")
            case NotBegun(reason):
                return reason
            case Stored(opaque_id):
                yield from self._prove(kind, items, opaque_id)
            case _:
                yield from self._prove(kind, items, 0)
        return None

    def read_parameter(self, name: str) -> Step:
        """Read a parameter; None without an answer, and where the vehicle's version lacks it.

        A value that is not a number is refused: it could not be restored.
        """
        if 0 < self.vehicle.software_version < self.vehicle.family.parameters_since.get(name, 0):
            return None
        encoding = self.vehicle.parameter_encoding
        read = ParameterRead(name, *self._link, encoding=encoding, attempts=READ_ATTEMPTS)
        outcome = yield read
        if not isinstance(outcome, ParameterValue):
            return None
        if not math.isfinite(outcome.value):
            raise StepRefusedError(f"parameter {name}: {outcome.value} is not a number")
        return outcome.value

    def set_parameter(self, setting: Setting) -> Step:
        """Write a parameter, and see the vehicle show it."""
        refusal = Refused("")
        for _ in range(WRITE_ROUNDS):
            outcome = yield ParameterWrite(setting, *self._link, self.vehicle.parameter_encoding)
            match outcome:
                case Written():
                    return
                case Refused():
                    refusal = outcome
        raise StepRefusedError(refusal.reason)

    def difference(self, wanted: Items, held: Items) -> str | None:
        """Name the first difference beyond the precision of the vehicle's storage, or None."""
        return geofence.difference(
            wanted,
            held,
            tolerance_deg=POSITION_STEP_DEG if self._floats else POSITION_TOLERANCE_DEG,
            altitude_step_m=self.vehicle.family.rally_altitude_step_m,
        )

    def _prove(self, kind: int, items: Items, opaque_id: int) -> Step:
        verify = MissionVerify(
            opaque_id,
            lambda messages: self.difference(items, geofence.items_of(messages)),
            *self._link,
            mission_type=kind,
            as_floats=self._floats,
        )
        match (yield verify):
            case Different(reason):
                raise HeldOtherwiseError(f"{PLAN_NAMES[kind]}: {reason}")

    def _messages(self, kind: int, items: Items) -> list[Message]:
        route = self.vehicle.route
        return [
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

    @property
    def _floats(self) -> bool:
        return supports_only_float_items(self.vehicle.capabilities)

    @property
    def _link(self) -> tuple[Route, RoundTrip]:
        return self.vehicle.route, self.vehicle.round_trip


@dataclass(frozen=True, slots=True)
class WantedGeofence:
    """Geofence and rally points of a plan; empty: what was there before the last plan."""

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


class GeofenceTransfer(SequenceRun):
    """The transfer to one vehicle."""

    def __init__(self, wanted: WantedGeofence, vehicle: Vehicle) -> None:
        super().__init__(self._go())
        self._wanted = wanted
        self._vehicle = vehicle
        self._steps = VehicleSteps(vehicle)
        self.notes: list[str] = []
        self.own_limit_m: float | None = None  # The vehicle's limit, narrower than the plan's

    @property
    def is_needless(self) -> bool:
        """Whether nothing is to be placed or restored."""
        return self._wanted.is_nothing and not self._vehicle.overrides.is_open

    def _go(self) -> ExchangeSequence:
        for kind in (FENCE, RALLY):
            yield from self._transfer_plan(kind)
        yield from self._transfer_parameters()

    def _keeps(self, kind: int) -> bool:
        """Whether the vehicle's capabilities include such plans."""
        return bool(self._vehicle.capabilities & geofence.CAPABILITIES[kind])

    def _transfer_plan(self, kind: int) -> ExchangeSequence:
        items, plans = self._wanted.items(kind), self._vehicle.overrides.plans
        wants_any = bool(items) or (kind == FENCE and self._wanted.fence is not None)
        if not self._keeps(kind):
            plans.pop(kind, None)
            if wants_any:
                self.notes.append(f"the vehicle keeps no {PLAN_NAMES[kind]}: {_ALONE[kind]}")
        elif items or kind in plans:
            refusal: str | None = None
            for attempt in range(TRANSFERS):
                if attempt:
                    yield Wait(lambda waited_s: waited_s >= self._vehicle.family.busy_pause_s)
                held = yield from self._steps.read_items(kind)
                refusal = yield from self._replace(kind, held, items)
                if refusal is None:
                    return
            raise StepRefusedError(f"{refusal} ({TRANSFERS} times)")

    def _replace(self, kind: int, held: Items, items: Items) -> Step:
        """Replace what the vehicle holds where it differs; gives why that was not begun, or None.

        What it holds is not known any more then: it may be taking something of another system.
        """
        plans = self._vehicle.overrides.plans
        override = plans.get(kind)
        if (
            override
            and override.placed is not None
            and self._steps.difference(override.placed, held)
        ):
            del plans[kind]  # Another system has replaced it
            override = None
            if not items:
                return None
        before = held if override is None else override.before
        wanted = items or before
        if self._steps.difference(wanted, held):
            plans[kind] = OverriddenPlan(before, None)
            yield from self._steps.journal_stored()
            try:
                refusal = yield from self._steps.replace_items(kind, wanted)
            except HeldOtherwiseError:
                held = yield from self._steps.read_items(kind)
                if held and not geofence.resembles(held, wanted):
                    del plans[kind]  # Another system has replaced it at once
                raise
            if refusal is not None:
                del plans[kind]
                if override is not None:
                    plans[kind] = override
                return refusal
        if items:
            plans[kind] = OverriddenPlan(before, items)
        else:
            plans.pop(kind, None)
        if items and before and self._steps.difference(items, before):
            name = PLAN_NAMES[kind]
            self.notes.append(f"the vehicle gets its own {name} back after the mission")
        return None

    def _transfer_parameters(self) -> ExchangeSequence:
        """Set what enforces the geofence; restore the other parameters."""
        family, geofence = self._vehicle.family, self._wanted.fence
        if geofence is None or not self._keeps(FENCE):
            yield from self._restore_parameters(kept=frozenset())
            return
        held: dict[str, float] = {}
        for name in family.fence_parameter_names:
            value = yield from self._steps.read_parameter(name)
            if value is not None:
                held[name] = value
        self._drop_foreign_values(held)
        overrides = self._vehicle.overrides.values
        before = {
            name: overrides[name].before if name in overrides else held[name] for name in held
        }
        parameters = family.fence_parameters(before, geofence, self._wanted.highest_m)
        if parameters.lacks is not None:
            raise StepRefusedError(parameters.lacks)
        yield from self._enforce(parameters, held, before)

    def _enforce(
        self, parameters: FenceParameters, held: Mapping[str, float], before: Mapping[str, float]
    ) -> ExchangeSequence:
        self.own_limit_m = parameters.own_limit_m
        self.notes += [parameters.note] if parameters.note else []
        yield from self._restore_parameters(
            kept=frozenset(setting.name for setting in parameters.settings)
        )
        others = [s for s in parameters.settings if not is_same(held[s.name], s.value)]
        latched, switch = parameters.latched or (None, None)
        must_switch = held.get(switch or "") and latched in {setting.name for setting in others}
        if switch is not None and must_switch:
            others = [Setting(switch, 0.0), *others, Setting(switch, 1.0)]
        overrides = self._vehicle.overrides.values
        for name, value in others:
            overrides[name] = (
                overrides.get(name) or OverriddenParameter(before[name], ())
            ).with_value(value)
        if others:
            yield from self._steps.journal_stored()
        for setting in others:
            yield from self._steps.set_parameter(setting)
            if setting == (switch, 0.0):
                yield Wait(lambda waited_s: waited_s >= OFF_FOR_S)

    def _restore_parameters(self, kept: frozenset[str]) -> ExchangeSequence:
        """Restore the values that no geofence needs any more, the last one first."""
        overrides = self._vehicle.overrides.values
        for name in [name for name in reversed(overrides) if name not in kept]:
            if (yield from self._stays_on(name)):
                continue
            value = yield from self._steps.read_parameter(name)
            if value is None:
                raise StepRefusedError(f"parameter {name}: no answer")
            if overrides[name].is_ours(value):
                yield from self._steps.set_parameter(Setting(name, overrides[name].before))
            del overrides[name]

    def _stays_on(self, name: str) -> Step:
        """Whether a parameter is restored behind the landing only.

        It enables also a fence that the vehicle had enabled itself, and will not again in flight.
        """
        switch, by_itself = self._vehicle.family.fence_switch or (None, "")
        if name != switch or self._vehicle.snapshot.is_on_ground:
            return False
        return bool((yield from self._steps.read_parameter(by_itself)))

    def _drop_foreign_values(self, held: Mapping[str, float]) -> None:
        """Keep what another system has set since."""
        overrides = self._vehicle.overrides.values
        for name in [n for n in overrides if n in held and not overrides[n].is_ours(held[n])]:
            del overrides[name]


class VehicleConfigRestorer:
    """Restores the vehicle's own geofence and parameters when it has landed and has no mission.

    After a landing and a power-off, when the link is back.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self.transfer: GeofenceTransfer | None = None
        self._not_before = -math.inf
        self._is_reachable = False
        self._refusal: str | None = None  # Why the last attempt has failed

    @property
    def is_due(self) -> bool:
        """Whether something is still to be restored, and can be now."""
        return self._waits and self._refusal is None

    @property
    def warning(self) -> str | None:
        """What the vehicle keeps, and why; None while nothing has failed."""
        if self._refusal is None or not self._vehicle.overrides.is_open:
            return None
        return f"it keeps the geofence and limits of its last plan: {self._refusal}"

    @property
    def _waits(self) -> bool:
        vehicle = self._vehicle
        return self._is_reachable and vehicle.overrides.is_open and vehicle.snapshot.is_on_ground

    def step(self, now: float, *, idle: bool) -> list[Message]:
        """Do what is due at a time; a mission that begins takes everything over."""
        self._is_reachable = self._vehicle.is_reachable(now)
        if not (idle and self._is_reachable):
            self._refusal = None
        if not idle or not self._waits or now < self._not_before:
            self.transfer = None
            return []
        if self.transfer is None:
            self.transfer = GeofenceTransfer(WantedGeofence(), self._vehicle)
            return self.transfer.start(now)
        messages = self.transfer.tick(now)
        if isinstance(self.transfer.outcome, Refused):
            self._refusal = self.transfer.outcome.reason
            self._not_before = now + AGAIN_AFTER_S
            _LOG.warning("vehicle %d: %s", self._vehicle.vehicle_id, self.warning)
        return messages
