"""What a vehicle is ordered after an event or an alarm: land, go to a place, return.

    on the ground        disarm, and stay there; also while an order to arm may still arrive, until
                         it shows that it is in the air; not received: disarm once, then land
    without a position   land here: neither a place nor home can be found
    else                 what the event orders

An order that is refused, not answered or not obeyed is repeated for as long as the vehicle is
armed; a place that it will not go to is replaced by a landing, unless the link was away meanwhile.
The orders end at once when another system takes command of the vehicle, or its own failsafe does. A
vehicle that is not received shows neither: after `UNHEARD_S` it gets no order before it is again.
An order that leads to a place becomes a landing as soon as the vehicle has lost its position.

`UnconfirmedMissions` decides when the answer to an abort may be sent.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Final

from afarcloud.enumerations import EventType
from afarcloud.plan import AbortPoint
from afarcloud.plan import Event as AbortEvent
from afarcloud.route import Spot
from mavlink_broker.autopilots.families import Family
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.edge.wire import AcceptanceResult, EventWork, MissionWork
from mavlink_broker.effects import Acknowledgement, EdgeMessage, Effects
from mavlink_broker.live.executor import LiveCommandExecutor, LivePhase
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import CommandAlternatives, long_command
from mavlink_broker.planning.geofence import AreaCheck
from mavlink_broker.planning.situation import Lasted, LiveAction, Pose
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import AIRBORNE_MODES, DESCENT_MODES, Authority, Claim
from mavlink_broker.vehicle.recovery_state import PendingAbort
from mavlink_broker.vehicle.vehicle import Vehicle

AGAIN_AFTER_S: Final = 1.5
"""Longer than a mode takes to show in a heartbeat."""
WITHIN_S: Final = 600.0
"""To reach a place; then the vehicle lands where it is."""
UNHEARD_S: Final = 30.0
"""How long a vehicle that is not received still gets orders: the link to it may work."""
LATE_ORDER_S: Final = 5.0
"""How long an order of the mission may arrive after one that ends it: a timeout of a command."""
NOT_PLACED: Final = "the position of the vehicle is not known: it lands where it is"
NOT_THERE: Final = "the vehicle has landed before it was there"
STANDS: Final = "the vehicle is on the ground: it does not go there"
NOT_OBEYED: Final = "the vehicle cannot be ordered there: it lands where it is"
ANSWERED_KEPT: Final = 256
"""Pieces of work of which a second final answer is recognised."""
_BEGUN: Final = frozenset({LivePhase.RUNNING, LivePhase.ENDING, LivePhase.DONE})
_DISARM: Final = long_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
REASONS: Final = {
    EventType.ABORT_MISSION: "aborted by an event",
    EventType.SOFT_ABORT_MISSION: "aborted softly by an event",
    EventType.RETURN_HOME: "aborted by an event that orders a return home",
}


def return_event(vehicle_id: int) -> AbortEvent:
    """The event that ends a mission after an alarm."""
    return AbortEvent(vehicle_id=vehicle_id, event_type_id=EventType.RETURN_HOME)


def abort_note(event: AbortEvent, work: EventWork, vehicle: Vehicle) -> PendingAbort:
    """Describe an abort for the journal; a restarted broker carries it out."""
    there = event.abort
    point = None if there is None else Pose(there.latitude, there.longitude, there.altitude)
    return PendingAbort(
        work_id=work.work_id,
        identity=work.identity,
        event_type=int(event.event_type_id),
        point=point,
        noted_s=vehicle.snapshot.time_s,
    )


def noted_event(note: PendingAbort, vehicle_id: int) -> AbortEvent:
    """Read an abort that an earlier run of the broker has noted."""
    place = note.point
    point = place and AbortPoint(latitude=place[0], longitude=place[1], altitude=place[2])
    return AbortEvent(vehicle_id=vehicle_id, event_type_id=EventType(note.event_type), abort=point)


def note_on_ground(event: AbortEvent) -> str | None:
    """What becomes of an event whose vehicle stands already; None if it is as ordered."""
    return None if event.abort is None else STANDS


def within_fence(
    event: AbortEvent, area: AreaCheck | None, vehicle: Vehicle
) -> tuple[AbortEvent, str | None]:
    """Leave out a place that the plan's geofence forbids, and name what comes instead.

    An emergency is not refused for it: the vehicle lands where it is, or returns.
    """
    point, here = event.abort, vehicle.snapshot.position
    if area is None or point is None:
        return event, None
    start = None if here is None else (here.latitude_deg, here.longitude_deg)
    fault = area.fault_of_order(start, Spot(point.latitude, point.longitude, point.altitude))
    if fault is None:
        return event, None
    is_soft = event.event_type_id is EventType.SOFT_ABORT_MISSION
    instead = "it returns and lands" if is_soft else "it lands where it is"
    return event.model_copy(update={"abort": None}), f"abort: {fault}: {instead}"


def _airborne_action(event: AbortEvent, vehicle: Vehicle, *, with_place: bool) -> LiveAction:
    """What an abort asks of a vehicle in the air; without its place its last order only."""
    point = event.abort if with_place else None
    spot = None if point is None else Spot(point.latitude, point.longitude, point.altitude)
    begin = _last_order(event, vehicle.family)
    return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, approach=spot, moves=False)


def land_action(vehicle: Vehicle) -> LiveAction:
    """Land where the vehicle is."""
    begin = vehicle.family.landing
    return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, moves=False)


def disarm_action(vehicle: Vehicle) -> LiveAction:
    """Stop the propellers of a vehicle on the ground; one that refuses may be off it: it lands.

    It leaves its mission mode first: whoever arms it next would fly off on what was aborted.
    """
    family = vehicle.family
    begin = ((*family.holding[0], _DISARM), (_DISARM,), *family.landing)
    return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, moves=False)


def _last_order(event: AbortEvent, family: Family) -> CommandAlternatives:
    if event.event_type_id is EventType.ABORT_MISSION:
        return family.landing
    return family.returning if event.abort is None else family.holding


_BEFORE_HOLD: Final = frozenset({ModeRole.MISSION})
_BEFORE_HOLD_INSTEAD: Final = frozenset({ModeRole.MISSION, ModeRole.ENDING})
"""Of a vehicle that was ordered to return or land before."""


class AbortExecutor:
    """Orders what an abort asks for until the vehicle has obeyed."""

    def __init__(
        self,
        event: AbortEvent,
        vehicle: Vehicle,
        *,
        was_ours: bool = False,
        replaces: bool = False,
        arms_until: float | None = None,
    ) -> None:
        """Begin with nothing sent; `was_ours` if the broker has ordered the mode that it is in.

        `replaces` if it was sent home or down before, which it may show only after the first order.
        `arms_until` is the time until which an order to arm that was sent may still take effect
        on a vehicle that reports itself disarmed; None if there is no such order.
        """
        self._event = event
        self._vehicle = vehicle
        self._arms_until = arms_until
        self._first_mode = vehicle.mode if was_ours else None  # Ours until it is left
        self._replaces = replaces
        self._descends_until = math.inf if replaces else -math.inf  # By the order before
        self._again_at = math.inf
        self._may_be_lost = False  # What was sent since the action began: the link was away, or
        # the vehicle might be restarted, to which none is sent
        self._unheard_since: float | None = None  # None: the vehicle shows itself
        self._lands_instead = False
        self._is_there = event.abort is None  # At the place, if there is one
        self._lands_here: str | None = None  # Why that was ordered last, instead of its own place
        self._obeyed_at: float | None = None  # It has left its mission
        self._ordered_at: float | None = None
        self._mode_before: str | None = vehicle.mode  # Until it is in its mission
        self.taken: str | None = None  # Who has taken the vehicle meanwhile
        self._needs_position = False  # For what is ordered
        self._disarms = False  # What is ordered is for the ground
        self._was_flying = bool(vehicle.snapshot.armed) and not vehicle.is_standing_armed
        self._was_answered = event.abort is not None  # Not followed on the way to a place
        self._executor = LiveCommandExecutor(self._action(with_place=True), vehicle)

    def is_over(self, now: float) -> bool:
        """Whether the vehicle has obeyed the last order, is disarmed, or is another system's.

        While its link is away, or it may have been restarted, nothing shows what it does.
        """
        if self.taken is not None:
            return True
        if not self._vehicle.shows_itself(now):
            return False
        if self._vehicle.snapshot.armed is False:
            return self._is_down_for_good
        is_done = self._executor.phase is LivePhase.DONE
        return is_done and not self._flies_on and not self._vehicle.is_standing_armed

    @property
    def _is_down_for_good(self) -> bool:
        """Whether it is disarmed, and no order to arm may still arrive."""
        return self._vehicle.snapshot.armed is False and self._arms_until is None

    def may_fly_on(self, now: float, *, lands_itself: bool) -> bool:
        """Whether the vehicle has not shown yet that it does something else than its mission.

        `lands_itself` if the mission may have put it into a mode of landing or return.
        """
        if self.is_over(now) or self.is_unheard(now):
            return False
        if self._vehicle.family.knows_modes and self._vehicle.mode_role is ModeRole.MISSION:
            return True
        if self._obeyed_at is not None:
            is_ending = self._vehicle.mode_role is ModeRole.ENDING
            return lands_itself and is_ending and not self._was_answered
        return self._vehicle.family.knows_modes or self._executor.phase not in _BEGUN

    @property
    def has_come_down_unanswered(self) -> bool:
        """Whether a vehicle that flew has landed without having answered any order."""
        is_down = self._vehicle.snapshot.armed is False and self.taken is None
        return is_down and self._was_flying and not self._was_answered

    def _note_answer(self) -> None:
        """Note that an order of the present action was accepted or refused."""
        phase = self._executor.phase
        is_refused = phase is LivePhase.FAILED and not self._executor.is_unanswered
        self._was_answered |= phase in _BEGUN or is_refused
        has_passed = phase in {LivePhase.BEGINNING, *_BEGUN}
        self._is_there |= has_passed and self._executor.has_approach

    @property
    def _flies_on(self) -> bool:
        """Whether its mode flies something else; without known modes the answers count."""
        before_hold = _BEFORE_HOLD_INSTEAD if self._replaces else _BEFORE_HOLD
        others = before_hold if self.leaves_hovering else AIRBORNE_MODES
        return self._vehicle.family.knows_modes and self._vehicle.mode_role in others

    @property
    def leaves_hovering(self) -> bool:
        """Whether the vehicle waits in the air for what comes next."""
        soft = self._event.event_type_id is EventType.SOFT_ABORT_MISSION
        may_hover = self.taken is None and not self._lands_instead and not self._descends
        return soft and self._event.abort is not None and may_hover

    @property
    def sends_down(self) -> bool:
        """Whether the vehicle was ordered to return or to land, and nobody else has it."""
        return self.taken is None and not self.leaves_hovering

    @property
    def _descends(self) -> bool:
        return self._is_down or self._vehicle.snapshot.lacks_position

    @property
    def _is_down(self) -> bool:
        """Whether it is on the ground, armed or about to be."""
        is_about_to_arm = self._arms_until is not None and self._vehicle.snapshot.armed is False
        return is_about_to_arm or self._vehicle.is_standing_armed

    def start(self, now: float) -> list[Message]:
        """Give the first order."""
        self._descends_until = min(self._descends_until, now + LATE_ORDER_S)
        self._ordered_at = now
        self._vehicle.own_descent.order(self._vehicle.mode)
        return [] if self._is_taken(now) else self._executor.start(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the vehicle."""
        if self._is_taken(now) or self._must_drop_place() or self._has_left_ground:
            return []
        messages = self._executor.receive(message, now)
        self._note_answer()
        return messages

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue, and begin again what was refused or not obeyed."""
        if self._is_taken(now):
            return []
        self._note_silence(now)
        self._expire_arming(now)
        if self.is_unheard(now) or (self._unheard_since is None and self._is_down_for_good):
            return []
        must_drop = self._must_drop_place()
        if must_drop or self._has_left_ground:
            return self._order(now, with_place=not must_drop)
        return self._repeat(now)

    def _note_silence(self, now: float) -> None:
        """Note since when the vehicle shows nothing, and what it may do meanwhile."""
        if self._vehicle.shows_itself(now):
            self._unheard_since = None
            return
        self._may_be_lost = True
        if now < self._descends_until:
            self._descends_until = now + LATE_ORDER_S
        self._unheard_since = now if self._unheard_since is None else self._unheard_since

    def _repeat(self, now: float) -> list[Message]:
        """Go on with the present order, or give it again when it is due."""
        messages = self._executor.tick(now)
        self._note_answer()
        has_failed = self._executor.phase is LivePhase.FAILED
        is_obeyed = not self._flies_on and not self._vehicle.is_standing_armed
        if not has_failed and (is_obeyed or self._executor.phase is not LivePhase.DONE):
            self._again_at = math.inf
            return messages
        if self._again_at == math.inf:
            self._again_at = now + AGAIN_AFTER_S
            is_refused = has_failed and not self._executor.is_unanswered
            self._lands_instead |= is_refused and not self._may_be_lost
        if now < self._again_at:
            return messages
        self._again_at = math.inf
        self._may_be_lost = not self._vehicle.shows_itself(now)
        return [*messages, *self._order(now, with_place=has_failed)]

    def _order(self, now: float, *, with_place: bool) -> list[Message]:
        """Begin again with what the vehicle is to do by now."""
        self._executor = LiveCommandExecutor(self._action(with_place=with_place), self._vehicle)
        return self._executor.start(now)

    def is_unheard(self, now: float) -> bool:
        """Whether a vehicle has been unheard for so long that it gets no order any more."""
        return self._unheard_since is not None and now - self._unheard_since > UNHEARD_S

    def _expire_arming(self, now: float) -> None:
        """Stop expecting the arming when it is too late; lost heartbeats extend the time.

        A vehicle that has armed counts by its own reports from then on.
        """
        if self._arms_until is None:
            return
        if not self._vehicle.is_connected(now):
            self._arms_until = max(self._arms_until, now + AGAIN_AFTER_S)
        if self._vehicle.snapshot.armed or now >= self._arms_until:
            self._arms_until = None

    def _must_drop_place(self) -> bool:
        """Whether it is on its approach to a place, and has landed or lost its position."""
        is_going = self._executor.phase is LivePhase.APPROACHING and self._executor.has_approach
        return (is_going and self._descends) or (self._needs_position and self._lacks_position)

    @property
    def _has_left_ground(self) -> bool:
        """Whether it was to be disarmed, and turns out to be in the air."""
        return self._disarms and bool(self._vehicle.snapshot.armed) and not self._is_down

    @property
    def _lacks_position(self) -> bool:
        return self._vehicle.snapshot.lacks_position

    def _action(self, *, with_place: bool) -> LiveAction:
        """Choose the action; a vehicle that has reached its place gets the last order only."""
        self._needs_position = False
        self._disarms = self._is_down and self._unheard_since is None
        if self._disarms:
            return disarm_action(self._vehicle)
        if self._is_down:  # It may have taken off unheard: a hold would end its landing
            return land_action(self._vehicle)
        if self._lands_instead or self._lacks_position:
            self._lands_here = NOT_PLACED if self._lacks_position else NOT_OBEYED
            return land_action(self._vehicle)
        self._lands_here = None
        lands_here = self._event.event_type_id is EventType.ABORT_MISSION
        self._needs_position = not lands_here or (with_place and self._event.abort is not None)
        return _airborne_action(self._event, self._vehicle, with_place=with_place)

    @property
    def instead(self) -> str | None:
        """What the vehicle has done otherwise than the event orders; None if nothing."""
        if not self._was_flying:
            return None if self._is_there else STANDS
        if not self._is_there:
            return self._lands_here or NOT_THERE
        lands_anyway = self._event.event_type_id is EventType.ABORT_MISSION
        return None if lands_anyway else self._lands_here

    def _is_taken(self, now: float) -> bool:
        """Whether another system has taken the vehicle, once and for all."""
        if self.taken is None:
            who = self.who(now)
            if who is not Authority.BROKER:
                self.taken = control_authority.reason(who, self._vehicle.observed_mode)
                self._vehicle.armed_period.take_away()
        return self.taken is not None

    def who(self, now: float) -> Authority:
        """Decide who is in command of the vehicle."""
        return control_authority.authority_of(self._vehicle.observed_mode, self._claim(now))

    def _note_obedience(self, now: float) -> None:
        """Note when the vehicle has left its mission.

        A mode that it had before shows that after a while only: an order of before to start or to
        resume the mission may still arrive.
        """
        if self._obeyed_at is not None or self._ordered_at is None:
            return
        if self._vehicle.mode_role in {ModeRole.MISSION, ModeRole.PAUSED, ModeRole.OTHER}:
            self._mode_before = None
        elif self._vehicle.mode != self._mode_before:
            self._obeyed_at = now
        elif now - self._ordered_at > LATE_ORDER_S:
            self._obeyed_at = self._ordered_at

    def _claim(self, now: float) -> Claim:
        """Modes in which the vehicle obeys, or has not obeyed yet."""
        vehicle = self._vehicle
        self._note_obedience(now)
        is_approaching = self._executor.phase is LivePhase.APPROACHING
        is_going = is_approaching and self._executor.has_approach
        descends = not is_going and not self.leaves_hovering
        roles = DESCENT_MODES if descends else AIRBORNE_MODES
        if self._obeyed_at is not None and now - self._obeyed_at > LATE_ORDER_S:
            roles = roles - {ModeRole.MISSION}
        if now < self._descends_until and not vehicle.observed_mode.in_failsafe:
            roles = roles | {ModeRole.ENDING}
        if vehicle.mode != self._first_mode:
            self._first_mode = None
        return Claim(roles, mode=self._first_mode, is_exclusive=True)


class UnconfirmedMissions:
    """Missions that an abort has ended before the edge server has answered their acceptance.

    Until that answer is there it may hand such a mission out again to a restarted broker. The abort
    is done only then: until then it is handed out again with the mission, and is noted in the
    journal. Each piece of work has one final answer, and this class decides when it may be sent.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._dropped: dict[int, Callable[[Effects], None]] = {}  # By work id; what ends it
        self._missions_of: dict[int, set[int]] = {}  # Missions by the work id of the abort
        self._held: list[Acknowledgement] = []
        self._answered: deque[tuple[int, str | None]] = deque(maxlen=ANSWERED_KEPT)

    @property
    def are_open(self) -> bool:
        """Whether one of them may still be handed out again; no other mission begins before."""
        return bool(self._dropped)

    def drop(self, work_id: int, abort: Callable[[str, Effects], None], event: AbortEvent) -> None:
        """Let a mission be reported as aborted by an event once its acceptance is confirmed.

        An abort empties the edge server's queue too: a mission whose acceptance it refuses was
        ended there, and has its report.
        """
        self._dropped[work_id] = partial(abort, REASONS[event.event_type_id])

    def hold_answer(self, work: EventWork) -> None:
        """Hold the answer to an abort back for all of them."""
        if self._dropped:
            self._missions_of[work.work_id] = set(self._dropped)
            note = abort_note(work.event, work, self._vehicle)
            self._vehicle.recovery.held_abort = note

    def take_acceptance_result(self, result: AcceptanceResult, effects: Effects) -> bool:
        """Handle the answer to an acceptance; whether it was that of one of them."""
        if result.work_id not in self._dropped:
            return False
        end = self._dropped.pop(result.work_id)
        if result.is_confirmed or result.has_failed:
            end(effects)
        for missions in self._missions_of.values():
            missions.discard(result.work_id)
        self._missions_of = {
            abort: missions for abort, missions in self._missions_of.items() if missions
        }
        if not self._dropped:
            self._vehicle.recovery.held_abort = None
        return True

    def reopen(self, work: MissionWork | EventWork) -> None:
        """Queue new work; an edge server with a fresh database gives the same numbers again."""
        answered = work.work_id, work.identity
        self._answered = deque((one for one in self._answered if one != answered), ANSWERED_KEPT)

    def due(self, messages: Sequence[EdgeMessage]) -> list[EdgeMessage]:
        """Give what may be sent by now; what was held back before comes behind the rest.

        The first final answer counts: whatever ends work behind an error answers it once more.
        """
        if not messages and not self._held:
            return []
        due: list[EdgeMessage] = []
        for message in messages:
            if not isinstance(message, Acknowledgement) or message.status == "accepted":
                due.append(message)
            elif (message.work_id, message.identity) not in self._answered:
                self._answered.append((message.work_id, message.identity))
                (self._held if message.work_id in self._missions_of else due).append(message)
        due += [answer for answer in self._held if answer.work_id not in self._missions_of]
        self._held = [answer for answer in self._held if answer.work_id in self._missions_of]
        return due
