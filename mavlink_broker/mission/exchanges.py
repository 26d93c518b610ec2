"""The protocol that runs with the vehicle in each state, built from the plan and the vehicle.

An upload is verified: `difference` compares what was downloaded with what was uploaded.

Exchanges that run one after the other until one of them is refused are a sequence: a generator that
yields exchanges and is sent their outcomes, so that what depends on an answer is written in the
order in which it happens.

StepRefusedError  the vehicle refuses a step, or does not answer
"""

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeAlias, TypeVar

from mavlink_broker.autopilots.families import Family
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.mission_item import MissionItem, from_message
from mavlink_broker.microservices.command import (
    Accepted,
    CommandAlternatives,
    CommandOutcome,
    Refused,
    long_command,
)
from mavlink_broker.microservices.mission_download import MissionVerify, VerifyOutcome
from mavlink_broker.microservices.mission_protocol import (
    ALTITUDE_TOLERANCE_M,
    POSITION_STEP_DEG,
    POSITION_TOLERANCE_DEG,
    MissionSetCurrent,
    supports_only_float_items,
)
from mavlink_broker.microservices.mission_upload import MissionUpload, UploadOutcome
from mavlink_broker.planning.mission import FlightPlan
from mavlink_broker.vehicle.vehicle import Vehicle

HOME_TOLERANCE_DEG: Final = 2e-4
"""Some 20 m: vehicles set home when they are armed, at their estimated position."""
PARAMETER_TOLERANCE: Final = 1e-5
"""Relative, or absolute below 1: messages carry single precision."""

YAW_TOLERANCE_DEG: Final = 1e-2
"""PX4 stores radians."""
RADIUS_IN_TENS_ABOVE_M: Final = 255.0
"""ArduPilot stores the radius of a circle in a byte, a larger one in tens of metres."""

_YAW: Final = 3
"""Index of the yaw: the fourth parameter."""
_WITH_YAW: Final = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF,
    }
)
_SPEED: Final = (mavlink.MAV_CMD_DO_CHANGE_SPEED, 1)
"""Index of the speed: the second parameter."""
_AMSL: Final = mavlink.MAV_FRAME_GLOBAL_INT


def difference(
    plan: FlightPlan,
    messages: Sequence[Message],
    family: Family,
    *,
    home_may_have_moved: bool = False,
) -> str | None:
    """Name the first difference that the family's storage does not explain, or None.

    A home item is the vehicle's own and is not compared. A mission that flies since an earlier run
    of the broker (`home_may_have_moved`) may differ in two cases: a position that was home then may
    be some metres from home now, and an event may have changed the speed.
    """
    if len(messages) != len(plan.items):
        return f"the vehicle holds {len(messages)} items instead of {len(plan.items)}"
    for seq in range(plan.first_item, len(plan.items)):
        sent, held = plan.items[seq], from_message(messages[seq])
        moved = home_may_have_moved and sent.at_home
        is_float = messages[seq].get_type() == "MISSION_ITEM"
        precision_deg = POSITION_STEP_DEG if is_float else POSITION_TOLERANCE_DEG
        tolerance_deg = HOME_TOLERANCE_DEG if moved else precision_deg
        name = _different_field(sent, held, family, tolerance_deg, loosely=home_may_have_moved)
        if name:
            return f"item {seq} on the vehicle differs in {name}"
    return None


def _different_field(
    sent: MissionItem,
    held: MissionItem,
    family: Family,
    tolerance_deg: float,
    *,
    loosely: bool,
) -> str | None:
    if sent.command != held.command:
        return "command"
    kept = family.stored_parameters.get(sent.command, frozenset(range(4)))
    for index in sorted(kept):
        if loosely and (sent.command, index) == _SPEED:
            continue
        if not _same(sent, held, index, family):
            return f"parameter {index + 1}"
    return _different_place(sent, held, tolerance_deg) if sent.is_positional else None


