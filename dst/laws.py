"""The laws of a world: what must hold whatever fails. See the documentation for how to write one.

LawError  a law is broken
"""

import json
import math
from collections import Counter, defaultdict
from collections.abc import Iterator
from typing import Any, Final

from afarcloud.enumerations import Status
from dst.edge_process import EdgeDownError
from dst.operator_person import Operator, PostedAbort, PostedPlan
from dst.vehicle import Reached
from dst.world import World
from edge_server.outbox.queue import Stream
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post

CHECK_PERIOD_S: Final = 10.0
BREAK_CHECK_PERIOD_S: Final = 600.0
"""While every vehicle is switched off."""
ENDED_MISSION_S: Final = 10.0
"""After its terminal status nothing of a mission is flown any more within this time."""
TAKEOVER_S: Final = 15.0
"""The broker has noticed a pilot within this time on a link that is up."""

ABORT_S: Final = 20.0
"""A vehicle that is connected has left its mission within this time after an abort is accepted."""


class LawError(Exception):
    """A law is broken."""


class Laws:
    """Watches a world; `check` is called while it runs, `check_end` when everything is quiet."""

    def __init__(self, world: World, operator: Operator) -> None:
        self._world = world
        self._operator = operator
        self._acknowledged: dict[tuple[str, int], str] = {}
        self._ids_of_key: dict[str, set[int]] = defaultdict(set)
        self._ended: dict[int, tuple[Status, float]] = {}  # By plan: first terminal status, when
        self._ended_aborts: dict[int, tuple[str, float]] = {}  # By number: state, when
        self._accepted_s: dict[int, float] = {}  # By number of the abort, as it was seen
        self.period_s = CHECK_PERIOD_S
        world.http.on_taken = self._taken
        self._check_again()

    def _check_again(self) -> None:
        self._world.scheduler.after(self.period_s, self._check_again)
        self.check()

    def _taken(self, post: Post, answer: Answer) -> None:
        """Note what the edge server has acknowledged to the broker, and who has accepted what."""
        if post.is_acceptance:
            self._note_aborts()
        if post.method != "POST" or answer.status_code >= 300 or post.idempotency_key is None:
            return
        number = json.loads(answer.body).get("id")
        if number is not None:
            self._acknowledged[post.path.strip("/"), number] = post.idempotency_key
            self._ids_of_key[post.idempotency_key].add(number)

    # While it runs.

    def check(self) -> None:
        """Check the laws that hold at any time.

        Raises:
            LawError: if one is broken.
        """
        self._no_order_under_pilot()
        self._nothing_under_two_ids()
        if self._world.edge.is_up:
            self._one_terminal_status()
            self._note_aborts()
        self._nothing_flown_afterwards()
        self._nothing_flown_after_abort()

    def _no_order_under_pilot(self) -> None:
        """Nobody commands a vehicle that a pilot has taken."""
        for system, vehicle in self._world.vehicles.items():
            connected_s = self._world.connected_s[system]
            for order in vehicle.truth.orders_under_pilot:
                known_s = order.time_s - max(order.pilot_since_s, connected_s)
                if known_s > TAKEOVER_S:
                    raise LawError(
                        f"vehicle {system}: {order.name} at {order.time_s:.1f} s, under a pilot "
                        f"since {order.pilot_since_s:.1f} s"
                    )
            vehicle.truth.orders_under_pilot.clear()

    def _nothing_under_two_ids(self) -> None:
        """A request that is repeated is stored once."""
        for key, numbers in self._ids_of_key.items():
            if len(numbers) > 1:
                raise LawError(f"key {key} is stored as {sorted(numbers)}")
        if self._operator.double_ids:
            raise LawError("; ".join(self._operator.double_ids))

    def _one_terminal_status(self) -> None:
        """A mission that has ended keeps its terminal status."""
        for plan, mission in self._missions():
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
                ends.append(self._ended[plan.number][1] + ENDED_MISSION_S)
            for one in self._flown(plan):
                if ends and one.time_s > min(ends):
                    raise LawError(
                        f"plan {plan.number}: a waypoint is flown at {one.time_s:.1f} s, "
                        f"though it ended at {min(ends):.1f} s"
                    )

    def _nothing_flown_after_abort(self) -> None:
        """An abort that was accepted ends the missions that were posted before it."""
        for abort in self._operator.aborts:
            ended_s = self._abort_end_s(abort)
            for plan in self._operator.plans:
                is_meant = plan.vehicle_id == abort.vehicle_id and plan.posted_s < abort.posted_s
                for one in self._flown(plan) if is_meant else ():
                    if one.time_s > ended_s:
                        raise LawError(
                            f"plan {plan.number}: a waypoint is flown at {one.time_s:.1f} s, "
                            f"though abort {abort.number} has ended it by {ended_s:.1f} s"
                        )

    def _abort_end_s(self, abort: PostedAbort) -> float:
        """Give from when on nothing older is flown.

        A broker that cannot reach the vehicle carries an abort out later, also after a restart; an
        abort of a vehicle that was restarted on the ground is refused.
        """
        world, system = self._world, abort.vehicle_id
        state, ended_s = self._ended_aborts.get(abort.number, ("", math.inf))
        done_s = ended_s + ENDED_MISSION_S if state == "done" else math.inf
        accepted_s = self._accepted_s.get(abort.number, math.inf)
        is_connected = world.broker.is_up and world.up[system].is_up and world.down[system].is_up
        if abort.waits or not is_connected or world.vehicles[system].booted_at_s > abort.posted_s:
            return done_s
        return min(done_s, max(accepted_s, world.connected_s[system]) + ABORT_S)

    def _note_aborts(self) -> None:
        now_s = self._world.scheduler.now_s
        for abort, state in self._open_aborts():
            if state == "accepted":
                self._accepted_s.setdefault(abort.number, now_s)
            elif state != "queued":
                self._ended_aborts[abort.number] = state, now_s

    # When everything is quiet.

    def open_matters(self) -> list[str]:
        """Give what still has to happen after the faults have stopped."""
        world = self._world
        found = [
            f"plan {plan.number} is {Status(mission['mission_status_id']).name}"
            for plan, mission in self._missions()
            if not Status(mission["mission_status_id"]).is_terminal
        ]
        found += [
            f"abort {abort.number} is {state}"
            for abort, state in self._open_aborts()
            if state in {"queued", "accepted"}
        ]
        found += [f"vehicle {one.system} is armed" for one in world.vehicles.values() if one.armed]
        waiting = world.broker.client.waiting if world.broker.client is not None else 0
        found += [f"{waiting} posts of the broker wait"] if waiting > 3 else []
        missing = set(self._acknowledged) - self._delivered()
        kinds = Counter(kind for kind, _ in missing if kind != "state_vector")
        found += [f"the cloud lacks {count} of {kind}" for kind, count in kinds.items()]
        return found

    def check_end(self) -> None:
        """Check what must hold when everything is quiet.

        Raises:
            LawError: if a law is broken, or something has not happened.
        """
        self.check()
        matters = self.open_matters()
        if matters:
            raise LawError(f"not within the time after the faults: {'; '.join(matters)}")
        self._status_agrees_with_truth()
        self._delivered_under_one_id()
        self._delivered_in_order()

    def _status_agrees_with_truth(self) -> None:
        """A waypoint that is reported as finished was flown."""
        for plan, mission in self._missions():
            flown = self._flown(plan)
            for command in mission["command_array"]:
                place = plan.waypoints.get(command["command_id"])
                status = command.get("command_status_id")
                is_flown = place is not None and any(_is_at(one, place) for one in flown)
                if place is not None and status == Status.FINISHED and not is_flown:
                    raise LawError(
                        f"plan {plan.number}: command {command['command_id']} is FINISHED and "
                        f"was not flown"
                    )

    def _delivered_under_one_id(self) -> None:
        """The cloud has each record under one message id."""
        ids: dict[tuple[str, str], set[str]] = defaultdict(set)
        for message_id, record in self._world.cloud.received.items():
            content = json.loads(record.payload)
            content.pop("message_id", None)
            text = json.dumps(content, sort_keys=True)
            ids[record.stream.kind, text].add(message_id)
        for (kind, text), found in ids.items():
            if len(found) > 1:
                raise LawError(f"the cloud has one {kind} under {len(found)} ids: {text}")

    def _delivered_in_order(self) -> None:
        """The cloud has received the records of each stream in the order of the outbox."""
        newest: dict[Stream, int] = {}
        for record in self._world.cloud.received.values():
            before = newest.get(record.stream, 0)
            if record.outbox_id < before:
                raise LawError(f"the cloud has {record.stream} {record.outbox_id} after {before}")
            newest[record.stream] = record.outbox_id

    # Facts.

    def _missions(self) -> Iterator[tuple[PostedPlan, dict[str, Any]]]:
        """Give each plan that was not cancelled with its mission as the edge server shows it."""
        for plan in self._operator.plans:
            if plan.cancelled_s is not None:
                continue
            try:
                response = self._world.request("GET", f"/plans/{plan.number}")
            except EdgeDownError:
                return
            if response.status != 200:
                raise LawError(f"plan {plan.number} was acknowledged and is lost")
            yield plan, response.json()["missions"][0]

    def _open_aborts(self) -> Iterator[tuple[PostedAbort, str]]:
        """Give each abort that had not ended when it was last looked at, with its state."""
        for abort in self._operator.aborts:
            if abort.number in self._ended_aborts:
                continue
            try:
                response = self._world.request("GET", f"/events/{abort.number}")
            except EdgeDownError:
                return
            if response.status != 200:
                raise LawError(f"abort {abort.number} was acknowledged and is lost")
            yield abort, response.json()["state"]

    def _delivered(self) -> set[tuple[str, int]]:
        records = self._world.cloud.received.values()
        return {(record.stream.kind, record.record_id) for record in records}

    def _flown(self, plan: PostedPlan) -> list[Reached]:
        reached = self._world.vehicles[plan.vehicle_id].truth.reached
        places = plan.waypoints.values()
        return [one for one in reached if any(_is_at(one, place) for place in places)]


def _is_at(reached: Reached, place: tuple[int, int]) -> bool:
    latitude, longitude = place
    return abs(reached.latitude_e7 - latitude) <= 2 and abs(reached.longitude_e7 - longitude) <= 2
