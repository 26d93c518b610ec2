"""Executes one live command: approaches its position, begins, monitors and ends it.

    LISTENING --NO SIGN--> SETTING_PARAMETERS, LISTENING --SIGN--> RUNNING
    SETTING_PARAMETERS --SET--> APPROACHING --THERE--> BEGINNING --ACCEPTED--> RUNNING
    RUNNING --OVER--> ENDING --ENDED--> DONE
    any but DONE --FAULT--> FAILED

A live command needs a link: messages that repeat (the position of a target) are sent at 5 Hz. After
a lost link the broker waits, since the vehicle holds by itself. Durations count by the vehicle's
own clock, which may run at any speed in a simulation. Parameters that the command overrides are set
first, and restored after it.

Its progress is recorded for a restarted broker: before the command is sent, so that it is not sent
twice; when the vehicle has accepted it; and after every step. If the broker was killed between the
first and the second, messages of the vehicle and its camera show whether the command was received.
"""

from dataclasses import replace
from enum import Enum, auto
from typing import Final, TypeAlias

from afarcloud.geodesy import distance_m
from mavlink_broker.autopilots.flight_modes import LIVE_MODES, ModeRole
from mavlink_broker.autopilots.status_texts import TextMeaning, means
from mavlink_broker.live.camera_state import CaptureCheck, CaptureState
from mavlink_broker.live.follow_target import FollowTargetSender
from mavlink_broker.live.orbit import CircleExecutor, OrbitMonitor
from mavlink_broker.live.series import StepSeries, camera_note
from mavlink_broker.live.tracking import SubjectTracker
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.microservices.command import (
    Accepted,
    CommandAlternatives,
    CommandOutcome,
    CommandSequence,
    Refused,
)
from mavlink_broker.planning.situation import (
    Circled,
    Lasted,
    LiveAction,
    Series,
    Tracked,
    Turned,
    approach_commands,
)
from mavlink_broker.vehicle import control_authority
from mavlink_broker.vehicle.control_authority import (
    DISARMED,
    HELD_BY_FAILSAFE,
    Authority,
    Claim,
    TakeoverDebounce,
)
from mavlink_broker.vehicle.recovery_state import LiveCommandProgress
from mavlink_broker.vehicle.vehicle import Vehicle

LISTEN_S: Final = 6.0
"""For signs of a command; meanwhile a camera is asked for its newest pictures."""
_RECEIVED: Final = frozenset({mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS})
PLACE_WITHIN_M: Final = 2.0
SLOW_M_S: Final = 1.0
APPROACH_WITHIN_S: Final = 300.0


Task: TypeAlias = StepSeries | SubjectTracker | CircleExecutor | OrbitMonitor
"""What is done until the end of a command: from a pose, `start`, so many completed `steps`."""