def _different_place(sent: MissionItem, held: MissionItem, tolerance_deg: float) -> str | None:
    same = {
        "frame": _frame(sent) == _frame(held),
        "latitude": abs(sent.latitude_deg - held.latitude_deg) <= tolerance_deg,
        "longitude": abs(sent.longitude_deg - held.longitude_deg) <= tolerance_deg,
        "altitude": abs(sent.altitude_m - held.altitude_m) <= ALTITUDE_TOLERANCE_M,
    }
    return next((name for name, is_same in same.items() if not is_same), None)


def _same(sent: MissionItem, held: MissionItem, index: int, family: Family) -> bool:
    """Compare one parameter as the family stores it."""
    wanted, stored = sent.parameters[index], held.parameters[index]
    if index == _YAW and sent.command in _WITH_YAW and math.isfinite(wanted - stored):
        return abs(math.remainder(wanted - stored, 360.0)) <= YAW_TOLERANCE_DEG
    if index in family.truncated_parameters.get(sent.command, frozenset()):
        in_tens = sent.command == mavlink.MAV_CMD_NAV_LOITER_TURNS and index > 0
        step = 10.0 if in_tens and abs(wanted) > RADIUS_IN_TENS_ABOVE_M else 1.0
        return abs(wanted - stored) < step
    return _same_parameter(wanted, stored)


def _same_parameter(sent: float, held: float) -> bool:
    """Compare; an unset yaw (NaN) equals NaN only, for 0 would be north."""
    if math.isnan(sent) or math.isnan(held):
        return math.isnan(sent) and math.isnan(held)
    return math.isclose(sent, held, rel_tol=PARAMETER_TOLERANCE, abs_tol=PARAMETER_TOLERANCE)


def _frame(item: MissionItem) -> int:
    return _AMSL if item.frame == mavlink.MAV_FRAME_GLOBAL else item.frame


Outcome: TypeAlias = UploadOutcome | VerifyOutcome | CommandOutcome
Outcome_co = TypeVar("Outcome_co", covariant=True)


class Exchange(Protocol[Outcome_co]):
    """A protocol that runs with the vehicle and has an outcome."""

    @property
    def outcome(self) -> Outcome_co | None:
        """How it ended; None while it runs."""

    def start(self, now: float) -> list[Message]:
        """Begin."""

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the vehicle."""

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue."""


ExchangeSequence: TypeAlias = Generator[Exchange[Any], Any, None]
Step: TypeAlias = Generator[Exchange[Any], Any, Any]


class StepRefusedError(Exception):
    """The vehicle refuses a step, or does not answer."""


