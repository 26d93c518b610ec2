"""Flies one live command: gets there, begins, watches for the end, ends it.

    BORROWING --SET--> APPROACHING --THERE--> BEGINNING --BEGUN--> GOING --OVER--> ENDING
    ENDING --ENDED--> DONE
    any but DONE --FAULT--> FAILED

A live command needs a link: what is to be told again and again (a target's place) is told at
5 Hz, and a link that is lost is waited out, since the vehicle holds by itself. What lasts lasts
by the vehicle's own time, which a simulation may let run at any speed. Parameters that it borrows
of the vehicle are set first; what comes after it has them given back.
"""

from enum import Enum, auto
from typing import Final

from mavlink_broker.circle import CircleRunner
from mavlink_broker.departure import HELD_BY_FAILSAFE, Departure
from mavlink_broker.dialect import Message, mavlink
from mavlink_broker.protocol.command import Accepted, Refused
from mavlink_broker.protocol.command_sequence import CommandSequence, Ways
from mavlink_broker.series import SeriesRunner, missing_camera
from mavlink_broker.subject import SubjectTracker
from mavlink_broker.target_teller import TargetTeller
from mavlink_broker.translation.families import Orbiting
from mavlink_broker.translation.geo import distance_m
from mavlink_broker.translation.live import (
    Circled,
    Lasted,
    LiveAction,
    Series,
    Tracked,
    Turned,
    approach_ways,
)
from mavlink_broker.translation.modes import ModeRole
from mavlink_broker.turning import Turning
from mavlink_broker.vehicle import Vehicle

THERE_WITHIN_M: Final = 2.0
SLOW_M_S: Final = 1.0
APPROACH_WITHIN_S: Final = 300.0
_NOT_THERE: Final = "Reposition is outside geofence"


class Phase(Enum):
    """How far a live command is."""

    BORROWING = auto()
    APPROACHING = auto()
    BEGINNING = auto()
    GOING = auto()
    ENDING = auto()
    DONE = auto()
    FAILED = auto()


