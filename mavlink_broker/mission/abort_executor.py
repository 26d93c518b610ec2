"""What is flown after an event has ended a mission: land, go somewhere, come home.

    on the ground        disarm, and stay there; also while an order to arm may still arrive
    without a position   land here: neither a place nor home can be found
    else                 what the event says

An order that is refused, not answered or not obeyed is given again for as long as the vehicle is
armed; a place that it will not go to is given up for landing where it is, unless the link is away.
The orders end at once when somebody else takes command of the vehicle, or its own failsafe does.
An order that leads to a place becomes a landing as soon as the vehicle has lost its position.
"""

import math
from typing import Final

from afarcloud.enumerations import EventType
from afarcloud.plan import AbortPoint, Event
from mavlink_broker.autopilots.families import Family
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.live.executor import Performer, Phase
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import long_command
from mavlink_broker.microservices.command_sequence import Ways
from mavlink_broker.microservices.heartbeat import LinkState
from mavlink_broker.planning.live_actions import Lasted, LiveAction
from mavlink_broker.planning.situation import Spot
from mavlink_broker.recovery.record import AbortNote, Pose
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import COMING_DOWN, ON_THE_WAY, Claim, InCommand
from mavlink_broker.vehicle.vehicle import Vehicle

AGAIN_AFTER_S: Final = 1.5
"""Two heartbeats of a quick vehicle: longer than its mode takes to show."""
WITHIN_S: Final = 600.0
"""To reach a place; then the vehicle lands where it is."""
STRAY_S: Final = 5.0
"""How long an order of the mission may still arrive behind one that ends it: the longest time-out
of a command. Later nobody but another hand puts the vehicle back into its mission."""
_DISARM: Final = long_command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)


def coming_home(vehicle_id: int) -> Event:
    """What ends a mission that an alarm has failed: as if somebody had aborted it softly."""
    return Event(vehicle_id=vehicle_id, event_type_id=EventType.SOFT_ABORT_MISSION)


def abort_note(event: Event, work_id: int, vehicle: Vehicle) -> AbortNote:
    """Write down an abort that a restarted broker has to carry out."""
    there = event.abort
    point = None if there is None else Pose(there.latitude, there.longitude, there.altitude)
    return AbortNote(
        work_id=work_id,
        event_type=int(event.event_type_id),
        point=point,
        noted_s=vehicle.snapshot.time_s,
    )


def noted_event(note: AbortNote, vehicle_id: int) -> Event:
    """Read an abort that an earlier run of the broker has written down."""
    place = note.point
    point = place and AbortPoint(latitude=place[0], longitude=place[1], altitude=place[2])
    return Event(vehicle_id=vehicle_id, event_type_id=EventType(note.event_type), abort=point)


def action_after(event: Event, vehicle: Vehicle, *, goes_there: bool = True) -> LiveAction:
    """What an abort asks for at its end; its last order alone to one that need not go anywhere."""
    if vehicle.is_standing_armed:
        return staying(vehicle)
    if vehicle.snapshot.lacks_position:
        return landing_here(vehicle)
    point = event.abort if goes_there else None
    spot = None if point is None else Spot(point.latitude, point.longitude, point.altitude)
    begin = _last_order(event, vehicle.family)
    return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, approach=spot, moves=False)


def landing_here(vehicle: Vehicle) -> LiveAction:
    """What is done where nothing else can be."""
    begin = vehicle.family.landing
    return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, moves=False)


def staying(vehicle: Vehicle) -> LiveAction:
    """Stop the propellers of a vehicle on the ground; one that refuses may be off it: it lands.

    It leaves its mission mode first: whoever arms it next would fly off on what was aborted.
    """
    family = vehicle.family
    begin = ((*family.holding[0], _DISARM), (_DISARM,), *family.landing)
    return LiveAction(begin=begin, end=Lasted(), within_s=WITHIN_S, moves=False)


def _last_order(event: Event, family: Family) -> Ways:
    if event.event_type_id is not EventType.SOFT_ABORT_MISSION:
        return family.landing
    return family.returning if event.abort is None else family.holding


_BEFORE_HOLDING: Final = frozenset({ModeRole.MISSION})


