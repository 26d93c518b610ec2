"""The broker's loop: receive messages and work, step the sessions, send what they produce.

Clock, sockets and edge server are arguments, so that tests can run a day in a second.

Every call into a session has an error boundary: an exception in one vehicle's session fails the
mission of that vehicle with its reason, is counted and shown, and affects no other vehicle.
"""

import logging
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Final

from mavlink_broker.autopilots.families import ModeRole
from mavlink_broker.config import Config
from mavlink_broker.edge.posts import post_for
from mavlink_broker.edge.work import (
    AcceptanceResult,
    EventWork,
    Inbox,
    MissionWork,
    StateVectorWork,
    WorkError,
)
from mavlink_broker.effects import Acknowledgement, EdgeMessage, Effects
from mavlink_broker.fleet import Edge, Fleet, FleetMember, Jobs, Journal, NoJobs, VehicleRecords
from mavlink_broker.live.tracking import TRACKING_MESSAGES as TRACKED
from mavlink_broker.mavlink.dialect import Message, source_of
from mavlink_broker.mission.states import State
from mavlink_broker.pictures.pictures import PICTURE_MESSAGES
from mavlink_broker.routing.policy import BrokerControl
from mavlink_broker.routing.router import Clock, Link, Router
from mavlink_broker.session import Session
from mavlink_broker.supervision import InternalErrors
from mavlink_broker.vehicle.measurements import OBSERVED
from mavlink_broker.vehicle.vehicle import Vehicle

IDLE_WAIT_S: Final = 0.02
"""Longest wait of the loop, the resolution of timeouts. Datagrams and work end it at once."""
SWEEP_INTERVAL_S: Final = 10.0
STEP_ALL_INTERVAL_S: Final = 0.015
"""In between only vehicles with new messages are stepped: twenty send 500 messages a second."""
PAYLOAD_MESSAGES: Final = (
    frozenset({"COMMAND_ACK", "HEARTBEAT"}) | OBSERVED | PICTURE_MESSAGES | TRACKED
)
"""Messages that are taken from a vehicle's other components, such as its camera."""

MAX_WARNING_CHARACTERS: Final = 255
"""Longest warning that the edge server accepts."""
MAX_WAITING_PICTURES: Final = 8
"""With so many unanswered none is fetched: pictures are safer on the vehicle than in memory."""

STARTUP_S: Final = 30.0
"""A restarted broker has received its unfinished missions by then."""
FLYING: Final = frozenset({ModeRole.MISSION, ModeRole.GUIDED})
TRANSFERS: Final = frozenset(
    {State.ATTACHING, State.PLACING_GEOFENCE, State.UPLOADING, State.VERIFYING, State.SELECTING}
)
"""States in which a mission is uploaded or read back."""

_LOG = logging.getLogger(__name__)


