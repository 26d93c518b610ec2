"""One mission that an earlier run of the broker accepted: what the vehicle has made of it since.

What a broker knows is lost with it, but for the mission's last report and its notes of the vehicle.
A stage is written into a report before the vehicle is told to start it: without that nobody has
started it, and with it the vehicle itself knows the rest.
"""

import math
from typing import Final

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.effects import Effects
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.mission_verify import Different, Untold, Verified
from mavlink_broker.mission import activities
from mavlink_broker.mission.flight_preparation import FlightPreparation
from mavlink_broker.mission.segments import SHORTEST_ITEMS
from mavlink_broker.mission.states import Event, State
from mavlink_broker.planning.mission import SPARE_ITEMS, LiveCommand, RefusedError
from mavlink_broker.vehicle import prearm
from mavlink_broker.vehicle.control_authority import InCommand
from mavlink_broker.vehicle.prearm import Attachment

_NOTHING_DONE: Final = frozenset(
    {
        mavlink.MISSION_STATE_UNKNOWN,
        mavlink.MISSION_STATE_NO_MISSION,
        mavlink.MISSION_STATE_NOT_STARTED,
    }
)

_GIMBAL: Final[int] = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
_MOUNT: Final[int] = mavlink.MAV_CMD_DO_MOUNT_CONTROL
_CAPTURE: Final[int] = mavlink.MAV_CMD_IMAGE_START_CAPTURE
_REFUSED_PERHAPS: Final = (
    {_GIMBAL},
    {_GIMBAL, _MOUNT},
    {_CAPTURE},
    {_GIMBAL, _CAPTURE},
    {_GIMBAL, _MOUNT, _CAPTURE},
)
"""What a vehicle may have refused as items, so that an earlier run said it otherwise."""


_PARTINGS: Final = 3
"""How often a stretch may have been parted by an earlier run: into eight parts."""


