"""The laws of a world: what must hold whatever fails. See the documentation for how to write one.

LawError  a law is broken
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from http import HTTPStatus
from typing import Any, Final

from afarcloud.enumerations import Status
from dst.actors.operator_person import Operator, PostedAbort, PostedPlan
from dst.actors.plans import FENCE_M, HIGHEST_M
from dst.laws.delivery_laws import DeliveryLaws
from dst.laws.event_laws import EventLaws
from dst.laws.link_laws import LinkLaws
from dst.laws.picture_laws import PictureLaws
from dst.laws.pilot_laws import PilotLaws
from dst.vehicles.autopilot import Mode
from dst.vehicles.flight import SINK_M_S, Arming, Reached, Truth, is_same_place
from dst.vehicles.vehicle import Vehicle
from dst.world.edge_process import EdgeDownError
from dst.world.world import World
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import MAX_STATE_VECTORS, Post
from mavlink_broker.mission.abort_executor import REASONS
from mavlink_broker.mission.phases.ending import MAY_BE_FLOWN

CHECK_PERIOD_S: Final = 10.0
BREAK_CHECK_PERIOD_S: Final = 600.0
"""While every vehicle is switched off."""
ENDED_MISSION_S: Final = 10.0
"""After its terminal status nothing of a mission is flown any more within this time."""

ALARM_S: Final = 30.0
"""After a failure, the edge server has the alarm within this time."""
SETTLED_S: Final = 20.0
"""A broker that has reached a vehicle for so long knows all of its messages."""
MOST_WAITING: Final = MAX_STATE_VECTORS + 1000
"""Posts: state vectors are thinned out at their limit, the others are few."""
LEAST_TURN_RAD: Final = 0.65 * math.tau
"""The broker takes a turn for complete from 0.7 on, by positions that it has received."""
EXPIRY_S: Final = 5.0
"""An order to arm that was sent before a plan expired arrives within this time."""
ABORT_S: Final = 20.0
"""A vehicle that is connected has left its mission within this time after an abort is accepted."""


class LawError(Exception):
    """A law is broken."""


class Laws:
    """Watches a world; `check` is called while it runs, `check_end` when everything is quiet."""

    def __init__(self, world: World, operator: Operator) -> None:
        self._world = world
        self._operator = operator
        self._ended: dict[int, tuple[Status, float]] = {}  # By plan: first terminal status, when
        self._invalid: list[str] = []
        self._unforeseen: list[str] = []  # Posts that the edge server has answered with 500
        self._alarms_s: dict[int, list[float]] = defaultdict(list)  # By vehicle: when acknowledged
        self._edge_trouble_s = 0.0  # When the edge server was last seen out of the broker's reach
        self._paused: dict[int, tuple[float, list[PostedPlan]]] = {}  # By event: when, what flew
        self._ended_aborts: dict[int, tuple[str, float]] = {}  # By number: state, when
        self._accepted_s: dict[int, float] = {}  # By number of the abort, as it was seen
        self._read_before: dict[str, tuple[object, Any]] = {}  # By path: its state then, the answer
        self._deliveries = DeliveryLaws(world, operator)
        self._pictures = PictureLaws(world, operator)
        self._links = LinkLaws(world)
        self._pilots = PilotLaws(world, operator)
        self._events = EventLaws(world, operator)
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
        self._deliveries.taken(post, answer)
        self._pictures.taken(post, answer)
        disk = self._world.edge_machine.disk
        if answer.status_code == HTTPStatus.INTERNAL_SERVER_ERROR and not disk.is_read_only:
            self._unforeseen.append(f"{post.method} {post.path} {post.body}")
        is_invalid = answer.status_code in {HTTPStatus.BAD_REQUEST, HTTPStatus.UNPROCESSABLE_ENTITY}
        if is_invalid and not post.may_be_duplicate:
            self._invalid.append(f"{post.path} {post.body}: {answer.body.decode()}")
        if post.path == "/alarm/" and answer.status_code == HTTPStatus.CREATED:
            self._alarms_s[post.vehicle_id].append(self._world.scheduler.now_s)

    # While it runs.

    def check(self) -> None:
        """Check the laws that hold at any time.

        Raises:
            LawError: if one is broken.
        """
        self._nothing_invalid()
        if not (self._world.edge.is_up and self._world.http.is_perfect):
            self._edge_trouble_s = self._world.scheduler.now_s
        if self._world.edge.is_up:
            self._one_terminal_status()
            self._note_aborts()
            self._note_pauses()
        self._nothing_flown_afterwards()
        self._nothing_begun_after_expiry()
        self._nothing_flown_while_paused()
        self._alarms_in_time()
        self._queues_are_bounded()
        self._flights_are_safe()
        self._no_internal_error()
        self._no_database_was_damaged()
        self._nothing_flown_after_abort()
        stored_twice = self._deliveries.stored_twice()
        of_vehicles = (*self._pilots.broken(), *self._links.broken())
        for broken in (*stored_twice, *self._pictures.broken, *of_vehicles):
            raise LawError(broken)

    def _nothing_invalid(self) -> None:
        """The broker reports nothing that the edge server has to refuse for its content."""
        if self._invalid:
            raise LawError(f"the edge server refuses {self._invalid[0]}")

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
                ends.append(self._mission_end_s(plan))
            for one in self._flown(plan):
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
        first_s = min((one.time_s for one in self._flown_by(truth, plan)), default=0.0)
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
            ended_s = max(ended_s, self._connected_since_s(plan.vehicle_id))
        return ended_s + ENDED_MISSION_S

    def _connected_since_s(self, system: int) -> float:
        """Give since when the broker can reach a vehicle; infinite while it cannot."""
        world = self._world
        is_linked = world.up[system].is_up and world.down[system].is_up
        is_connected = world.broker.is_running and is_linked
        return world.connected_s[system] if is_connected else math.inf

    def _nothing_flown_after_abort(self) -> None:
        """An abort that was accepted ends the missions that were posted before it."""
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
                for one in self._flown(plan) if is_meant else ():
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

    def _note_pauses(self) -> None:
        """Note which missions stand still since which event."""
        states = self._world.edge.states()
        for pause in self._operator.pauses:
            if pause.resumed_s is not None or pause.number in self._paused:
                continue
            event = self._read(f"/events/{pause.number}", f"event {pause.number}", states)
            if event is not None and event["state"] == "done":
                running = [
                    plan
                    for plan, mission in self._missions()
                    if plan.vehicle_id == pause.vehicle_id
                    and mission["mission_status_id"] == Status.RUNNING
                ]
                self._paused[pause.number] = self._world.scheduler.now_s, running

    def _nothing_flown_while_paused(self) -> None:
        """A mission that an event has paused stands still until somebody resumes it."""
        for pause in self._operator.pauses:
            since_s, plans = self._paused.get(pause.number, (math.inf, []))
            for plan in plans:
                for one in self._flown(plan):
                    if since_s < one.time_s < (pause.resumed_s or math.inf):
                        raise LawError(
                            f"plan {plan.number}: a waypoint is flown at {one.time_s:.1f} s, "
                            f"though event {pause.number} has paused it by {since_s:.1f} s"
                        )

    def _alarms_in_time(self) -> None:
        """The edge server knows of a motor failure soon, if link and edge server can take it."""
        world, now_s = self._world, self._world.scheduler.now_s
        troubled_s = max(self._edge_trouble_s, world.edge.disk.troubled_s)
        for system, vehicle in world.vehicles.items():
            truth, known_s = vehicle.truth, self._alarms_s[system]
            connected_s = max(self._connected_since_s(system), vehicle.booted_at_s)
            for failed_s in list(truth.motor_failures_s):
                if now_s < failed_s + ALARM_S:
                    continue
                truth.motor_failures_s.remove(failed_s)
                is_judged = troubled_s < failed_s > connected_s + SETTLED_S
                is_known = any(failed_s <= one <= failed_s + ALARM_S for one in known_s)
                if is_judged and not is_known:
                    raise LawError(f"vehicle {system}: no alarm of the motor at {failed_s:.1f} s")

    def _queues_are_bounded(self) -> None:
        """What waits in the broker is bounded: each vehicle has a few posts, all are spooled."""
        client = self._world.broker.client
        waiting = 0 if client is None else client.waiting
        if waiting > MOST_WAITING:
            raise LawError(f"{waiting} posts wait in the broker")

    def _flights_are_safe(self) -> None:
        """No vehicle leaves the place of its plans, or comes down hard; falls are not judged."""
        for system, vehicle in self._world.vehicles.items():
            truth = vehicle.truth
            if truth.furthest_m > FENCE_M or truth.highest_m > HIGHEST_M:
                where = f"{truth.furthest_m:.1f} m from home, up to {truth.highest_m:.1f} m"
                raise LawError(f"vehicle {system} has left its fence: {where}")
            if truth.hardest_m_s > SINK_M_S:
                raise LawError(f"vehicle {system} has come down at {truth.hardest_m_s:.1f} m/s")

    def _no_internal_error(self) -> None:
        """No program meets an error that it has not foreseen."""
        app = self._world.broker.app
        if app is not None and app.internal_errors.count:
            now_s = self._world.broker.clock.monotonic()
            owners = [f"vehicle {system}" for system in self._world.vehicles]
            texts = [app.internal_errors.warning(owner, now_s) for owner in owners]
            raise LawError(f"{app.internal_errors.count} internal errors of the broker: {texts}")
        if self._unforeseen:
            raise LawError(f"internal error of the edge server: {self._unforeseen[0]}")

    def _abort_end_s(self, abort: PostedAbort) -> float:
        """Give from when on nothing older is flown.

        A broker that cannot reach the vehicle carries an abort out later, also after a restart; an
        abort of a vehicle that was restarted on the ground is refused.
        """
        system = abort.vehicle_id
        state, ended_s = self._ended_aborts.get(abort.number, ("", math.inf))
        if any(self._replaces(other, abort) for other in self._operator.aborts):
            ended_s = max(ended_s, self._connected_since_s(system))
        done_s = ended_s + ENDED_MISSION_S if state == "done" else math.inf
        accepted_s = self._accepted_s.get(abort.number, math.inf)
        if abort.waits or self._world.vehicles[system].booted_at_s > abort.posted_s:
            return done_s
        known_s = max(accepted_s, self._connected_since_s(system))
        if self._world.broker.may_lack_records or system in self._world.twinned:
            known_s = max(known_s, self._edge_trouble_s)  # It hears of it again by the edge server
        return min(done_s, known_s + ABORT_S)

    @staticmethod
    def _replaces(other: PostedAbort, abort: PostedAbort) -> bool:
        """Whether a later abort is carried out instead of one, which is done by that."""
        return other.vehicle_id == abort.vehicle_id and other.number > abort.number

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
        found += self._borrowed()
        found += self._pictures.missing()
        found += self._events.open()
        waiting = world.broker.client.waiting if world.broker.client is not None else 0
        found += [f"{waiting} posts of the broker wait"] if waiting > 3 else []
        found += list(world.http.owed.texts.values())
        found += self._deliveries.missing()
        return found

    def _borrowed(self) -> list[str]:
        """Give what a vehicle of which there is one alone has not got back."""
        if self._world.broker.may_lack_records:
            return []
        found = []
        for system, vehicle in self._world.vehicles.items():
            if system in self._world.twinned:
                continue
            borrowed = vehicle.parameters.items() - vehicle.autopilot.parameters.items()
            found += [f"vehicle {system} has borrowed {one}" for one in sorted(borrowed)]
            if isinstance(vehicle, Vehicle) and vehicle.has_fence:
                found.append(f"vehicle {system} has a borrowed geofence")
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
        self._read_before.clear()
        self._status_agrees_with_truth()
        for broken in self._deliveries.delivered_wrongly():
            raise LawError(broken)

    def _status_agrees_with_truth(self) -> None:
        """What is reported as finished was flown, or taken."""
        for plan, mission in self._missions():
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
            if is_cut and any(_is_at(one, place) for one in self._flown(plan) if place is not None):
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
        return place is None or any(_is_at(one, place) for one in self._flown(plan))

    def _no_database_was_damaged(self) -> None:
        """No loss of power has damaged a database: none was set aside at a start."""
        world = self._world
        quarantine = world.edge.config.database_path.parent / "quarantine"
        damaged = [*quarantine.glob("*"), *world.broker_machine.disk.folder.glob("*.bad")]
        if damaged:
            raise LawError(f"a database was set aside as {damaged[0].name}")

    # Facts.

    def _missions(self) -> Iterator[tuple[PostedPlan, dict[str, Any]]]:
        """Give each plan that was not cancelled with its mission as the edge server shows it."""
        states = self._world.edge.states()
        for plan in self._operator.plans:
            if plan.cancelled_s is not None:
                continue
            known = self._read(f"/plans/{plan.number}", f"plan {plan.number}", states)
            if known is None:
                return
            yield plan, known["missions"][0]

    def _open_aborts(self) -> Iterator[tuple[PostedAbort, str]]:
        """Give each abort that had not ended when it was last looked at, with its state."""
        states = self._world.edge.states()
        for abort in self._operator.aborts:
            if abort.number in self._ended_aborts:
                continue
            known = self._read(f"/events/{abort.number}", f"abort {abort.number}", states)
            if known is None:
                return
            yield abort, known["state"]

    def _read(self, path: str, what: str, states: Mapping[str, object]) -> Any:
        """Read what the edge server has acknowledged; None while it or its disk cannot be used.

        What was read before is taken as long as its state is the same.

        Raises:
            LawError: if it is not there.
        """
        state = states.get(path)
        if state is not None and self._read_before.get(path, (None, None))[0] == state:
            return self._read_before[path][1]
        try:
            response = self._world.request("GET", path)
        except EdgeDownError:
            return None
        if response.status == HTTPStatus.NOT_FOUND:
            raise LawError(f"{what} was acknowledged and is lost")
        if response.status != HTTPStatus.OK:
            return None
        self._read_before[path] = state, response.json()
        return self._read_before[path][1]

    def _flown(self, plan: PostedPlan) -> list[Reached]:
        """Give what was flown of a plan, by whichever aircraft with its system id."""
        truths = self._world.truths(plan.vehicle_id)
        return [one for truth in truths for one in self._flown_by(truth, plan)]

    @staticmethod
    def _flown_by(truth: Truth, plan: PostedPlan) -> list[Reached]:
        """Give what one aircraft has flown of a plan."""
        places = plan.commands.waypoints.values()
        return [one for one in truth.reached if any(_is_at(one, place) for place in places)]


def _turned_rad(turned_rad: dict[tuple[int, int], float], centre: tuple[int, int]) -> float:
    """Give the angle flown round a centre, which may have been rounded otherwise."""
    return sum(angle_rad for place, angle_rad in turned_rad.items() if is_same_place(place, centre))


def _is_for(arming: Arming, plan: PostedPlan) -> bool | None:
    """Whether a vehicle had the mission of a plan when it was armed; None if nothing shows that."""
    if not arming.places_e7:
        return None
    places = plan.commands.waypoints.values()
    return any(is_same_place(one, other) for one in arming.places_e7 for other in places)


def _is_at(reached: Reached, place: tuple[int, int]) -> bool:
    return is_same_place((reached.latitude_e7, reached.longitude_e7), place)
