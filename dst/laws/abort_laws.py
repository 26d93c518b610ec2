"""What must hold of aborts: one that was accepted ends what was posted before it."""

import math
from collections.abc import Iterator
from typing import Final

from dst.actors.operator_person import Operator, PostedAbort
from dst.laws.facts import Facts, LawError
from dst.laws.mission_laws import ENDED_MISSION_S
from dst.vehicles.autopilot import Mode
from dst.world.world import World

ABORT_S: Final = 20.0
"""A vehicle that is connected has left its mission within this time after an abort is accepted."""


class AbortLaws:
    """Watches the aborts of a world."""

    def __init__(self, world: World, operator: Operator, facts: Facts) -> None:
        self._world = world
        self._operator = operator
        self._facts = facts
        self._ended: dict[int, tuple[str, float]] = {}  # By number: state, when
        self._accepted_s: dict[int, float] = {}  # By number of the abort, as it was seen

    def open(self) -> list[str]:
        """Give the aborts that have not ended."""
        return [
            f"abort {abort.number} is {state}"
            for abort, state in self._open_aborts()
            if state in {"queued", "accepted"}
        ]

    def note(self) -> None:
        """Note how the aborts stand, while the edge server is up."""
        now_s = self._world.scheduler.now_s
        for abort, state in self._open_aborts():
            if state == "accepted":
                self._accepted_s.setdefault(abort.number, now_s)
            elif state != "queued":
                self._ended[abort.number] = state, now_s

    def check(self) -> None:
        """Check that an abort that was accepted ends the missions that were posted before it.

        Raises:
            LawError: if a vehicle flies on.
        """
        for abort in self._operator.aborts:
            ended_s = self._abort_end_s(abort)
            is_due = not abort.waits and self._world.scheduler.now_s > ended_s
            if is_due and self._flies_on(abort):
                mode = self._world.vehicles[abort.vehicle_id].mode.name
                raise LawError(
                    f"vehicle {abort.vehicle_id} flies on in {mode}, though abort {abort.number} "
                    f"has ended its mission by {ended_s:.1f} s"
                )
            for plan in self._operator.plans:
                is_meant = plan.vehicle_id == abort.vehicle_id and plan.posted_s < abort.posted_s
                for one in self._facts.flown(plan) if is_meant else ():
                    if one.time_s > ended_s:
                        raise LawError(
                            f"plan {plan.number}: a waypoint is flown at {one.time_s:.1f} s, "
                            f"though abort {abort.number} has ended it by {ended_s:.1f} s"
                        )

    def _flies_on(self, abort: PostedAbort) -> bool:
        """Whether a vehicle flies what was posted before an abort, as it has nothing newer."""
        vehicle = self._world.vehicles[abort.vehicle_id]
        has_newer = any(
            plan.vehicle_id == abort.vehicle_id and plan.posted_s > abort.posted_s
            for plan in self._operator.plans
        )
        is_flown = vehicle.mode in {Mode.MISSION, Mode.FOLLOW, Mode.ORBIT}
        return vehicle.is_flying and is_flown and not has_newer

    def _abort_end_s(self, abort: PostedAbort) -> float:
        """Give from when on nothing older is flown.

        A broker that cannot reach the vehicle carries an abort out later, also after a restart; an
        abort of a vehicle that was restarted on the ground is refused.
        """
        system = abort.vehicle_id
        state, ended_s = self._ended.get(abort.number, ("", math.inf))
        if any(self._replaces(other, abort) for other in self._operator.aborts):
            ended_s = max(ended_s, self._facts.connected_since_s(system))
        done_s = ended_s + ENDED_MISSION_S if state == "done" else math.inf
        accepted_s = self._accepted_s.get(abort.number, math.inf)
        if abort.waits or self._world.vehicles[system].booted_at_s > abort.posted_s:
            return done_s
        known_s = max(accepted_s, self._facts.connected_since_s(system))
        if self._world.broker.may_lack_records or system in self._world.twinned:
            known_s = max(
                known_s, self._facts.edge_trouble_s
            )  # It hears of it again by the edge server
        return min(done_s, known_s + ABORT_S)

    @staticmethod
    def _replaces(other: PostedAbort, abort: PostedAbort) -> bool:
        """Whether a later abort is carried out instead of one, which is done by that."""
        return other.vehicle_id == abort.vehicle_id and other.number > abort.number

    def _open_aborts(self) -> Iterator[tuple[PostedAbort, str]]:
        """Give each abort that had not ended when it was last looked at, with its state."""
        states = self._world.edge.states()
        for abort in self._operator.aborts:
            if abort.number in self._ended:
                continue
            known = self._facts.read(f"/events/{abort.number}", f"abort {abort.number}", states)
            if known is None:
                return
            yield abort, known["state"]