class SequenceRun:
    """A running sequence; accepted when it ends."""

    def __init__(self, sequence: ExchangeSequence) -> None:
        self._sequence = sequence
        self._running: Exchange[Any] | None = None
        self.outcome: CommandOutcome | None = None

    def start(self, now: float) -> list[Message]:
        """Begin; it may be over at once."""
        return self._advance(None, now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the vehicle."""
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
            self._running = self._sequence.send(outcome)
        except StopIteration:
            self.outcome = Accepted()
            return []
        except StepRefusedError as error:
            self.outcome = Refused(str(error))
            return []
        return self._running.start(now)


@dataclass(slots=True)
class Wait:
    """Waits until a condition holds; `is_over` is a function of the time since the start [s]."""

    is_over: Callable[[float], bool]
    outcome: Accepted | None = None
    _since: float = 0.0

    def start(self, now: float) -> list[Message]:
        """Begin; it may be over at once."""
        self._since = now
        return self.tick(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Look again: the vehicle has sent something."""
        del message
        return self.tick(now)

    def tick(self, now: float) -> list[Message]:
        """Look whether it is over."""
        if self.is_over(now - self._since):
            self.outcome = Accepted()
        return []


def upload(plan: FlightPlan, vehicle: Vehicle) -> MissionUpload:
    """Put the plan onto the vehicle."""
    route = vehicle.route
    return MissionUpload(
        plan.messages(*route.target),
        route,
        vehicle.round_trip,
        busy_pause_s=vehicle.family.busy_pause_s,
        as_floats=supports_only_float_items(vehicle.capabilities),
    )


def cancellation(vehicle: Vehicle) -> Message:
    """End an upload in the middle: the vehicle keeps what it had."""
    cancelled = mavlink.MAV_MISSION_OPERATION_CANCELLED
    return mavlink.MAVLink_mission_ack_message(*vehicle.route.target, cancelled)


def verification(plan: FlightPlan, vehicle: Vehicle, opaque_id: int) -> MissionVerify:
    """Prove that the vehicle holds the plan; without an id, by reading it back."""
    return _comparison(plan, vehicle, opaque_id, home_may_have_moved=False)


def recognition(plan: FlightPlan, vehicle: Vehicle) -> MissionVerify:
    """Find out whether the vehicle holds the plan since an earlier run of the broker."""
    return _comparison(plan, vehicle, 0, home_may_have_moved=True)


def _comparison(
    plan: FlightPlan, vehicle: Vehicle, opaque_id: int, *, home_may_have_moved: bool
) -> MissionVerify:
    def compare(messages: Sequence[Message]) -> str | None:
        """By the family as it is known when the items have been read back."""
        return difference(plan, messages, vehicle.family, home_may_have_moved=home_may_have_moved)

    floats = supports_only_float_items(vehicle.capabilities)
    return MissionVerify(opaque_id, compare, vehicle.route, vehicle.round_trip, as_floats=floats)


def selection(plan: FlightPlan, vehicle: Vehicle) -> MissionSetCurrent:
    """Make the first item the current one."""
    first = plan.first_item
    shown_as = range(first, plan.first_leg + 1)
    resets = not vehicle.family.reset_resumes
    link = vehicle.route, vehicle.round_trip
    return MissionSetCurrent(first, *link, shown_as=shown_as, resets=resets)


def hold_on_ground(vehicle: Vehicle) -> Message:
    """Ask for the family's hold mode; only the vehicle's next heartbeat shows whether it accepted.

    A vehicle of which only the mode is wrong is not ready to arm in it.
    """
    return vehicle.family.holding[0][0].message(vehicle.route, 0)


def arming_checks(vehicle: Vehicle) -> Message:
    """Request the arming checks; failed ones arrive as status texts."""
    return long_command(mavlink.MAV_CMD_RUN_PREARM_CHECKS).message(vehicle.route, 0)


def disarming(vehicle: Vehicle) -> list[Message]:
    """Stop the propellers of a vehicle on the ground that will not be flown; never in the air.

    One that reports itself disarmed is ordered too: its answer to the order to arm comes before
    its next heartbeat, and that order may not have arrived yet.
    It leaves its mission mode too: whoever arms it next would fly off on what has failed.
    """
    snapshot = vehicle.snapshot
    if snapshot.landed_state != mavlink.MAV_LANDED_STATE_ON_GROUND:
        return []
    would_fly = vehicle.mode_role is ModeRole.MISSION and vehicle.family.knows_modes
    order = long_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0).message(vehicle.route, 0)
    return [*([hold_on_ground(vehicle)] if would_fly else []), order]


def parking(vehicle: Vehicle) -> list[Message]:
    """Disarm what drives or swims, once its mission is over: it does not do so by itself."""
    if not vehicle.stays_on_ground or not vehicle.snapshot.armed:
        return []
    disarm = long_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
    return [disarm.message(vehicle.route, 0), disarm.message(vehicle.route, 1)]


def repetition(alternatives: CommandAlternatives, vehicle: Vehicle) -> Message:
    """Repeat the first command of the first alternative, marked as a repetition."""
    return alternatives[0][0].message(vehicle.route, 1)
