"""What must hold of missions: how they end, and what is flown of them before and after that."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

from afarcloud.enumerations import Status
from dst.actors.operator_person import Operator, PostedPlan
from dst.laws.facts import Facts, LawError, is_at
from dst.laws.picture_laws import PictureLaws
from dst.vehicles.flight import Arming, Truth, is_same_place
from dst.world.world import World
from mavlink_broker.mission.abort_executor import REASONS
from mavlink_broker.mission.phases.ending import MAY_BE_FLOWN

ENDED_MISSION_S: Final = 10.0
"""After its terminal status nothing of a mission is flown any more within this time."""
EXPIRY_S: Final = 5.0
"""An order to arm that was sent before a plan expired arrives within this time."""
LEAST_TURN_RAD: Final = 0.65 * math.tau
"""The broker takes a turn for complete from 0.7 on, by positions that it has received."""


class MissionLaws:
    """Watches the missions of a world."""

    def __init__(
        self, world: World, operator: Operator, facts: Facts, pictures: PictureLaws
    ) -> None:
        self._world = world
        self._operator = operator
        self._facts = facts
        self._pictures = pictures
        self._ended: dict[int, tuple[Status, float]] = {}  # By plan: first terminal status, when
        self._paused: dict[int, tuple[float, list[PostedPlan]]] = {}  # By event: when, what flew

    def check(self) -> None:
        """Check what holds at any time.

        Raises:
            LawError: if a law is broken.
        """
        self._nothing_flown_afterwards()
        self._nothing_begun_after_expiry()
        self._nothing_flown_while_paused()

    def open(self) -> list[str]:
        """Give the missions that have not ended."""
        return [
            f"plan {plan.number} is {Status(mission['mission_status_id']).name}"
            for plan, mission in self._facts.missions()
            if not Status(mission["mission_status_id"]).is_terminal
        ]

    def note_ends(self) -> None:
        """Note which missions have ended, while the edge server is up.

        Raises:
            LawError: if one has another terminal status than before.
        """
        for plan, mission in self._facts.missions():
            status = Status(mission["mission_status_id"])
            before = self._ended.get(plan.number)
            if before is None and status.is_terminal:
                self._ended[plan.number] = status, self._world.scheduler.now_s
            elif before is not None and status is not before[0]:
                raise LawError(f"plan {plan.number}: {status.name} after {before[0].name}")

    def _nothing_flown_afterwards(self) -> None:
        """Nothing is flown of a mission that was cancelled or has ended."""
        for plan in self._operator.plans:
            ends = [plan.cancelled_s] if plan.cancelled_s is not None else []
            if plan.number in self._ended:
                ends.append(self._mission_end_s(plan))
            for one in self._facts.flown(plan):
                if ends and one.time_s > min(ends):
                    raise LawError(
                        f"plan {plan.number}: a waypoint is flown at {one.time_s:.1f} s, "
                        f"though it ended at {min(ends):.1f} s"
                    )

    def _nothing_begun_after_expiry(self) -> None:
        """A vehicle that was not armed for a plan while it was valid is not armed for it later."""
        for plan in self._operator.plans:
            for truth in self._world.truths(plan.vehicle_id):
                armed_s = self._armed_late_s(truth, plan)
                if armed_s is not None:
                    raise LawError(
                        f"plan {plan.number}: vehicle {plan.vehicle_id} was armed for it at "
                        f"{armed_s:.1f} s, though it expired at {plan.expires_s:.1f} s"
                    )

    def _armed_late_s(self, truth: Truth, plan: PostedPlan) -> float | None:
        """Give when an aircraft was armed for a plan that had expired and that it had not begun.

        An arming is for the plan whose mission the aircraft has, else for that which it flies next.
        """
        latest_s = plan.expires_s + EXPIRY_S
        armings = [one for one in truth.armings if one.time_s >= plan.posted_s]
        if any(one.time_s <= latest_s and _is_for(one, plan) is not False for one in armings):
            return None
        first_s = min((one.time_s for one in self._facts.flown_by(truth, plan)), default=0.0)
        before = [one.time_s for one in armings if one.time_s <= first_s]
        late = [*before[-1:], *(one.time_s for one in armings if _is_for(one, plan))]
        return next((time_s for time_s in late if time_s > latest_s), None)

    def _mission_end_s(self, plan: PostedPlan) -> float:
        """Give from when on nothing of a mission is flown that has its terminal status.

        A mission that is aborted or fails has its status at once; the vehicle obeys when it can be
        reached.
        """
        status, ended_s = self._ended[plan.number]
        if status is not Status.FINISHED:
            ended_s = max(ended_s, self._facts.connected_since_s(plan.vehicle_id))
        return ended_s + ENDED_MISSION_S

    def note_pauses(self) -> None:
        """Note which missions stand still since which event, while the edge server is up."""
        states = self._world.edge.states()
        for pause in self._operator.pauses:
            if pause.resumed_s is not None or pause.number in self._paused:
                continue
            event = self._facts.read(f"/events/{pause.number}", f"event {pause.number}", states)
            if event is not None and event["state"] == "done":
                running = [
                    plan
                    for plan, mission in self._facts.missions()
                    if plan.vehicle_id == pause.vehicle_id
                    and mission["mission_status_id"] == Status.RUNNING
                ]
                self._paused[pause.number] = self._world.scheduler.now_s, running

    def _nothing_flown_while_paused(self) -> None:
        """A mission that an event has paused stands still until somebody resumes it."""
        for pause in self._operator.pauses:
            since_s, plans = self._paused.get(pause.number, (math.inf, []))
            for plan in plans:
                for one in self._facts.flown(plan):
                    if since_s < one.time_s < (pause.resumed_s or math.inf):
                        raise LawError(
                            f"plan {plan.number}: a waypoint is flown at {one.time_s:.1f} s, "
                            f"though event {pause.number} has paused it by {since_s:.1f} s"
                        )

    def check_end(self) -> None:
        """Check that what is reported as finished was flown, or taken.

        Raises:
            LawError: if it was not.
        """
        for plan, mission in self._facts.missions():
            for command in mission["command_array"]:
                is_finished = command.get("command_status_id") == Status.FINISHED
                if is_finished and not self._was_done(plan, command["command_id"]):
                    raise LawError(
                        f"plan {plan.number}: command {command['command_id']} is FINISHED and "
                        f"was not flown"
                    )

            cut = list(self._cut_though_flown(plan, mission))
            if len(cut) > 1:  # The first one may have ended in the moment of the order
                raise LawError(
                    f"plan {plan.number}: commands {cut} are ABORTED and were flown before that"
                )

    def _cut_though_flown(self, plan: PostedPlan, mission: Mapping[str, Any]) -> Iterator[int]:
        """Give the waypoints of an aborted flight that were flown and are reported as cut off.

        Without its first command it did not begin: what was flown belongs to another plan with
        the same places.
        """
        has_begun = mission["command_array"][0].get("command_status_id") == Status.FINISHED
        is_aborted = mission.get("message") in REASONS.values()
        if not has_begun or not is_aborted or MAY_BE_FLOWN in str(mission):
            return
        for command in mission["command_array"]:
            place = plan.commands.waypoints.get(command["command_id"])
            is_cut = command.get("command_status_id") == Status.ABORTED
            flown = self._facts.flown(plan) if is_cut else []
            if place is not None and any(is_at(one, place) for one in flown):
                yield command["command_id"]

    def _was_done(self, plan: PostedPlan, command_id: int) -> bool:
        """Whether a command was carried out, by truth; one without a place counts as done."""
        planned = plan.commands
        place, centre = planned.waypoints.get(command_id), planned.circles.get(command_id)
        if command_id in planned.pictures:
            return self._pictures.has_taken(plan, command_id)
        if command_id in planned.subjects:
            return self._pictures.has_tracked(plan, command_id)
        if centre is not None:
            return any(
                _turned_rad(truth.turned_rad, centre) > LEAST_TURN_RAD
                for truth in self._world.truths(plan.vehicle_id)
            )
        return place is None or any(is_at(one, place) for one in self._facts.flown(plan))


def _turned_rad(turned_rad: dict[tuple[int, int], float], centre: tuple[int, int]) -> float:
    """Give the angle flown round a centre, which may have been rounded otherwise."""
    return sum(angle_rad for place, angle_rad in turned_rad.items() if is_same_place(place, centre))


def _is_for(arming: Arming, plan: PostedPlan) -> bool | None:
    """Whether a vehicle had the mission of a plan when it was armed; None if nothing shows that."""
    if not arming.places_e7:
        return None
    places = plan.commands.waypoints.values()
    return any(is_same_place(one, other) for one in arming.places_e7 for other in places)
