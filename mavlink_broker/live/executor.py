"""Flies one live command: gets there, begins, watches for the end, ends it.

    LISTENING --NOTHING--> BORROWING, LISTENING --A SIGN--> GOING
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

from afarcloud.geodesy import distance_m
from mavlink_broker.autopilots.flight_modes import LIVE_MODES, ModeRole
from mavlink_broker.live.capture_check import CaptureJudge, Verdict
from mavlink_broker.live.circle import CircleRunner
from mavlink_broker.live.follow_target_sender import TargetTeller
from mavlink_broker.live.orbit import TurnRunner
from mavlink_broker.live.recovery_record import LISTENS_S, LiveRecord
from mavlink_broker.live.series import SeriesRunner, missing_camera
from mavlink_broker.live.tracking import SubjectTracker
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.command import Accepted, CommandOutcome, Refused
from mavlink_broker.microservices.command_sequence import CommandSequence, Ways
from mavlink_broker.planning.live_actions import (
    Circled,
    Lasted,
    LiveAction,
    Series,
    Tracked,
    Turned,
    approach_ways,
)
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import Claim, InCommand
from mavlink_broker.vehicle.takeover_debounce import HELD_BY_FAILSAFE, Departure
from mavlink_broker.vehicle.vehicle import Vehicle

THERE_WITHIN_M: Final = 2.0
SLOW_M_S: Final = 1.0
APPROACH_WITHIN_S: Final = 300.0
_NOT_THERE: Final = "Reposition is outside geofence"


class Phase(Enum):
    """How far a live command is."""

    LISTENING = auto()  # Whether the vehicle was told before an earlier broker died
    BORROWING = auto()
    APPROACHING = auto()
    BEGINNING = auto()
    GOING = auto()
    ENDING = auto()
    DONE = auto()
    FAILED = auto()


class Performer:
    """One live command; what a broker has to know again of it is noted under its name."""

    def __init__(self, action: LiveAction, vehicle: Vehicle, name: str | None = None) -> None:
        self._action = action
        self._vehicle = vehicle
        self._record = LiveRecord(name, action, vehicle)
        self._sequence: CommandSequence | None = None
        self._doing: SeriesRunner | SubjectTracker | CircleRunner | TurnRunner | None = None
        self._phase_at = 0.0
        self._began_at = 0.0
        self._target = TargetTeller(action.follow, vehicle)
        self._departure = Departure()
        self._works_s = 0.0  # Longer that it lasts: the answer was lost with an earlier broker
        self._said_before = False  # Perhaps, by an earlier broker
        self.phase = Phase.BORROWING
        self.reason = ""
        self.has_departed = False  # Somebody else has ended it
        self._is_out_of_mission = False  # The vehicle has left its items for this command
        self._was_following = False  # In a mode that only the broker, or a pause, ends
        self._note: str | None = None
        self._judge: CaptureJudge | None = None  # Of an order whose answer takes time

    @property
    def note(self) -> str | None:
        """What cannot be done as it was meant."""
        notes = (self._note, None if self._doing is None else self._doing.note)
        return "; ".join(note for note in notes if note) or None

    @property
    def goes_somewhere(self) -> bool:
        """Whether it begins at a place that the vehicle has to reach first."""
        return self._action.approach is not None

    @property
    def claim(self) -> Claim:
        """Modes in which the vehicle does what it was ordered, or has not obeyed yet."""
        if self._is_out_of_mission and self._action.moves:
            return Claim(control_authority.ON_THE_WAY - {ModeRole.MISSION}, is_exclusive=True)
        return Claim(control_authority.ON_THE_WAY, is_exclusive=True)

    @property
    def has_begun(self) -> bool:
        """Whether the vehicle has agreed to it."""
        works = self._sequence is not None and self._sequence.is_in_progress
        begun = self.phase is Phase.BEGINNING and works
        return begun or self.phase in {Phase.GOING, Phase.ENDING, Phase.DONE}

    def start(self, now: float, *, resumed: bool = False) -> list[Message]:
        """Begin; `resumed` if the vehicle agreed to it in an earlier run of the broker.

        Where that has noted nothing, a time or an endless turn is counted anew; a turn that the
        vehicle counts may be over.
        """
        self._began_at = self._phase_at = self._time_s(now)
        self._vehicle.borrow(self._action.loans)
        if resumed or self._record.was_agreed:
            self._take_up(now)
            return []
        if self._record.is_doubtful:
            self._enter(Phase.LISTENING, now)
            self._said_before = True
            return []
        return self._set_out(now)

    def _take_up(self, now: float) -> None:
        """Go on with what an earlier run has begun."""
        self._works_s = self._action.works_s
        self._go(now, resumed=True)
        self._phase_at -= self._record.elapsed_s
        if self._record.earlier is not None and self._doing is not None:
            self._doing.resume(self._record.earlier)

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
        ways = approach_ways(
            self._action.approach,
            home,
            self._action.approach_speed_m_s,
            by_order=self._vehicle.family.speed_by_order,
        )
        return self._order(ways, now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        if self._is_ignored(message):
            return self._fail(f"it does not go there: {message.text.strip()}")
        if self.phase is Phase.LISTENING and self._record.is_sign(message):
            self._take_up(now)
        if self._judge is not None:
            self._judge.receive(message, now)
        messages = self._sequence.receive(message, now) if self._sequence else []
        if self._doing is not None and self.phase is Phase.GOING:
            messages += self._doing.receive(message, now)
        if self._works_s and self._record.is_answer(message):
            self._works_s = 0.0
        if self._action.moves and self._sign_of_departure() is not None:
            return messages
        if message.get_type() == "GLOBAL_POSITION_INT":
            messages += self._tell_target(now)
        return [*messages, *self._advance(now)]

    def _is_ignored(self, message: Message) -> bool:
        """Whether the vehicle says that it will not go where it has agreed to go: PX4's only no."""
        is_said = message.get_type() == "STATUSTEXT" and message.text.startswith(_NOT_THERE)
        goes = isinstance(self._doing, CircleRunner | SeriesRunner)
        return is_said and (self.phase is Phase.APPROACHING or (goes and self.phase is Phase.GOING))

    def tick(self, now: float) -> list[Message]:
        """Let time pass."""
        role = self._vehicle.mode_role
        self._is_out_of_mission |= role in {ModeRole.HOLD, ModeRole.GUIDED}
        follows = isinstance(self._action.end, Lasted) and self._vehicle.mode in LIVE_MODES
        self._was_following |= follows and self.phase is Phase.GOING
        messages: list[Message] = []
        if self._sign_of_departure() is None or not self._action.moves:
            messages += self._repeat(now)
            if self._doing is not None and self.phase is Phase.GOING:
                messages += self._doing.tick(now)
            messages += self._advance(now)
            self._note_progress()
        self._watch(now)
        return messages

    def _repeat(self, now: float) -> list[Message]:
        """Repeat what is overdue, but not an order that was heard and may have been carried out."""
        judge = self._judge if self.phase is Phase.BEGINNING else None
        if judge is not None and judge.verdict in {Verdict.AT_WORK, Verdict.DONE}:
            return judge.tick(now)
        return self._sequence.tick(now) if self._sequence else []

    def _note_progress(self) -> None:
        if self.has_begun:
            self._record.agree()
        if self._doing is not None:
            self._record.keep(self._doing)

    def _time_s(self, now: float) -> float:
        """The vehicle's time; the broker's where the vehicle tells none."""
        told = self._vehicle.snapshot.time_s
        return now if told is None else told

    def _advance(self, now: float) -> list[Message]:
        outcome = self._sequence.outcome if self._sequence else None
        if isinstance(outcome, Refused) and self.phase is not Phase.ENDING:
            return self._refused(outcome, now)
        match self.phase:
            case Phase.LISTENING if self._time_s(now) - self._phase_at >= LISTENS_S:
                self._enter(Phase.BORROWING, now)
            case Phase.BORROWING:
                return self._set_out(now)
            case Phase.APPROACHING if self._has_arrived(outcome):
                return self._begin(now)
            case Phase.BEGINNING if isinstance(outcome, Accepted):
                self._note_way()
                self._go(now)
            case Phase.BEGINNING if self._judge and self._judge.verdict is Verdict.DONE:
                self._sequence = None  # Its answer is lost, its pictures are there
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

    def _has_arrived(self, outcome: CommandOutcome | None) -> bool:
        is_near = self._action.approach is None
        return is_near or (isinstance(outcome, Accepted) and self._is_there())

    def _begin(self, now: float) -> list[Message]:
        """Tell the vehicle, once it has been noted that it is told."""
        if not self._record.may_order():
            return []
        self._enter(Phase.BEGINNING, now)
        if self._action.works_s:
            self._judge = CaptureJudge(self._action.order, self._vehicle)
        return [*self._tell_target(now), *self._order(self._action.begin, now)]

    def _go(self, now: float, *, resumed: bool = False) -> None:
        match self._action.end:
            case Turned() as turn:
                self._doing = TurnRunner(turn, self._vehicle, resumed=resumed)
            case Series(steps):
                self._doing = SeriesRunner(steps, self._vehicle)
            case Tracked() as end:
                self._doing = SubjectTracker(end, self._vehicle)
            case Circled() as circle:
                self._doing = CircleRunner(circle, self._vehicle)
        self._enter(Phase.GOING, now)

    def _finish(self, now: float) -> list[Message]:
        self._enter(Phase.ENDING, now)
        has_released = isinstance(self._doing, TurnRunner) and self._doing.has_released
        if not self._action.finish or has_released:
            self._enter(Phase.DONE, now)
            return []
        return self._order(self._action.finish, now)

    def _order(self, ways: Ways, now: float) -> list[Message]:
        vehicle = self._vehicle
        self._sequence = CommandSequence(
            ways, vehicle.route, vehicle.round_trip, said_before=self._said_before
        )
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
        if isinstance(self._action.end, Lasted):
            lasts_s = self._action.end.duration_s + self._works_s
            return self._time_s(now) - self._phase_at >= lasts_s
        return self._doing is not None and self._doing.is_over

    def _tell_target(self, now: float) -> list[Message]:
        if self.phase not in {Phase.BEGINNING, Phase.GOING}:
            return []
        time_s = self._time_s(now)
        followed_s = time_s - self._phase_at if self.phase is Phase.GOING else 0.0
        return self._target.tell(time_s, followed_s, now)

    def _watch(self, now: float) -> None:
        """Fail what another hand has ended, and what takes too long."""
        if self.phase in {Phase.DONE, Phase.FAILED}:
            return
        if not self._vehicle.is_heard(now):
            if self._judge is not None:
                self._judge.rest()
            return
        is_judged = self.phase is Phase.BEGINNING and self._judge is not None
        fault = self._judge.fault(now) if is_judged and self._judge else None
        if fault is not None:
            self._fail(fault)
            return
        approach_s = 0.0 if self._action.approach is None else APPROACH_WITHIN_S
        if self._time_s(now) - self._began_at > self._action.within_s + approach_s:
            self._fail(f"it has not ended within {self._action.within_s:.0f} s")
            return
        sign = self._sign_of_departure() if self._action.moves else None
        reason = self._departure.judge(sign, now)
        if reason is not None:
            self.has_departed = True
            self._fail(reason)

    def _sign_of_departure(self) -> str | None:
        if self._vehicle.snapshot.armed is False:
            return "the vehicle disarmed before the end of the mission"
        if self._vehicle.is_held_by_failsafe:
            return HELD_BY_FAILSAFE
        seen = self._vehicle.seen
        who = control_authority.in_command(seen, self.claim)
        if who is not InCommand.BROKER:
            return control_authority.reason(who, seen)
        goes = self.phase is Phase.GOING
        if goes and self._was_following and seen.role is ModeRole.HOLD:
            return f"the vehicle was paused: mode {seen.mode}"
        if goes and isinstance(self._doing, TurnRunner) and self._doing.has_left:
            return f"the vehicle left its circle: mode {self._vehicle.mode}"
        return None