class App:
    """The loop of one broker."""

    def __init__(
        self,
        config: Config,
        link: Link,
        edge: Edge,
        clock: Clock,
        new_ulid: Callable[[], str],
        jobs: Jobs | None = None,
        journal: Journal | None = None,
    ) -> None:
        """Connect the loop to its interfaces.

        Without `jobs` no picture can be fetched over HTTP or converted; without a `journal` a
        killed broker does not restore what it has overridden on its vehicles.
        """
        self._config = config
        self._edge = edge
        self._clock = clock
        self._new_ulid = new_ulid
        self._jobs = jobs or NoJobs()
        self._records = VehicleRecords(journal)
        self._inbox = Inbox()
        self.internal_errors = InternalErrors()
        self._router = Router(config, link, clock, self._control_of, self.internal_errors)
        self._fleet = Fleet(config, self._records, new_ulid)
        self._sweep_at = 0.0
        self._step_all_at = 0.0
        self._started_at = clock.monotonic()

    @property
    def sessions(self) -> dict[int, Session]:
        """Sessions by MAVLink system id."""
        return {member.system: member.session for member in self._fleet}

    def step(self, wait_s: float = IDLE_WAIT_S) -> None:
        """Run the loop once."""
        messages = self._router.receive(wait_s)
        now = self._clock.monotonic()
        for message in messages:
            self._dispatch(message, now)
        work = sorted(self._edge.take_work(), key=_work_id_of)
        for raw in work:
            self._take(raw, now)
        acceptance_results = self._edge.take_acceptance_results()
        for acceptance_result in acceptance_results:
            self._apply_acceptance_result(acceptance_result, now)
        self._records.confirm(self._fleet.session)
        finished = self._jobs.take_finished()
        for system, outcome in finished:
            member = self._fleet.find(system)
            if member is not None:
                self._call(member, now, partial(member.session.pictures.take_outcome, outcome, now))
        if work or acceptance_results or finished or now >= self._step_all_at:
            self._step_all_at = now + STEP_ALL_INTERVAL_S
            self._step(self._fleet, now)
        else:
            senders = {source_of(message).system for message in messages}
            self._step(filter(None, map(self._fleet.find, senders)), now)
        if now >= self._sweep_at:
            self._sweep_at = now + SWEEP_INTERVAL_S
            for system in self._fleet.remove_strangers(now):
                self._router.forget(system)

    def _step(self, members: Iterable[FleetMember], now: float) -> None:
        """Step some vehicles."""
        has_room = self._edge.waiting_pictures < MAX_WAITING_PICTURES
        for member in members:
            member.session.watch(self._router.requested_messages(member.system, now))
            member.session.vehicle.warn(self._warning_of(member, now))
            member.session.pictures.has_room = has_room
            vehicle_id = member.session.vehicle.vehicle_id
            member.session.set_update_interval(self._edge.update_interval_of(vehicle_id))
            self._call(member, now, partial(self._step_session, member.session, now))
            with _ErrorBoundary() as errors:
                member.unsent += member.session.missions.due_for_edge(())
                self._post_when_recorded(member)
            for error in errors:
                self._fail_after_error(member, error, now)

    def _step_session(self, session: Session, now: float, effects: Effects) -> None:
        self._records.recall(session, now, effects)
        session.step(now, effects)

    def close(self) -> None:
        """Post what is pending and close the frame log; the caller closes the links."""
        for member in self._fleet:
            self._post_all(member)
        self._router.close()

    def _call(self, member: FleetMember, now: float, action: Callable[[Effects], object]) -> bool:
        """Call one vehicle's session and apply its effects; false after an error."""
        effects = Effects()
        with _ErrorBoundary() as errors:
            action(effects)
        errors += self._carry_out(effects, member)
        for error in errors[:1]:
            self._fail_after_error(member, error, now)
        return not errors

    def _fail_after_error(self, member: FleetMember, error: Exception, now: float) -> None:
        """Fail the mission in which an unexpected error has occurred; the broker continues.

        If that fails too, the mission is dropped and the session is idle.
        """
        reason = self.internal_errors.record(_owner(member), error, now)
        missions = member.session.missions
        for end in (missions.fail_after_error, missions.drop_after_error):
            effects = Effects()
            with _ErrorBoundary() as errors:
                end(reason, now, effects)
            for another in (*errors, *self._carry_out(effects, member)):
                self.internal_errors.record(_owner(member), another, now)
            if not errors:
                return

    def _warning_of(self, member: FleetMember, now: float) -> str | None:
        """Warning about a vehicle's link, dead letters and internal errors; None without any."""
        dead = self._edge.dead_letters_of(member.session.vehicle.vehicle_id)
        warnings = (
            self._router.warning_of(member.system, now),
            f"{dead} reports could not be delivered: see dead-letters" if dead else None,
            self.internal_errors.warning(_owner(member), now),
        )
        return (
            "; ".join(warning for warning in warnings if warning)[:MAX_WARNING_CHARACTERS] or None
        )

    def _control_of(self, system: int) -> BrokerControl:
        """How the broker uses a vehicle, for ground stations."""
        session = self._fleet.session(system)
        if session is None:
            return BrokerControl.FREE
        state = session.state
        if state is State.IDLE:
            return (
                BrokerControl.MISSION
                if self._may_fly_our_mission(session.vehicle)
                else BrokerControl.FREE
            )
        return BrokerControl.TRANSFER if state in TRANSFERS else BrokerControl.MISSION

    def _may_fly_our_mission(self, vehicle: Vehicle) -> bool:
        """Whether it may fly a mission of an earlier run that is not received again yet."""
        is_settled = self._clock.monotonic() - self._started_at > STARTUP_S
        return not is_settled and vehicle.snapshot.armed is True and vehicle.mode_role in FLYING

    def _dispatch(self, message: Message, now: float) -> None:
        """Pass a message to the session of its vehicle."""
        member = self._fleet.sender_of(message)
        if member is None:
            return
        if source_of(message).component == member.component:
            self._call(member, now, partial(member.session.receive, message, now))
        elif message.get_type() in PAYLOAD_MESSAGES:
            self._call(member, now, partial(member.session.receive_payload, message, now))

    def _take(self, raw: dict[str, Any], now: float) -> None:
        try:
            work = self._inbox.read(raw, now, self._clock.utc())
        except WorkError as error:
            _LOG.warning("work refused: %s", error)
            self._refuse(error.work_id, str(error))
            return
        except Exception as error:  # noqa: BLE001  # the boundary of one piece of work
            number = raw.get("id")
            reason = self.internal_errors.record("work", error, now)
            self._refuse(number if isinstance(number, int) else None, reason)
            return
        match work:
            case MissionWork():
                self._take_mission(work, now)
            case EventWork():
                self._take_event(work, now)
            case StateVectorWork():
                self._answer_state_vector(work, now)

    def _refuse(self, work_id: int | None, reason: str) -> None:
        """Refuse work that is not valid, if it has an id."""
        if work_id is not None:
            self._post(Acknowledgement(work_id, "refused", reason), 0)

    def _take_mission(self, work: MissionWork, now: float) -> None:
        system = self._config.system_of(work.vehicle_id)
        if system is None:
            reason = f"no system is vehicle {work.vehicle_id}"
            self._post(Acknowledgement(work.work_id, "refused", reason), work.vehicle_id)
            return
        member = self._fleet.get_or_add(system, work.vehicle_id)
        self._call(member, now, partial(self._accept, member, work, now))

    def _accept(self, member: FleetMember, work: MissionWork, now: float, effects: Effects) -> None:
        """Pass a mission to its session; one that causes an error is refused."""
        try:
            member.session.missions.take_mission(work, effects)
        except Exception as error:  # noqa: BLE001  # the boundary of one mission
            reason = self.internal_errors.record(_owner(member), error, now)
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))

    def _apply_acceptance_result(self, acceptance_result: AcceptanceResult, now: float) -> None:
        """Pass the edge server's answer to an acceptance to the sessions."""
        for member in self._fleet:
            missions = member.session.missions
            self._call(
                member, now, partial(missions.take_acceptance_result, acceptance_result, now)
            )

    def _take_event(self, work: EventWork, now: float) -> None:
        """Pass an event to its vehicle; an expired one, or one without a vehicle, is refused.

        An event that an earlier run has accepted may be for a vehicle that is not received yet.
        """
        system = self._config.system_of(work.vehicle_id)
        if system is not None and work.was_accepted:
            member: FleetMember | None = self._fleet.get_or_add(system, work.vehicle_id)
        else:
            member = self._fleet.find(system)
        late = work.expires_at is not None and now >= work.expires_at
        expired = late and not work.was_accepted
        if member is None or expired:
            reason = "expired" if expired else f"vehicle {work.vehicle_id} is not known"
            self._post(Acknowledgement(work.work_id, "refused", reason), work.vehicle_id)
            return
        if not self._call(member, now, partial(member.session.missions.take_event, work, now)):
            failure = self.internal_errors.warning(_owner(member), now)
            refused = Acknowledgement(work.work_id, "refused", failure)
            self._call(member, now, lambda effects: effects.for_edge.append(refused))

    def _answer_state_vector(self, work: StateVectorWork, now: float) -> None:
        """Publish the state of one vehicle or all; done if any of them was published."""
        expired = work.expires_at is not None and now >= work.expires_at
        reason = "expired" if expired else "no such vehicle is connected"
        answered = False
        for member in self._fleet:
            if not expired and work.vehicle_id in {None, member.session.vehicle.vehicle_id}:
                answers: list[bool] = []
                self._call(member, now, partial(_answer_state, member.session, now, answers))
                answered |= any(answers)
        status, message = ("done", None) if answered else ("refused", reason)
        self._post(Acknowledgement(work.work_id, status, message), work.vehicle_id or 0)

    def _carry_out(self, effects: Effects, member: FleetMember) -> list[Exception]:
        """Send messages, post reports and start jobs; returns errors of encoding.

        Without effects nothing waits for the recovery record: the next step updates it.
        """
        if effects.is_empty:
            return []
        messages = member.session.permitted(effects.messages, self._clock.monotonic())
        errors = self._router.send(member.system, messages) if messages else []
        member.unsent += member.session.missions.due_for_edge(effects.for_edge)
        with _ErrorBoundary() as errors_of_posting:
            self._post_when_recorded(member)
        for job in effects.jobs:
            self._jobs.put(member.system, job)
        return [*errors, *errors_of_posting]

    def _post_when_recorded(self, member: FleetMember) -> None:
        """Update the recovery record, and post what depends on it when it is on the disk."""
        if self._records.store(member.session.vehicle, self._clock.monotonic()):
            self._post_all(member)

    def _post_all(self, member: FleetMember) -> None:
        while member.unsent:
            self._post(member.unsent.pop(0), member.session.vehicle.vehicle_id)

    def _post(self, message: EdgeMessage, vehicle_id: int) -> None:
        post = post_for(
            message,
            vehicle_id=vehicle_id,
            recorded_at=self._clock.utc(),
            key=self._new_ulid(),
        )
        self._edge.post(post)


def _owner(member: FleetMember) -> str:
    return f"vehicle {member.session.vehicle.vehicle_id}"


class _ErrorBoundary:
    """The error boundary of one vehicle's session: collects any exception of its `with` block.

    The caller counts and shows the error.
    """

    def __init__(self) -> None:
        self._errors: list[Exception] = []

    def __enter__(self) -> list[Exception]:
        return self._errors

    def __exit__(
        self, _kind: type[BaseException] | None, error: BaseException | None, _trace: object
    ) -> bool:
        if isinstance(error, Exception):
            self._errors.append(error)
        return isinstance(error, Exception)


def _answer_state(session: Session, now: float, answers: list[bool], effects: Effects) -> None:
    """Publish the state of one vehicle; adds to `answers` whether it was published."""
    answers.append(session.publish_state(now, effects))


def _work_id_of(raw: dict[str, Any]) -> int:
    """Sort key: work is taken in the order of its ids, although events are delivered first."""
    number = raw.get("id")
    return number if isinstance(number, int) else 0
