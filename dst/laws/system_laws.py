"""All laws of a world: what must hold whatever fails; and those of alarms, flights and programs."""

from collections import defaultdict
from http import HTTPStatus
from typing import Final

from dst.actors.operator_person import Operator
from dst.actors.plans import FENCE_M, HIGHEST_M
from dst.laws.abort_laws import AbortLaws
from dst.laws.delivery_laws import DeliveryLaws
from dst.laws.event_laws import EventLaws
from dst.laws.facts import Facts, LawError
from dst.laws.link_laws import LinkLaws
from dst.laws.mission_laws import MissionLaws
from dst.laws.picture_laws import PictureLaws
from dst.laws.pilot_laws import PilotLaws
from dst.vehicles.flight import SINK_M_S
from dst.vehicles.vehicle import Vehicle
from dst.world.world import World
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import MAX_STATE_VECTORS, Post

CHECK_PERIOD_S: Final = 10.0
BREAK_CHECK_PERIOD_S: Final = 600.0
"""While every vehicle is switched off."""
ALARM_S: Final = 30.0
"""After a failure, the edge server has the alarm within this time."""
SETTLED_S: Final = 20.0
"""A broker that has reached a vehicle for so long knows all of its messages."""
MOST_WAITING: Final = MAX_STATE_VECTORS + 1000
"""Posts: state vectors are thinned out at their limit, the others are few."""


class Laws:
    """Watches a world; `check` is called while it runs, `check_end` when everything is quiet."""

    def __init__(self, world: World, operator: Operator) -> None:
        self._world = world
        self._operator = operator
        self._invalid: list[str] = []
        self._unforeseen: list[str] = []  # Posts that the edge server has answered with 500
        self._alarms_s: dict[int, list[float]] = defaultdict(list)  # By vehicle: when acknowledged
        self._deliveries = DeliveryLaws(world, operator)
        self._pictures = PictureLaws(world, operator)
        self._facts = Facts(world, operator)
        self._missions = MissionLaws(world, operator, self._facts, self._pictures)
        self._aborts = AbortLaws(world, operator, self._facts)
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
            self._aborts.note()
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
        self._facts.note_edge_trouble()
        if self._world.edge.is_up:
            self._missions.note_ends()
            self._aborts.note()
            self._missions.note_pauses()
        self._missions.check()
        self._alarms_in_time()
        self._queues_are_bounded()
        self._flights_are_safe()
        self._no_internal_error()
        self._no_database_was_damaged()
        self._aborts.check()
        stored_twice = self._deliveries.stored_twice()
        of_vehicles = (*self._pilots.broken(), *self._links.broken())
        for broken in (*stored_twice, *self._pictures.broken, *of_vehicles):
            raise LawError(broken)

    def _nothing_invalid(self) -> None:
        """The broker reports nothing that the edge server has to refuse for its content."""
        if self._invalid:
            raise LawError(f"the edge server refuses {self._invalid[0]}")

    def _alarms_in_time(self) -> None:
        """The edge server knows of a motor failure soon, if link and edge server can take it."""
        world, now_s = self._world, self._world.scheduler.now_s
        troubled_s = max(self._facts.edge_trouble_s, world.edge.disk.troubled_s)
        for system, vehicle in world.vehicles.items():
            truth, known_s = vehicle.truth, self._alarms_s[system]
            connected_s = max(self._facts.connected_since_s(system), vehicle.booted_at_s)
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

    # When everything is quiet.

    def open_matters(self) -> list[str]:
        """Give what still has to happen after the faults have stopped."""
        world = self._world
        found = [*self._missions.open(), *self._aborts.open()]
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
        self._facts.forget()
        self._missions.check_end()
        for broken in self._deliveries.delivered_wrongly():
            raise LawError(broken)

    def _no_database_was_damaged(self) -> None:
        """No loss of power has damaged a database: none was set aside at a start."""
        world = self._world
        quarantine = world.edge.config.database_path.parent / "quarantine"
        damaged = [*quarantine.glob("*"), *world.broker_machine.disk.folder.glob("*.bad")]
        if damaged:
            raise LawError(f"a database was set aside as {damaged[0].name}")
