"""A sequence of protocols that run one after the other until one of them is refused.

A sequence is a generator that yields protocols and is sent their outcomes, so that what depends on
an answer is written in the order in which it happens.

StepRefusedError  the vehicle refuses a step, or does not answer
"""

import math
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Any, Final, Protocol, TypeAlias

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.mavlink.mission_item import to_message
from mavlink_broker.microservices.command import Accepted, CommandOutcome, Refused
from mavlink_broker.microservices.config_overrides import Items
from mavlink_broker.microservices.mission_clear import MissionClear, NotCleared
from mavlink_broker.microservices.mission_download import Downloaded, MissionDownload, NotDownloaded
from mavlink_broker.microservices.mission_protocol import (
    PLAN_NAMES,
    POSITION_STEP_DEG,
    supports_only_float_items,
)
from mavlink_broker.microservices.mission_upload import MissionUpload, NotStored, Stored
from mavlink_broker.microservices.mission_verify import Different, MissionVerify
from mavlink_broker.microservices.parameter import (
    ParameterRead,
    ParameterValue,
    ParameterWrite,
    Setting,
    Written,
)
from mavlink_broker.microservices.round_trip import RoundTrip
from mavlink_broker.planning import geofence
from mavlink_broker.vehicle.vehicle import Vehicle

READ_ATTEMPTS: Final = 10
WRITE_ROUNDS: Final = 3
"""Attempts to read or set a parameter: at 20 % loss each way one in 20,000 fails."""


class StepProtocol(Protocol):
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


TransferSequence: TypeAlias = Generator[StepProtocol, Any, None]
Step: TypeAlias = Generator[StepProtocol, Any, Any]


class StepRefusedError(Exception):
    """The vehicle refuses a step, or does not answer."""


@dataclass(slots=True)
class SequenceRun:
    """A running sequence; accepted when it ends."""

    sequence: TransferSequence
    outcome: CommandOutcome | None = None
    _running: StepProtocol | None = field(default=None)

    def start(self, now: float) -> list[Message]:
        """Begin; it may be over at once."""
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
        try:
            self._running = self.sequence.send(outcome)
        except StopIteration:
            self.outcome = Accepted()
            return []
        except StepRefusedError as error:
            self.outcome = Refused(str(error))
            return []
        return self._running.start(now)


@dataclass(slots=True)
class _JournalWait:
    """Waits until the recovery state of a vehicle is on the disk."""

    vehicle: Vehicle
    outcome: Accepted | None = None

    def start(self, now: float) -> list[Message]:
        return self.tick(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        del message
        return self.tick(now)

    def tick(self, now: float) -> list[Message]:
        del now
        if self.vehicle.recovery.is_stored:
            self.outcome = Accepted()
        return []


@dataclass(frozen=True, slots=True)
class VehicleSteps:
    """The steps on one vehicle; each raises StepRefusedError where the vehicle refuses."""

    vehicle: Vehicle

    def journal_stored(self) -> Step:
        """Wait until the journal holds what the sequence is about to change."""
        yield _JournalWait(self.vehicle)

    def read_items(self, kind: int) -> Step:
        """Read a fence or rally points."""
        download = MissionDownload(*self._link, mission_type=kind, as_floats=self._floats)
        match (yield download):
            case Downloaded(messages):
                return geofence.items_of(messages)
            case NotDownloaded(reason):
                raise StepRefusedError(reason)

    def replace_items(self, kind: int, items: Items) -> Step:
        """Replace a fence or rally points, and prove it; no items remove them."""
        pause_s = self.vehicle.family.busy_pause_s
        if not items:
            clear = MissionClear(*self._link, mission_type=kind, busy_pause_s=pause_s)
            match (yield clear):
                case NotCleared(reason):
                    raise StepRefusedError(reason)
            return
        upload = MissionUpload(
            self._messages(kind, items),
            *self._link,
            busy_pause_s=pause_s,
            mission_type=kind,
            as_floats=self._floats,
        )
        match (yield upload):
            case NotStored(reason, item):
                raise StepRefusedError(reason if item is None else f"{reason} at item {item}")
            case Stored(opaque_id):
                yield from self._prove(kind, items, opaque_id)
            case _:
                yield from self._prove(kind, items, 0)

    def read_parameter(self, name: str) -> Step:
        """Read a parameter; None without an answer.

        A value that is not a number is refused: it could not be restored.
        """
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
            tolerance_deg=POSITION_STEP_DEG if self._floats else geofence.TOLERANCE_DEG,
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
                raise StepRefusedError(f"{PLAN_NAMES[kind]}: {reason}")

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
