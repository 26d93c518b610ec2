"""ATTACHING: what the vehicle has made of a mission meanwhile.

An earlier run of the broker accepted the mission, or its link was away. What a broker knows is lost
with it, but for the mission's last report and its notes of the vehicle. A segment is written into a
report before the vehicle is ordered to start it: without that no broker has started it, and with it
the vehicle itself knows the rest.
"""

import math
from enum import Enum, auto
from typing import Final

from afarcloud.enumerations import Status
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.effects import Effects
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.mission_download import Different, ReadBackFailed, Verified
from mavlink_broker.mission import exchanges
from mavlink_broker.mission.context import (
    PROGRESS_WITHIN_S,
    TELEMETRY_WITHIN_S,
    VEHICLE_WITHIN_S,
    MissionContext,
)
from mavlink_broker.mission.exchanges import Outcome
from mavlink_broker.mission.integrity import CLEARED
from mavlink_broker.mission.phases.phase import Fault, Phase, Result
from mavlink_broker.mission.segments import SHORTEST_ITEMS
from mavlink_broker.mission.states import Event
from mavlink_broker.planning.mission import SPARE_ITEMS
from mavlink_broker.planning.situation import RefusedError
from mavlink_broker.vehicle.control_authority import DESCENDING, HOVERING, Authority, Claim
from mavlink_broker.vehicle.vehicle import Vehicle

_NOT_STARTED: Final = frozenset(
    {
        mavlink.MISSION_STATE_UNKNOWN,
        mavlink.MISSION_STATE_NO_MISSION,
        mavlink.MISSION_STATE_NOT_STARTED,
    }
)

_GIMBAL: Final[int] = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
_MOUNT: Final[int] = mavlink.MAV_CMD_DO_MOUNT_CONTROL
_CAPTURE: Final[int] = mavlink.MAV_CMD_IMAGE_START_CAPTURE
_REFUSALS: Final = (
    {_GIMBAL},
    {_GIMBAL, _MOUNT},
    {_CAPTURE},
    {_GIMBAL, _CAPTURE},
    {_GIMBAL, _MOUNT, _CAPTURE},
)
"""Sets of MAV_CMD that a vehicle may have refused as items, so that it holds others."""
ARMED_UNSTARTED_S: Final = 10.0
"""How long a vehicle stays armed without a start: COM_DISARM_PRFLT of PX4, DISARM_DELAY of
ArduPilot."""
DISARM_EVERY_S: Final = 2.0
MOST_DISARMINGS: Final = 5
_HALVINGS: Final = 3
"""How often an earlier run may have halved a segment: into eight parts."""


class _Step(Enum):
    """What is to be done about a mission that an earlier run of the broker accepted."""

    WAIT = auto()  # Not enough is known yet
    BEGIN = auto()  # It was never started: begin it
    COMPARE = auto()  # The vehicle may be flying it: compare what it holds