class FlightAttachment(FlightPreparation):
    """The state ATTACHING."""

    @property
    def is_sought(self) -> bool:
        """Whether it is not known yet what has become of it."""
        return self.state is State.ATTACHING

    @property
    def is_looked_for(self) -> bool:
        """Whether it was seen to fly, and it is not known yet what has become of that."""
        return self.state is State.ATTACHING and self._has_flown

    def _step_attaching(self, now: float, effects: Effects) -> None:
        if self._activity is not None:
            return
        self._believe_notes(now, effects)
        if self._heard_at is None and self._vehicle.is_heard(now):
            self._heard_at = now
        attachment = prearm.attachment(
            self._vehicle,
            now,
            started=self._has_flown,
            waited_s=now - self._entered_at,
            heard_s=0.0 if self._heard_at is None else now - self._heard_at,
        )
        match attachment:
            case Attachment.BEGIN:
                self._move(Event.NOT_STARTED, now, effects)
            case Attachment.COMPARE if not self._flies_another:
                self._attach(now, effects)

    def _believe_notes(self, now: float, effects: Effects) -> None:
        """Learn from the journal what the edge server was not told before the broker died.

        Whatever lies before a stage that was begun has ended, and the stage itself may have been
        flown: its name was written down before the vehicle was ordered to begin it.
        """
        live = self._vehicle.live
        noted = {self._vehicle.started, None if live is None else live.name} - {None}
        indices = [i for i in range(len(self.ledger.commands)) if self.ledger.name_of(i) in noted]
        newest = max(indices, default=-1)
        begun = live is None or self.ledger.name_of(newest) != live.name or live.is_agreed
        if newest < 0 or self.ledger.status.is_terminal or newest < self.ledger.finished:
            return
        changes = self.ledger.set_mission(Status.RUNNING)
        for index in range(self.ledger.finished, newest):
            if not self.ledger.commands[index].is_terminal:
                changes |= self.ledger.set_command(index, Status.FINISHED)
                effects.for_edge += self._reporter.results(self.ledger.name_of(index), now)
        if begun and self.ledger.commands[newest] is Status.NOT_STARTED:
            changes |= self.ledger.set_command(newest, Status.RUNNING)
        if changes:
            effects.for_edge.append(self._reporter.mission(self.ledger))

    def _attach(self, now: float, effects: Effects) -> None:
        """Find the stage that was being flown; a live command shows in the vehicle's mode."""
        try:
            self._translate()
        except RefusedError as error:
            self._fail(error.reason, now, effects, error.command_index)
            return
        if self._has_flown and self._was_restarted(now):
            self._fail("the vehicle was restarted", now, effects)
            return
        self._stages.go_to(self.ledger.finished)
        if not isinstance(self._stages.current, LiveCommand):
            self._start(activities.recognition(self._plan, self._vehicle), now, effects)
            return
        self._hovering = True
        if self._is_taken_away:
            self._fail(self._departure, now, effects)
            return
        self._move(Event.LIVE_NEXT, now, effects)

    def _settle(self, now: float, effects: Effects) -> None:
        """Judge what was read back; every other state's protocol is settled elsewhere."""
        if self.state is not State.ATTACHING:
            super()._settle(now, effects)
            return
        outcome = self._activity.outcome if self._activity else None
        if isinstance(outcome, Untold):
            self._activity = None  # The link is away: asked again when it is back
        elif isinstance(outcome, Verified | Different):
            self._judge(outcome, now, effects)

    def _judge(self, outcome: Verified | Different, now: float, effects: Effects) -> None:
        same, first = isinstance(outcome, Verified), self._stages.is_first
        if same and self._is_flown:
            self._was_running = True
            if self._who is InCommand.BROKER:  # Else it keeps what the earlier run has set
                self._vehicle.borrow(tuple(loan for _, loan in self._plan.loans))
            self._move(Event.FLYING, now, effects)
        elif not first and (same or not self._is_begun):
            self._go_on_with_stage(now, effects)
        elif isinstance(outcome, Different) and self._has_flown and self._guess_refusals():
            self._activity = None  # Compared once more
        elif isinstance(outcome, Different) and self._has_flown:
            self._fail(outcome.reason, now, effects)
        else:
            self._begin_or_wait(now, effects)

    def _guess_refusals(self) -> bool:
        """Think of other items that the mission may have become; false when all are thought of."""
        while self._guesses < len(_REFUSED_PERHAPS):
            guess = _REFUSED_PERHAPS[self._guesses]
            self._guesses += 1
            before = self._plan.items
            self._vehicle.refused_items, self._vehicle.most_items = set(guess), None
            self._stages.translate()
            if self._plan.items != before:
                return True
        self._vehicle.refused_items = set()
        return self._guess_parts()

    def _guess_parts(self) -> bool:
        """Think of the parts that a vehicle without space for all items was given."""
        if self._part_guesses >= _PARTINGS:
            return False
        self._part_guesses += 1
        if self._whole_items == 0:
            self._vehicle.most_items = None
            self._stages.translate()
            self._whole_items = self._stages.longest
        if self._whole_items <= SHORTEST_ITEMS:
            return False
        items = self._whole_items
        for _ in range(self._part_guesses):
            items = math.ceil(items / 2) + SPARE_ITEMS
        self._vehicle.most_items = items
        self._stages.translate()
        return True

    def _was_restarted(self, now: float) -> bool:
        """Whether the vehicle, which stands, was switched on since the mission was last reported.

        Its time is not the broker's where it is simulated, so that its deeds count for more.
        """
        snapshot, reported_at = self._vehicle.snapshot, self.work.reported_at
        mission = snapshot.mission
        is_complete = mission is not None and mission.state == mavlink.MISSION_STATE_COMPLETE
        if not snapshot.is_on_ground or is_complete:
            return False
        up_s = snapshot.time_s
        return up_s is not None and reported_at is not None and now - up_s > reported_at

    def _go_on_with_stage(self, now: float, effects: Effects) -> None:
        """Begin the later stage that nobody has started."""
        if self._is_taken_away:
            self._fail(self._departure, now, effects)
            return
        self._was_running = False
        self._hovering = not self._vehicle.snapshot.is_on_ground
        self._move(self._event_of_stage(), now, effects)

    def _begin_or_wait(self, now: float, effects: Effects) -> None:
        """Begin from scratch on the ground, or in our own hover; else flies what is not ours."""
        if self._vehicle.snapshot.is_on_ground or self._vehicle.hovers:
            self._hovering = self._vehicle.hovers
            self._move(Event.NOT_STARTED, now, effects)
        else:
            self._activity = None
            self._flies_another = True

    @property
    def _is_begun(self) -> bool:
        """Whether the vehicle was about to be told to start the stage, so that it may have."""
        return self.ledger.commands[self._plan.first_command] is not Status.NOT_STARTED

    @property
    def _is_flown(self) -> bool:
        """Whether the vehicle, which holds the stage, flies it or has flown it."""
        vehicle = self._vehicle
        in_mission = vehicle.family.knows_modes and vehicle.mode_role is ModeRole.MISSION
        if in_mission and vehicle.snapshot.armed:
            return self._is_begun or (self._stages.is_first and not vehicle.hovers)
        return self._is_begun and not self._is_fresh

    @property
    def _is_fresh(self) -> bool:
        """Whether the vehicle has done nothing of the stage, by its own word where it gives it."""
        rest = self._plan.commands[1:]
        has_gone_on = any(self.ledger.commands[i] is not Status.NOT_STARTED for i in rest)
        if has_gone_on or self._vehicle.snapshot.is_on_ground != self._stages.is_from_ground:
            return False
        told = self._vehicle.snapshot.mission
        if told is None or told.seq > self._plan.first_item or self._vehicle.has_run_its_mission:
            return False
        return told.state in _NOTHING_DONE