class Performer:
    """One live command."""

    def __init__(self, action: LiveAction, vehicle: Vehicle) -> None:
        self._action = action
        self._vehicle = vehicle
        self._sequence: CommandSequence | None = None
        self._turning = Turning(action.end) if isinstance(action.end, Turned) else None
        self._doing: SeriesRunner | SubjectTracker | CircleRunner | None = None
        self._phase_at = 0.0
        self._began_at = 0.0
        self._target = TargetTeller(action.follow, vehicle)
        self._departure = Departure()
        self._was_guided = False
        self._was_circling = False  # Round and round, until it is told otherwise
        self._works_s = 0.0  # Longer that it lasts: the answer was lost with an earlier broker
        self.phase = Phase.BORROWING
        self.reason = ""
        self._note: str | None = None

    @property
    def note(self) -> str | None:
        """What cannot be done as it was meant."""
        notes = (self._note, None if self._doing is None else self._doing.note)
        return "; ".join(note for note in notes if note) or None

    @property
    def has_begun(self) -> bool:
        """Whether the vehicle has agreed to it."""
        works = self._sequence is not None and self._sequence.is_in_progress
        begun = self.phase is Phase.BEGINNING and works
        return begun or self.phase in {Phase.GOING, Phase.ENDING, Phase.DONE}

    def start(self, now: float, *, resumed: bool = False) -> list[Message]:
        """Begin; `resumed` if the vehicle agreed to it in an earlier run of the broker.

        What it has done since is not known: a time or an endless turn is counted anew, a turn that
        the vehicle counts may be over.
        """
        self._began_at = self._phase_at = self._time_s(now)
        self._vehicle.borrow(self._action.loans)
        if resumed:
            self._was_guided = True
            self._works_s = self._action.works_s
            self._go(now)
            return []
        return self._set_out(now)

    def _set_out(self, now: float) -> list[Message]:
        """Go to where it begins, once the vehicle has the parameters that it needs."""
        if not self._vehicle.parameters.is_settled:
            return []
        self._began_at = self._time_s(now)  # What it may take does not count what it has borrowed
        self._enter(Phase.APPROACHING, now)
        if self._action.approach is None:
            return self._begin(now)
        home = self._vehicle.snapshot.home
        if home is None:
            return self._fail("the vehicle's home is not known")
        speed_m_s = self._action.approach_speed_m_s
        return self._order(approach_ways(self._action.approach, home, speed_m_s), now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        if self._is_ignored(message):
            return self._fail(f"it does not go there: {message.text.strip()}")
        messages = self._sequence.receive(message, now) if self._sequence else []
        if self._doing is not None and self.phase is Phase.GOING:
            messages += self._doing.receive(message, now)
        if message.get_type() == "GLOBAL_POSITION_INT":
            self._count_turn()
            messages += self._tell_target(now)
        if self._works_s and self._is_answer(message):
            self._works_s = 0.0
        return [*messages, *self._advance(now)]

    def _is_ignored(self, message: Message) -> bool:
        """Whether the vehicle says that it will not go where it has agreed to go: PX4's only no."""
        is_said = message.get_type() == "STATUSTEXT" and message.text.startswith(_NOT_THERE)
        goes = isinstance(self._doing, CircleRunner | SeriesRunner)
        return is_said and (self.phase is Phase.APPROACHING or (goes and self.phase is Phase.GOING))

    def _is_answer(self, message: Message) -> bool:
        """Whether the vehicle has done what it was told by an earlier run of the broker."""
        if message.get_type() != "COMMAND_ACK" or message.command != self._action.order:
            return False
        return bool(message.result != mavlink.MAV_RESULT_IN_PROGRESS)

    def tick(self, now: float) -> list[Message]:
        """Let time pass."""
        messages = self._sequence.tick(now) if self._sequence else []
        if self._doing is not None and self.phase is Phase.GOING:
            messages += self._doing.tick(now)
        messages += self._advance(now)
        self._watch(now)
        return messages

    def _time_s(self, now: float) -> float:
        """The vehicle's time; the broker's where the vehicle tells none."""
        told = self._vehicle.snapshot.time_s
        return now if told is None else told

    def _count_turn(self) -> None:
        place = self._vehicle.snapshot.position
        if self._turning is not None and self.phase is Phase.GOING and place is not None:
            self._turning.take(place.latitude_deg, place.longitude_deg)

    def _advance(self, now: float) -> list[Message]:
        outcome = self._sequence.outcome if self._sequence else None
        if isinstance(outcome, Refused) and self.phase is not Phase.ENDING:
            return self._refused(outcome, now)
        match self.phase:
            case Phase.BORROWING:
                return self._set_out(now)
            case Phase.APPROACHING if isinstance(outcome, Accepted) and self._is_there():
                return self._begin(now)
            case Phase.BEGINNING if isinstance(outcome, Accepted):
                self._note_way()
                self._go(now)
            case Phase.GOING if self._doing is not None and self._doing.reason is not None:
                return self._fail(self._doing.reason)
            case Phase.GOING if self._is_over(now):
                return self._finish(now)
            case Phase.ENDING if outcome is not None:  # What refuses to end has perhaps ended
                self._enter(Phase.DONE, now)
        return []

    def _refused(self, refusal: Refused, now: float) -> list[Message]:
        """Fail, or leave out what only a camera could have done where there is none."""
        is_for_camera = self._action.wants_camera and self.phase is Phase.BEGINNING
        missing = missing_camera(self._vehicle, refusal) if is_for_camera else None
        if missing is None:
            return self._fail(refusal.reason)
        self._note, self._sequence = missing, None
        self._enter(Phase.DONE, now)
        return []

    def _begin(self, now: float) -> list[Message]:
        self._enter(Phase.BEGINNING, now)
        return [*self._tell_target(now), *self._order(self._action.begin, now)]

    def _go(self, now: float) -> None:
        match self._action.end:
            case Series(steps):
                self._doing = SeriesRunner(steps, self._vehicle)
            case Tracked() as end:
                self._doing = SubjectTracker(end, self._vehicle)
            case Circled() as circle:
                self._doing = CircleRunner(circle, self._vehicle)
        self._enter(Phase.GOING, now)

    def _finish(self, now: float) -> list[Message]:
        self._enter(Phase.ENDING, now)
        has_released = self._turning is not None and self._has_released()
        if not self._action.finish or has_released:
            self._enter(Phase.DONE, now)
            return []
        return self._order(self._action.finish, now)

    def _order(self, ways: Ways, now: float) -> list[Message]:
        vehicle = self._vehicle
        self._sequence = CommandSequence(ways, vehicle.route, vehicle.round_trip)
        return self._sequence.start(now)

    def _enter(self, phase: Phase, now: float) -> None:
        self.phase, self._phase_at = phase, self._time_s(now)

    def _fail(self, reason: str) -> list[Message]:
        self.phase, self.reason = Phase.FAILED, reason
        return []

    def _note_way(self) -> None:
        way = self._sequence.way if self._sequence else 0
        notes = list(self._vehicle.parameters.refusals.values())
        if way < len(self._action.way_notes):
            notes.append(self._action.way_notes[way])
        self._note = "; ".join(note for note in notes if note) or None

    def _is_there(self) -> bool:
        place, spot = self._vehicle.snapshot.position, self._action.approach
        if place is None or spot is None:
            return False
        away = distance_m(*place[:2], *spot[:2])
        high = abs(place.altitude_m - spot.relative_altitude_m)
        return max(away, high) <= THERE_WITHIN_M and place.speed_m_s <= SLOW_M_S

    def _is_over(self, now: float) -> bool:
        is_guided = self._vehicle.mode_role is ModeRole.GUIDED
        self._was_guided |= is_guided
        self._was_circling |= is_guided and self._is_endless
        match self._action.end:
            case Lasted(duration_s):
                return self._time_s(now) - self._phase_at >= duration_s + self._works_s
            case Turned():
                complete = self._turning is not None and self._turning.is_complete
                return complete or self._has_released()
            case Series() | Tracked() | Circled():
                return self._doing is not None and self._doing.is_over

    @property
    def _is_endless(self) -> bool:
        """Whether it is a circle that the vehicle does not count."""
        is_circle = isinstance(self._action.end, Turned)
        return is_circle and self._vehicle.family.orbiting is Orbiting.ENDLESS

    def _has_released(self) -> bool:
        """Whether a vehicle that counts its turns has ended by itself.

        One that does not may have been told to by an earlier run of the broker.
        """
        is_over = self._was_guided and not self._was_circling
        return is_over and self._vehicle.mode_role is ModeRole.HOLD

    def _tell_target(self, now: float) -> list[Message]:
        if self.phase not in {Phase.BEGINNING, Phase.GOING}:
            return []
        time_s = self._time_s(now)
        followed_s = time_s - self._phase_at if self.phase is Phase.GOING else 0.0
        return self._target.tell(time_s, followed_s, now)

    def _watch(self, now: float) -> None:
        """Fail what another hand has ended, and what takes too long."""
        if self.phase in {Phase.DONE, Phase.FAILED} or not self._vehicle.is_heard(now):
            return
        approach_s = 0.0 if self._action.approach is None else APPROACH_WITHIN_S
        if self._time_s(now) - self._began_at > self._action.within_s + approach_s:
            self._fail(f"it has not ended within {self._action.within_s:.0f} s")
            return
        sign = self._sign_of_departure() if self._action.moves else None
        reason = self._departure.judge(sign, now)
        if reason is not None:
            self._fail(reason)

    def _sign_of_departure(self) -> str | None:
        if self._vehicle.snapshot.armed is False:
            return "the vehicle disarmed before the end of the mission"
        if self._vehicle.is_held_by_failsafe:
            return HELD_BY_FAILSAFE
        if self._vehicle.mode_role in {ModeRole.OTHER, ModeRole.ENDING}:
            return f"the vehicle left the mission: mode {self._vehicle.mode}"
        circles = self._was_circling and self.phase is Phase.GOING
        if circles and self._vehicle.mode_role is ModeRole.HOLD:  # It has no end of its own
            return f"the vehicle left its circle: mode {self._vehicle.mode}"
        return None