class Attaching(Phase):
    """Finds the segment that the vehicle flies, or decides that none was started."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self._entered_at = 0.0
        self._connected_at: float | None = None  # First heartbeat since the phase began
        self._flies_another = False  # Another mission; this one waits for the landing
        self._holds_another = False  # Another mission than this one, which has flown
        self._is_armed_by_us = False  # By an earlier run, and it still stands
        self._is_unstarted = False  # That one, which was to be ordered to start
        self._disarm_at = 0.0
        self._disarmings = 0
        self._refusals_tried = 0
        self._halvings_tried = 0
        self._whole_items = 0  # Of the longest segment before halving; 0: not counted yet

    @property
    def claim(self) -> Claim:
        """The vehicle may fly, land or return for this mission, unless another system had it."""
        return HOVERING if self._mission.authority.was_taken else DESCENDING

    @property
    def flies_another(self) -> bool:
        """Whether the vehicle flies the mission of another system."""
        return self._holds_another and self._vehicle.mode_role is ModeRole.MISSION

    def is_progress_unknown(self, now: float) -> bool:
        """Whether a vehicle that was just received may show soon how far it has flown."""
        since = now if self._connected_at is None else self._connected_at
        is_reachable = self._vehicle.is_reachable(now)
        is_new = is_reachable and now - since < PROGRESS_WITHIN_S
        return is_new and self._mission.was_reported_running

    def enter(self, now: float, effects: Effects) -> Result:
        """Begin to look at the vehicle."""
        del effects
        self._entered_at = now
        self._connected_at = None
        self._flies_another = self._is_armed_by_us = self._is_unstarted = False
        self._disarm_at, self._disarmings = now, 0
        return None

    def forget(self) -> None:
        """Read the mission again: the vehicle was restarted."""
        self.exchange = None

    def tick(self, now: float, effects: Effects) -> Result:
        """Compare the missions as soon as enough is known of the vehicle."""
        self._note_flying()
        self._follow_arming(now, effects)
        if self.exchange is not None:
            return None
        self._apply_notes(now, effects)
        snapshot = self._vehicle.snapshot
        if snapshot.armed is False and snapshot.is_on_ground:
            self._flies_another = False  # It has landed: compared again, if this one was begun
        if self._connected_at is None and self._vehicle.is_reachable(now):
            self._connected_at = now
        step = _next_step(
            self._vehicle,
            now,
            started=self._mission.was_reported_running,
            waited_s=now - self._entered_at,
            connected_s=0.0 if self._connected_at is None else now - self._connected_at,
        )
        match step:
            case _Step.BEGIN:
                return Event.NOT_STARTED
            case _Step.COMPARE if not self._flies_another:
                return self._attach(now, effects)
        return None

    def _note_flying(self) -> None:
        """Note that the vehicle is seen to fly its items, should its link be lost again."""
        vehicle = self._vehicle
        is_in_air = vehicle.snapshot.landed_state == mavlink.MAV_LANDED_STATE_IN_AIR
        flies = bool(vehicle.snapshot.armed) and vehicle.mode_role is ModeRole.MISSION
        if flies and is_in_air and vehicle.recovery.segment is not None:
            vehicle.recovery.note_flying(vehicle.recovery.segment)

    def _apply_notes(self, now: float, effects: Effects) -> None:
        """Report what the journal holds and the edge server has not received.

        Whatever lies before a segment that was begun has ended, and the segment itself may have
        been flown: its name was written down before the vehicle was ordered to begin it.
        """
        recovery = self._vehicle.recovery
        ledger, live = self._mission.ledger, recovery.live
        noted = {recovery.segment, None if live is None else live.name} - {None}
        indices = [i for i in range(len(ledger.commands)) if ledger.name_of(i) in noted]
        newest = max(indices, default=-1)
        begun = live is None or ledger.name_of(newest) != live.name or live.is_accepted
        if newest < 0 or ledger.status.is_terminal or newest < ledger.finished:
            return
        changes = ledger.set_mission(Status.RUNNING)
        for index in range(ledger.finished, newest):
            if not ledger.commands[index].is_terminal:
                changes |= ledger.set_command(index, Status.FINISHED)
                effects.for_edge += self._mission.reporter.results(ledger.name_of(index), now)
        if begun and ledger.commands[newest] is Status.NOT_STARTED:
            changes |= ledger.set_command(newest, Status.RUNNING)
        if changes:
            self._mission.report(effects)

    def _attach(self, now: float, effects: Effects) -> Result:
        """Go to the segment in flight; a live command shows in the vehicle's mode."""
        mission = self._mission
        try:
            mission.translate()
        except RefusedError as error:
            return Fault(error.reason, error.command_index)
        if mission.was_reported_running and self._was_restarted(now):
            self._vehicle.recovery.was_restarted_since = True
            return Fault("the vehicle was restarted")
        mission.segments.go_to(mission.ledger.finished)
        if not mission.is_live:
            self.run(exchanges.recognition(mission.plan, self._vehicle), now, effects)
            return None
        mission.is_hovering = True
        if mission.authority.is_lost:
            return Fault(mission.authority.loss_reason)
        return Event.LIVE_NEXT

    def _was_restarted(self, now: float) -> bool:
        """Whether the vehicle was switched on again after it was ordered to begin.

        Its own clock shows that, unless it has run for longer by now than it had then. On the
        ground it shows too, by the broker's clock, if the mission was reported before; a report
        that was made while the vehicle was out of reach hides it. A complete mission counts for
        more: the clock of a simulated vehicle is not the broker's.
        """
        mission, snapshot = self._mission, self._vehicle.snapshot
        current, up_s = snapshot.mission, snapshot.time_s
        is_complete = current is not None and current.state == mavlink.MISSION_STATE_COMPLETE
        if up_s is None or is_complete:
            return False
        names = [mission.ledger.name_of(index) for index in range(len(mission.ledger.commands))]
        began_s, reported_at = self._vehicle.recovery.began_s(names), mission.work.reported_at
        if began_s is not None and up_s < began_s:
            return True
        return snapshot.is_on_ground and reported_at is not None and now - up_s > reported_at

    def settle(self, outcome: Outcome, now: float) -> Result:
        """Judge the items that the vehicle holds."""
        del now
        if isinstance(outcome, ReadBackFailed):
            self.exchange = None  # The link is away: read again when it is back
        elif isinstance(outcome, Verified | Different):
            return self._decide(outcome)
        return None

    def _decide(self, outcome: Verified | Different) -> Result:
        mission = self._mission
        same, first = isinstance(outcome, Verified), mission.segments.is_first
        if same and self._is_flown:
            mission.was_running = True
            if mission.authority.who(self.claim) is Authority.BROKER:  # Else it keeps what it has
                self._vehicle.override(tuple(override for _, override in mission.plan.overrides))
            return Event.FLYING
        if not first and (same or not self._is_begun):
            return self._begin_segment()
        if isinstance(outcome, Different) and mission.was_reported_running:
            self._holds_another = (outcome.count or 0) > mission.plan.first_item
            if not self._holds_another:
                return Fault(f"somebody else {CLEARED}")
            if not self._try_other_items():
                return Fault(outcome.reason)
            self.exchange = None  # Compared again
            return None
        return self._begin_or_wait()

    def _try_other_items(self) -> bool:
        """Translate to other items that an earlier run may have uploaded; false without any."""
        mission, limits = self._mission, self._vehicle.item_limits
        while self._refusals_tried < len(_REFUSALS):
            refusals = _REFUSALS[self._refusals_tried]
            self._refusals_tried += 1
            before = mission.plan.items
            limits.refused = frozenset(refusals)
            limits.most_items = None
            mission.segments.translate()
            if mission.plan.items != before:
                return True
        limits.refused = frozenset()
        return self._try_shorter_segments()

    def _try_shorter_segments(self) -> bool:
        """Translate to the parts that a vehicle without space for all items was given."""
        if self._halvings_tried >= _HALVINGS:
            return False
        self._halvings_tried += 1
        segments = self._mission.segments
        if self._whole_items == 0:
            self._vehicle.item_limits.most_items = None
            segments.translate()
            self._whole_items = segments.longest
        if self._whole_items <= SHORTEST_ITEMS:
            return False
        items = self._whole_items
        for _ in range(self._halvings_tried):
            items = math.ceil(items / 2) + SPARE_ITEMS
        self._vehicle.item_limits.most_items = items
        segments.translate()
        return True

    def _begin_segment(self) -> Result:
        """Begin the later segment that was not started."""
        mission = self._mission
        if mission.authority.is_lost:
            return Fault(mission.authority.loss_reason)
        mission.was_running = False
        mission.is_hovering = not self._vehicle.snapshot.is_on_ground
        return mission.event_of_segment()

    def _begin_or_wait(self) -> Result:
        """Begin from the ground or from a hover of this broker; else wait for the landing.

        A vehicle that stands armed disarms first, by order if this broker has armed it.
        """
        if self._is_armed_by_us and self._disarmings < MOST_DISARMINGS:
            self._is_unstarted, self.exchange = True, None  # Compared again
            return None
        if self._is_standing or self._vehicle.hovers:
            self._mission.is_hovering = self._vehicle.hovers
            return Event.NOT_STARTED
        self.exchange = None
        self._flies_another = True
        return None

    @property
    def _is_standing(self) -> bool:
        """Whether the vehicle is on the ground, armed or not."""
        return self._vehicle.snapshot.is_on_ground or self._vehicle.is_standing_armed

    def _follow_arming(self, now: float, effects: Effects) -> None:
        """Keep a vehicle that an earlier run has armed, and disarm it unless it may start yet.

        Some vehicles never disarm by themselves. The mission begins once it is disarmed. One that
        was to be ordered to start is disarmed when it turns out that it has flown nothing.
        """
        vehicle = self._vehicle
        if not vehicle.is_standing_armed:
            self._is_armed_by_us = False
            return
        is_lost = self._mission.authority.is_lost
        if self._was_just_armed and not is_lost:
            vehicle.armed_period.claim()
            self._is_armed_by_us = True
        is_ours = self._is_armed_by_us and not is_lost
        may_start = vehicle.recovery.arming_s is None and not self._is_unstarted
        may_start |= vehicle.mode_role is ModeRole.MISSION
        if is_ours and not may_start and now >= self._disarm_at:
            self._disarm_at = now + DISARM_EVERY_S
            self._disarmings += 1
            effects.messages += exchanges.disarming(vehicle)

    @property
    def _was_just_armed(self) -> bool:
        """Whether an earlier run has ordered to arm or to start, so shortly ago that it still arms.

        A vehicle that is not started disarms after some seconds; later somebody else arms it.
        """
        recovery, now_s = self._vehicle.recovery, self._vehicle.snapshot.time_s
        name = self._mission.ledger.name_of(self._mission.plan.first_command)
        ordered_s = (recovery.began_s([name]), recovery.arming_s)
        if now_s is None:
            return False
        return any(one is not None and 0.0 <= now_s - one <= ARMED_UNSTARTED_S for one in ordered_s)

    @property
    def _is_begun(self) -> bool:
        """Whether the vehicle may have been ordered to start the segment."""
        mission = self._mission
        return mission.ledger.commands[mission.plan.first_command] is not Status.NOT_STARTED

    @property
    def _is_flown(self) -> bool:
        """Whether the vehicle, which holds the segment, flies it or has flown it."""
        vehicle = self._vehicle
        in_mission = vehicle.family.knows_modes and vehicle.mode_role is ModeRole.MISSION
        if in_mission and vehicle.snapshot.armed:
            return self._is_begun or (self._mission.segments.is_first and not vehicle.hovers)
        return self._is_begun and not self._is_fresh

    @property
    def _is_fresh(self) -> bool:
        """Whether the vehicle has done nothing of the segment, as its MISSION_CURRENT shows.

        One that was restarted shows the same; it does not begin again what it was seen to fly.
        """
        mission, snapshot = self._mission, self._vehicle.snapshot
        if self._vehicle.recovery.has_flown(mission.ledger.name_of(mission.plan.first_command)):
            return False
        rest = mission.plan.commands[1:]
        has_gone_on = any(mission.ledger.commands[i] is not Status.NOT_STARTED for i in rest)
        if has_gone_on or self._is_standing != mission.segments.is_from_ground:
            return False
        current = snapshot.mission
        if current is None or current.seq > mission.plan.first_item:
            return False
        return not self._vehicle.has_run_its_mission and current.state in _NOT_STARTED