class LiveCommandRecord:
    """The record of one live command; without a name it is never stored nor waited for."""

    def __init__(self, name: str | None, action: LiveAction, vehicle: Vehicle) -> None:
        """Read the record of an earlier run, if there is one."""
        self._name = name
        self._action = action
        self._vehicle = vehicle
        stored = vehicle.recovery.live
        self._stored = stored if stored is not None and stored.name == name else None

    @property
    def is_lost(self) -> bool:
        """Whether there is no record of it."""
        return self._stored is None

    @property
    def earlier(self) -> LiveCommandProgress | None:
        """The progress of an earlier run; of a command that was left for a pause, none."""
        return None if self._stored is None or self._stored.was_left else self._stored

    @property
    def was_accepted(self) -> bool:
        """Whether the vehicle has accepted it in an earlier run."""
        return self.earlier is not None and self.earlier.is_accepted

    @property
    def may_have_been_sent(self) -> bool:
        """Whether it may have been sent, and the vehicle's mode would not show it."""
        is_shown = self._action.moves and not isinstance(self._action.end, Tracked)
        return self.earlier is not None and not self.earlier.is_accepted and not is_shown

    def is_sign(self, message: Message) -> bool:
        """Whether a message shows that the command of an earlier run was received."""
        match message.get_type():
            case "COMMAND_ACK":
                is_own = self._vehicle.route.is_for_us(message)
                is_same = is_own and message.command == self._action.command
                return is_same and message.result in _RECEIVED
            case "CAMERA_IMAGE_CAPTURED":
                began_s = None if self.earlier is None else self.earlier.began_s
                taken_s = self._vehicle.snapshot.since_boot_s(message.time_boot_ms)
                return began_s is not None and taken_s > began_s
            case "CAMERA_TRACKING_IMAGE_STATUS":
                active: int = mavlink.CAMERA_TRACKING_STATUS_FLAGS_ACTIVE
                return bool(message.tracking_status == active)
        return False

    def is_answer(self, message: Message) -> bool:
        """Whether it is the final acknowledgement of the command of an earlier run."""
        if message.get_type() != "COMMAND_ACK" or message.command != self._action.command:
            return False
        if not self._vehicle.route.is_for_us(message):
            return False
        return bool(message.result != mavlink.MAV_RESULT_IN_PROGRESS)

    def may_send(self) -> bool:
        """Record that the command is about to be sent; whether that is on the disk."""
        if self._name is None:
            return True
        live = self._vehicle.recovery.live
        if live is None or live.name != self._name or live.was_left:
            began_s = self._vehicle.snapshot.time_s
            self._vehicle.recovery.live = LiveCommandProgress(name=self._name, began_s=began_s)
        if isinstance(self._action.end, Tracked):
            self._vehicle.recovery.note_tracking()
        return self._vehicle.recovery.is_stored

    def accept(self) -> None:
        """Record, once, that the vehicle has accepted it, and when."""
        live, now_s = self._vehicle.recovery.live, self._vehicle.snapshot.time_s
        if self._name is None:
            return
        if live is None or live.name != self._name:
            live = LiveCommandProgress(name=self._name, began_s=now_s)
        if not live.is_accepted:
            self._vehicle.recovery.live = replace(live, is_accepted=True, accepted_s=now_s)

    def store_progress(self, task: Task) -> None:
        """Record its progress."""
        live = self._vehicle.recovery.live
        if self._name is None or live is None or live.name != self._name or task.start is None:
            return
        if (task.start, task.steps) == (live.start, live.steps):
            return
        if live.start is None:
            live = replace(live, start_s=self._vehicle.snapshot.time_s)
        self._vehicle.recovery.live = replace(live, start=task.start, steps=task.steps)

    @property
    def elapsed_s(self) -> float:
        """Its duration by the vehicle's clock, if an earlier run began it."""
        time_s, earlier = self._vehicle.snapshot.time_s, self.earlier
        if time_s is None or earlier is None:
            return 0.0
        since_s = earlier.began_s if earlier.accepted_s is None else earlier.accepted_s
        return 0.0 if since_s is None else max(0.0, time_s - since_s)


class LivePhase(Enum):
    """The phase of a live command."""

    LISTENING = auto()  # For signs that an earlier run has sent it
    SETTING_PARAMETERS = auto()
    APPROACHING = auto()
    BEGINNING = auto()
    RUNNING = auto()
    ENDING = auto()
    DONE = auto()
    FAILED = auto()