class Ending:
    """Sees to it that a vehicle does what an abort asks for."""

    def __init__(
        self,
        event: Event,
        vehicle: Vehicle,
        *,
        was_ours: bool = False,
        arms_until: float | None = None,
    ) -> None:
        """Begin with nothing sent; `was_ours` if the mode that it is in is part of its mission.

        `arms_until` is the time until which an order to arm that was sent may still take effect
        on a vehicle that reports itself disarmed; None if there is no such order.
        """
        self._event = event
        self._vehicle = vehicle
        self._arms_until = arms_until
        self._first_mode = vehicle.mode if was_ours else None  # Ours until it is left
        self._again_at = math.inf
        self._given_up = False
        self._obeyed_at: float | None = None  # It has left its mission, by its own word
        self.taken: str | None = None  # Who has taken the vehicle meanwhile
        self._leads = False  # What is ordered needs a position
        self._performer = Performer(self._action(goes_there=True), vehicle)

    @property
    def is_over(self) -> bool:
        """Whether the vehicle has obeyed the last order, stands disarmed, or is somebody else's."""
        if self.taken is not None:
            return True
        if self._vehicle.snapshot.armed is False:
            return self._arms_until is None
        is_done = self._performer.phase is Phase.DONE
        return is_done and not self._flies_on and not self._vehicle.is_standing_armed

    @property
    def _flies_on(self) -> bool:
        """Whether its mode still flies something else; an unknown autopilot's word must do."""
        others = _BEFORE_HOLDING if self.leaves_hovering else ON_THE_WAY
        return self._vehicle.family.knows_modes and self._vehicle.mode_role in others

    @property
    def leaves_hovering(self) -> bool:
        """Whether the vehicle waits in the air for what comes next."""
        soft = self._event.event_type_id is EventType.SOFT_ABORT_MISSION
        is_there = self.taken is None and not self._given_up and not self._comes_down
        return soft and self._event.abort is not None and is_there

    @property
    def _comes_down(self) -> bool:
        return self._stands or self._vehicle.snapshot.lacks_position

    @property
    def _stands(self) -> bool:
        """Whether it is on the ground, armed or about to be."""
        is_about_to_arm = self._arms_until is not None and self._vehicle.snapshot.armed is False
        return is_about_to_arm or self._vehicle.is_standing_armed

    def start(self, now: float) -> list[Message]:
        """Give the first order."""
        return [] if self._is_taken(now) else self._performer.start(now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        if self._is_taken(now) or self._must_not_go_there():
            return []
        return self._performer.receive(message, now)

    def tick(self, now: float) -> list[Message]:
        """Repeat what is overdue, and begin again what was refused or not obeyed."""
        if self._is_taken(now):
            return []
        self._watch_arming(now)
        if self._must_not_go_there():
            self._performer = Performer(self._action(goes_there=False), self._vehicle)
            return self._performer.start(now)
        messages = self._performer.tick(now)
        has_failed = self._performer.phase is Phase.FAILED
        is_obeyed = not self._flies_on and not self._vehicle.is_standing_armed
        if not has_failed and (is_obeyed or self._performer.phase is not Phase.DONE):
            self._again_at = math.inf
            return messages
        if self._again_at == math.inf:
            self._again_at = now + AGAIN_AFTER_S
            is_there = self._vehicle.link.state(now) is LinkState.CONNECTED
            self._given_up |= has_failed and is_there  # Else it may not have heard the order
        if now < self._again_at:
            return messages
        self._again_at = math.inf
        self._performer = Performer(self._action(goes_there=has_failed), self._vehicle)
        return [*messages, *self._performer.start(now)]

    def _watch_arming(self, now: float) -> None:
        """Stop to expect the arming when it is too late; heartbeats missed in between may hide it.

        A vehicle that has armed is judged by its own reports from then on.
        """
        if self._arms_until is None:
            return
        if self._vehicle.link.state(now) is not LinkState.CONNECTED:
            self._arms_until = max(self._arms_until, now + AGAIN_AFTER_S)
        if self._vehicle.snapshot.armed or now >= self._arms_until:
            self._arms_until = None

    def _must_not_go_there(self) -> bool:
        """Whether it is led to a place, and stands, or cannot find it any more."""
        is_going = self._performer.phase is Phase.APPROACHING and self._performer.goes_somewhere
        return (is_going and self._comes_down) or (self._leads and self._lacks_position)

    @property
    def _lacks_position(self) -> bool:
        return self._vehicle.snapshot.lacks_position

    def _action(self, *, goes_there: bool) -> LiveAction:
        """Begin anew, or end only: one that came to its place does not leave it again."""
        self._leads = False
        if self._stands:
            return staying(self._vehicle)
        if self._given_up or self._lacks_position:
            return landing_here(self._vehicle)
        is_soft = self._event.event_type_id is EventType.SOFT_ABORT_MISSION
        self._leads = is_soft or (goes_there and self._event.abort is not None)
        return action_after(self._event, self._vehicle, goes_there=goes_there)

    def _is_taken(self, now: float) -> bool:
        """Whether somebody else has taken the vehicle, once and for all."""
        if self.taken is None:
            who = self.who(now)
            if who is not InCommand.BROKER:
                self.taken = control_authority.reason(who, self._vehicle.seen)
                self._vehicle.is_taken = True
        return self.taken is not None

    def who(self, now: float) -> InCommand:
        """Decide who is in command of the vehicle."""
        return control_authority.in_command(self._vehicle.seen, self._claim(now))

    def _claim(self, now: float) -> Claim:
        """Modes in which the vehicle obeys, or has not obeyed yet."""
        vehicle = self._vehicle
        if vehicle.mode_role not in {ModeRole.MISSION, ModeRole.PAUSED, ModeRole.OTHER}:
            self._obeyed_at = self._obeyed_at or now
        is_approaching = self._performer.phase is Phase.APPROACHING
        is_going = is_approaching and self._performer.goes_somewhere
        comes_down = not is_going and not self.leaves_hovering
        roles = COMING_DOWN if comes_down else ON_THE_WAY
        if self._obeyed_at is not None and now - self._obeyed_at > STRAY_S:
            roles = roles - {ModeRole.MISSION}
        if vehicle.mode != self._first_mode:
            self._first_mode = None
        return Claim(roles, mode=self._first_mode, is_exclusive=True)