def _next_step(
    vehicle: Vehicle,
    now: float,
    *,
    started: bool,
    waited_s: float,
    connected_s: float,
) -> _Step:
    """Decide what to do about a mission; `started` if it was reported to run.

    A started mission waits for the vehicle without a limit. The vehicle has been connected for
    `connected_s`, in which it may not have sent its position, its battery and whether it stands.
    """
    snapshot = vehicle.snapshot
    if not vehicle.is_reachable(now) or snapshot.armed is None or not vehicle.is_identified:
        may_wait = started or waited_s < VEHICLE_WITHIN_S
        return _Step.WAIT if may_wait else _Step.BEGIN
    if not started and snapshot.is_on_ground:
        return _Step.BEGIN
    newest = snapshot.attitude, snapshot.battery_fraction, snapshot.mission
    shows_ground = snapshot.landed_state != mavlink.MAV_LANDED_STATE_UNDEFINED
    has_all_telemetry = None not in newest and shows_ground
    has_position = snapshot.home is not None and snapshot.position is not None
    if not has_position or not (has_all_telemetry or connected_s >= TELEMETRY_WITHIN_S):
        return _Step.WAIT
    may_disarm = _is_about_to_disarm(vehicle) and connected_s < ARMED_UNSTARTED_S
    return _Step.WAIT if not started and may_disarm else _Step.COMPARE


def _is_about_to_disarm(vehicle: Vehicle) -> bool:
    """Armed on the ground without an order to start: it will take off or disarm by itself."""
    return vehicle.is_standing_armed and vehicle.mode_role is not ModeRole.MISSION