class LiveCommandExecutor:
    """One live command; its progress is recorded under its name."""

    def __init__(self, action: LiveAction, vehicle: Vehicle, name: str | None = None) -> None:
        self._action = action
        self._vehicle = vehicle
        self._record = LiveCommandRecord(name, action, vehicle)
        self._sequence: CommandSequence | None = None
        self._task: Task | None = None
        self._phase_at = 0.0
        self._began_at = 0.0
        self._target = None if action.follow is None else FollowTargetSender(action.follow, vehicle)
        self._takeover = TakeoverDebounce()
        self._extra_s = 0.0  # Added to its duration: an earlier run has lost the acknowledgement
        self._may_be_repetition = False  # An earlier run may have sent it
        self.phase = LivePhase.SETTING_PARAMETERS
        self.reason = ""
        self.is_unanswered = False  # It has failed since the vehicle did not answer
        self.is_control_lost = False  # Another controller, or a pause, has ended it
        self._is_out_of_mission = False  # The vehicle has left its mission items for this command
        self._was_following = False  # In a mode that only the broker or a pause ends
        self._note: str | None = None
        self._capture: CaptureCheck | None = None  # Of a command whose acknowledgement takes time

    @property
    def note(self) -> str | None:
        """What is done differently, or left out."""
        notes = (self._note, None if self._task is None else self._task.note)
        return "; ".join(note for note in notes if note) or None

    @property
    def has_approach(self) -> bool:
        """Whether it begins at a position that the vehicle has to reach first."""
        return self._action.approach is not None

    @property
    def tracks(self) -> bool:
        """Whether the camera tracks a subject for it."""
        is_open = self.phase not in {LivePhase.DONE, LivePhase.FAILED}
        return is_open and isinstance(self._action.end, Tracked)

    @property
    def claim(self) -> Claim:
        """Modes in which the vehicle executes the command, or has not begun it yet."""
        if self._is_out_of_mission and self._action.moves:
            return control_authority.LEFT_MISSION
        return control_authority.HOVERING

    @property
    def has_begun(self) -> bool:
        """Whether the vehicle has accepted it."""
        is_in_progress = self._sequence is not None and self._sequence.is_in_progress
        begun = self.phase is LivePhase.BEGINNING and is_in_progress
        return begun or self.phase in {LivePhase.RUNNING, LivePhase.ENDING, LivePhase.DONE}

    def start(
        self, now: float, *, is_under_way: bool = False, was_reported: bool = False
    ) -> list[Message]:
        """Begin, or continue what an earlier run of the broker has begun.

        `is_under_way` if the vehicle flies it, as its mode shows. `was_reported` if a report says
        that it has begun: that counts without a record alone, because a command that the vehicle
        has left for a pause begins anew.

        If that run has recorded no progress, a duration or an endless orbit counts anew; an orbit
        that the vehicle counts may be over.
        """
        self._began_at = self._phase_at = self._vehicle.time_s(now)
        self._vehicle.override(self._action.overrides)
        if is_under_way or self._record.was_accepted or (was_reported and self._record.is_lost):
            self._resume(now)
            return []
        if self._record.may_have_been_sent:
            self._enter(LivePhase.LISTENING, now)
            self._may_be_repetition = True
            return []
        return self._approach(now)

    def _resume(self, now: float) -> None:
        """Continue the command of an earlier run."""
        self._extra_s = self._action.execution_s
        self._run(now, resumed=True)
        self._phase_at -= self._record.elapsed_s
        if self._record.earlier is not None and self._task is not None:
            self._task.resume(self._record.earlier)

    def _approach(self, now: float) -> list[Message]:
        """Fly to its position, once the vehicle has the parameters that it needs.

        An order that needs none, such as an abort, waits for none.
        """
        if self._action.overrides and not self._vehicle.parameters.is_settled:
            return []
        self._began_at = self._vehicle.time_s(
            now
        )  # Its time limit excludes the setting of parameters
        self._enter(LivePhase.APPROACHING, now)
        if self._action.approach is None:
            return self._begin(now)
        home = self._vehicle.snapshot.home
        if home is None:
            return self._fail("the vehicle's home is not known")
        alternatives = approach_commands(
            self._action.approach,
            home,
            self._action.approach_speed_m_s,
            by_order=self._vehicle.family.speed_by_command,
        )
        return self._send(alternatives, now)

    def receive(self, message: Message, now: float) -> list[Message]:
        """Process a message of the vehicle."""
        if self._is_refusal(message):
            return self._fail(f"the vehicle does not go there: {message.text.strip()}")
        if self.phase is LivePhase.LISTENING and self._record.is_sign(message):
            self._resume(now)
        if self._capture is not None:
            self._capture.receive(message, now)
        messages = self._sequence.receive(message, now) if self._sequence else []
        if self._task is not None and self.phase is LivePhase.RUNNING:
            messages += self._task.receive(message, now)
        if self._extra_s and self._record.is_answer(message):
            self._extra_s = 0.0
        if self._action.moves and self._sign_of_takeover() is not None:
            return messages
        if message.get_type() == "GLOBAL_POSITION_INT":
            messages += self._send_target(now)
        return [*messages, *self._advance(now)]

    def _is_refusal(self, message: Message) -> bool:
        """Whether PX4 refuses, after its acknowledgement, to fly to a position: a STATUSTEXT."""
        is_refusal = message.get_type() == "STATUSTEXT" and means(
            message.text, TextMeaning.TARGET_OUTSIDE_GEOFENCE
        )
        moves = isinstance(self._task, CircleExecutor | StepSeries)
        return is_refusal and (
            self.phase is LivePhase.APPROACHING or (moves and self.phase is LivePhase.RUNNING)
        )

    def tick(self, now: float) -> list[Message]:
        """Do what is due at a time."""
        role = self._vehicle.mode_role
        self._is_out_of_mission |= role in {ModeRole.HOLD, ModeRole.GUIDED}
        follows = isinstance(self._action.end, Lasted) and self._vehicle.mode in LIVE_MODES
        self._was_following |= follows and self.phase is LivePhase.RUNNING
        messages: list[Message] = []
        if self._sign_of_takeover() is None or not self._action.moves:
            messages += self._repeat(now)
            if self._task is not None and self.phase is LivePhase.RUNNING:
                messages += self._task.tick(now)
            messages += self._advance(now)
            self._record_progress()
        self._check(now)
        return messages

    def _repeat(self, now: float) -> list[Message]:
        """Repeat an overdue command, unless it was received and may have been carried out."""
        capture = self._capture if self.phase is LivePhase.BEGINNING else None
        if capture is not None and capture.state in {CaptureState.IN_PROGRESS, CaptureState.DONE}:
            return capture.tick(now)
        return self._sequence.tick(now) if self._sequence else []

    def _record_progress(self) -> None:
        if self.has_begun:
            self._record.accept()
        if self._task is not None:
            self._record.store_progress(self._task)

    def _advance(self, now: float) -> list[Message]:
        outcome = self._sequence.outcome if self._sequence else None
        if isinstance(outcome, Refused) and self.phase is not LivePhase.ENDING:
            return self._refused(outcome, now)
        match self.phase:
            case LivePhase.LISTENING if self._vehicle.time_s(now) - self._phase_at >= LISTEN_S:
                self._enter(LivePhase.SETTING_PARAMETERS, now)
            case LivePhase.SETTING_PARAMETERS:
                return self._approach(now)
            case LivePhase.APPROACHING if self._has_arrived(outcome):
                return self._begin(now)
            case LivePhase.BEGINNING if isinstance(outcome, Accepted):
                self._note_alternative()
                self._run(now)
            case LivePhase.BEGINNING if self._capture and self._capture.state is CaptureState.DONE:
                self._sequence = None  # The acknowledgement is lost, the pictures exist
                self._run(now)
            case LivePhase.RUNNING if self._task is not None and self._task.reason is not None:
                return self._fail(self._task.reason)
            case LivePhase.RUNNING if self._is_over(now):
                return self._finish(now)
            case LivePhase.ENDING if (
                outcome is not None
            ):  # A refusal may mean that it has ended already
                self._enter(LivePhase.DONE, now)
        return []

    def _refused(self, refusal: Refused, now: float) -> list[Message]:
        """Fail, or leave out a command for a camera that does not exist."""
        is_for_camera = self._action.wants_camera and self.phase is LivePhase.BEGINNING
        note = camera_note(self._vehicle, refusal) if is_for_camera else None
        if note is None:
            self.is_unanswered = refusal.result is None
            return self._fail(refusal.reason)
        self._note, self._sequence = note, None
        self._enter(LivePhase.DONE, now)
        return []

    def _has_arrived(self, outcome: CommandOutcome | None) -> bool:
        is_near = self._action.approach is None
        return is_near or (isinstance(outcome, Accepted) and self._is_at_approach())

    def _begin(self, now: float) -> list[Message]:
        """Send the command, once the record shows that it is about to be sent."""
        if not self._record.may_send():
            return []
        self._enter(LivePhase.BEGINNING, now)
        if self._action.execution_s:
            self._capture = CaptureCheck(self._action.command, self._vehicle)
        return [*self._send_target(now), *self._send(self._action.begin, now)]

    def _run(self, now: float, *, resumed: bool = False) -> None:
        match self._action.end:
            case Turned() as turn:
                self._task = OrbitMonitor(turn, self._vehicle, resumed=resumed)
            case Series(steps):
                self._task = StepSeries(steps, self._vehicle)
            case Tracked() as end:
                self._task = SubjectTracker(end, self._vehicle)
            case Circled() as circle:
                self._task = CircleExecutor(circle, self._vehicle)
        self._enter(LivePhase.RUNNING, now)

    def _finish(self, now: float) -> list[Message]:
        self._enter(LivePhase.ENDING, now)
        has_released = isinstance(self._task, OrbitMonitor) and self._task.has_released
        if not self._action.finish or has_released:
            self._enter(LivePhase.DONE, now)
            return []
        return self._send(self._action.finish, now)

    def _send(self, alternatives: CommandAlternatives, now: float) -> list[Message]:
        self._sequence = self._vehicle.sequence(alternatives, is_repetition=self._may_be_repetition)
        return self._sequence.start(now)

    def _enter(self, phase: LivePhase, now: float) -> None:
        self.phase, self._phase_at = phase, self._vehicle.time_s(now)

    def _fail(self, reason: str) -> list[Message]:
        self.phase, self.reason = LivePhase.FAILED, reason
        return []

    def _note_alternative(self) -> None:
        alternative = self._sequence.alternative if self._sequence else 0
        notes = list(self._vehicle.parameters.refusals.values())
        if alternative < len(self._action.alternative_notes):
            notes.append(self._action.alternative_notes[alternative])
        self._note = "; ".join(note for note in notes if note) or None

    def _is_at_approach(self) -> bool:
        position, spot = self._vehicle.snapshot.position, self._action.approach
        if position is None or spot is None:
            return False
        horizontal_m = distance_m(*position[:2], *spot[:2])
        vertical_m = abs(position.altitude_m - spot.relative_altitude_m)
        return max(horizontal_m, vertical_m) <= PLACE_WITHIN_M and position.speed_m_s <= SLOW_M_S

    def _is_over(self, now: float) -> bool:
        if isinstance(self._action.end, Lasted):
            lasts_s = self._action.end.duration_s + self._extra_s
            return self._vehicle.time_s(now) - self._phase_at >= lasts_s
        return self._task is not None and self._task.is_over

    def _send_target(self, now: float) -> list[Message]:
        if self._target is None or self.phase not in {LivePhase.BEGINNING, LivePhase.RUNNING}:
            return []
        time_s = self._vehicle.time_s(now)
        followed_s = time_s - self._phase_at if self.phase is LivePhase.RUNNING else 0.0
        return self._target.send(time_s, followed_s, now)

    def _check(self, now: float) -> None:
        """Fail when another controller has ended it, or it takes too long."""
        if self.phase in {LivePhase.DONE, LivePhase.FAILED}:
            return
        if not self._vehicle.is_reachable(now):
            if self._capture is not None:
                self._capture.restart_timeout()
            return
        is_checked = self.phase is LivePhase.BEGINNING and self._capture is not None
        fault = self._capture.fault(now) if is_checked and self._capture else None
        if fault is not None:
            self._fail(fault)
            return
        approach_s = 0.0 if self._action.approach is None else APPROACH_WITHIN_S
        if self._vehicle.time_s(now) - self._began_at > self._action.within_s + approach_s:
            self._fail(f"it has not ended within {self._action.within_s:.0f} s")
            return
        sign = self._sign_of_takeover() if self._action.moves else None
        reason = self._takeover.update(sign, now)
        if reason is not None:
            self.is_control_lost = True
            self._fail(reason)

    def _sign_of_takeover(self) -> str | None:
        if self._vehicle.snapshot.armed is False:
            return DISARMED
        if self._vehicle.is_held_by_failsafe:
            return HELD_BY_FAILSAFE
        seen = self._vehicle.observed_mode
        who = control_authority.authority_of(seen, self.claim)
        if who is not Authority.BROKER:
            return control_authority.reason(who, seen)
        is_running = self.phase is LivePhase.RUNNING
        if is_running and self._was_following and seen.role is ModeRole.HOLD:
            return f"the vehicle was paused: mode {seen.mode}"
        if is_running and isinstance(self._task, OrbitMonitor) and self._task.has_left:
            return f"the vehicle left its circle: mode {self._vehicle.mode}"
        return None
