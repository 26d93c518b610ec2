"""The broker's loop: receive messages and work, step the sessions, send what they produce.

Clock, sockets and edge server are arguments, so that tests can run a day in a second.

Every call into a session has an error boundary: an exception in one vehicle's session fails the
mission of that vehicle with its reason, is counted and shown, and affects no other vehicle.
"""

import logging
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Final

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.config import Config
from mavlink_broker.edge.wire import (
    AcceptanceResult,
    EventWork,
    Inbox,
    MissionWork,
    StateVectorWork,
    Work,
    WorkError,
    post_for,
)
from mavlink_broker.effects import Acknowledgement, EdgeMessage, Effects, JobOutcome, Result
from mavlink_broker.fleet import (
    Edge,
    Fleet,
    FleetMember,
    FleetTime,
    Jobs,
    Journal,
    NoJobs,
    SessionCall,
    VehicleRecords,
)
from mavlink_broker.live.tracking import TRACKING_MESSAGES as TRACKED
from mavlink_broker.mavlink.dialect import Message, is_order, source_of
from mavlink_broker.mission.states import State
from mavlink_broker.pictures.collector import PICTURE_MESSAGES
from mavlink_broker.routing.policy import BrokerControl
from mavlink_broker.routing.router import Clock, Link, Router
from mavlink_broker.session import Session
from mavlink_broker.supervision import InternalErrors
from mavlink_broker.vehicle.measurements import OBSERVED
from mavlink_broker.vehicle.vehicle import Vehicle

IDLE_WAIT_S: Final = 0.02
"""Longest wait of the loop, the resolution of timeouts. Datagrams and work end it at once."""
SWEEP_INTERVAL_S: Final = 10.0
STEP_INTERVAL_S: Final = 0.015
"""Interval of the steps of each session. A session is also stepped when it has received a mission,
the outcome of a job, or a message that is not in `READ_LATER`: twenty vehicles send 500 messages a
second."""
READ_LATER: Final = (
    frozenset(
        {
            "ATTITUDE",
            "BATTERY_STATUS",
            "EKF_STATUS_REPORT",
            "ESTIMATOR_STATUS",
            "GPS_RAW_INT",
            "LOG_DATA",
            "STATUSTEXT",
            "SYS_STATUS",
            "SYSTEM_TIME",
            "VFR_HUD",
        }
    )
    | OBSERVED
)
"""Messages that change only what the next step publishes or judges."""
PAYLOAD_MESSAGES: Final = (
    frozenset({"COMMAND_ACK", "HEARTBEAT"}) | OBSERVED | PICTURE_MESSAGES | TRACKED
)
"""Messages that are taken from a vehicle's other components, such as its camera."""

MAX_WARNING_CHARACTERS: Final = 255
"""Longest warning that the edge server accepts."""
MAX_WAITING_PICTURES: Final = 8
"""No picture is fetched while so many are unanswered: pictures are safer on the vehicle than in
memory."""

STOOD_STILL_S: Final = 2.0
"""After a longer pause of the loop, the program or its machine was suspended."""
HEARTBEAT_WITHIN_S: Final = 3.0
"""A connected vehicle sends heartbeats at 1 Hz, of which one may be lost."""
MAX_READS: Final = 64
"""Limit of reads after a pause; the buffers of all links hold less."""
STARTUP_S: Final = 30.0
"""Time in which a restarted broker receives its vehicles and its unfinished missions."""
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
        self._time = FleetTime()
        self._time.update(clock.utc(), clock.monotonic(), is_flying=False)
        self._sweep_at = 0.0
        self._step_at = 0.0
        self._to_step: set[int] = set()  # Systems that are stepped with this run of the loop
        self._started_at = clock.monotonic()
        self._ran_at: float | None = None
        self._is_behind = False  # While messages are received that have waited
        self._unheard: set[int] = set()  # Systems without a heartbeat since the loop stood still
        self._unheard_until = -math.inf

    @property
    def sessions(self) -> dict[int, Session]:
        """Sessions by MAVLink system id."""
        return {member.system: member.session for member in self._fleet}

    def step(self, wait_s: float = IDLE_WAIT_S) -> None:
        """Run the loop once."""
        messages = self._router.receive(wait_s)
        now = self._clock.monotonic()
        is_flying = any(member.session.may_fly(now) for member in self._fleet)
        self._time.update(self._clock.utc(), self._clock.monotonic(), is_flying=is_flying)
        self._replace_vehicles(now)
        self._receive_all(messages, now)
        for work in self._take_work(now):
            match work:
                case EventWork():
                    self._take_event(work, now)
                case MissionWork():
                    self._take_mission(work, now)
                case StateVectorWork():
                    self._answer_state_vector(work, now)
        for result in self._edge.take_acceptance_results():
            self._apply_acceptance_result(result, now)
        self._records.confirm(self._fleet.session)
        for system, outcome in self._jobs.take_finished():
            self._take_job_outcome(system, outcome, now)
        self._step(self._take_due(now), now)
        if now >= self._sweep_at:
            self._sweep_at = now + SWEEP_INTERVAL_S
            for system in self._fleet.remove_strangers(now):
                self._router.forget(system)

    def _receive_all(self, messages: list[Message], now: float) -> None:
        ran_at, self._ran_at = self._ran_at, now
        if ran_at is not None and now - ran_at > STOOD_STILL_S:
            _LOG.warning(
                "the broker stood still for %.0f s (its machine was suspended or overloaded): no "
                "vehicle is ordered before it is received again",
                now - ran_at,
            )
            self._catch_up(messages, ran_at)
            self._unheard = {member.system for member in self._fleet}
            self._unheard_until = now + HEARTBEAT_WITHIN_S
            return
        for message in messages:
            self._receive(message, now)

    def _catch_up(self, messages: list[Message], then: float) -> None:
        """Receive what has waited since `then`, as old as that; nothing is ordered by it.

        Full buffers have lost the newest: a vehicle may have been taken over meanwhile. As behind a
        lost link, what it does now is known with its next heartbeat.
        """
        self._is_behind = True
        try:
            for _ in range(MAX_READS):
                for message in messages:
                    self._receive(message, then)
                messages = self._router.receive(0.0)
                if not messages:
                    return
        finally:
            self._is_behind = False

    def _is_unheard(self, system: int) -> bool:
        """Whether nothing has shown yet what a vehicle does since the loop stood still."""
        return system in self._unheard and self._clock.monotonic() < self._unheard_until

    def _take_due(self, now: float) -> list[FleetMember]:
        is_due, systems = now >= self._step_at, sorted(self._to_step)
        self._to_step.clear()
        if not is_due:
            return [member for system in systems if (member := self._fleet.find(system))]
        self._step_at = now + STEP_INTERVAL_S
        return list(self._fleet)

    def _step(self, members: Iterable[FleetMember], now: float) -> None:
        has_room = self._edge.waiting_pictures < MAX_WAITING_PICTURES
        utc = self._time.at(now)
        for member in members:
            session = member.session
            session.watch(self._router.requested_messages(member.system, now))
            session.vehicle.note_duplicate(self._router.warning_of(member.system, now))
            session.vehicle.warn(self._warning_of(member, now))
            session.pictures.has_room = has_room
            session.logs.utc = utc
            session.set_update_interval(self._edge.update_interval_of(session.vehicle.vehicle_id))
            with self._call(member, now) as call:
                self._records.recall(session, now, call.effects)
                session.step(now, call.effects)
            with _ErrorBoundary() as errors:
                member.unsent += session.missions.due_for_edge(())
                self._post_when_recorded(member)
            for error in errors:
                self._fail_after_error(member, error, now)

    def close(self) -> None:
        """Post what is pending and close the frame log; the caller closes the links."""
        for member in self._fleet:
            self._post_all(member)
        self._router.close()

    def _call(self, member: FleetMember, now: float) -> SessionCall:
        """Isolate a call into one vehicle's session, and carry out its effects.

        An exception in the `with` block fails the mission of that vehicle.
        """
        return SessionCall(self._end_call, member, now)

    def _end_call(
        self, member: FleetMember, now: float, effects: Effects, error: Exception | None
    ) -> bool:
        """Carry out the effects of a call; whether it or that has failed."""
        errors = [] if error is None else [error]
        errors += self._carry_out(effects, member)
        for first in errors[:1]:
            self._fail_after_error(member, first, now)
        return bool(errors)

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
        """Warning: its link, what waits for it, what it keeps, dead letters and internal errors."""
        dead = self._edge.dead_letters_of(member.session.vehicle.vehicle_id)
        warnings = (
            member.session.vehicle.duplicate,
            member.session.link_warning,
            member.session.vehicle.armed_period.warning(now),
            member.session.waiting_warning,
            member.session.vehicle.recovery.lost_mission.warning,
            member.session.config_warning,
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
            may_fly = self._may_fly_our_mission(session.vehicle)
            return BrokerControl.MISSION if may_fly else BrokerControl.FREE
        return BrokerControl.TRANSFER if state in TRANSFERS else BrokerControl.MISSION

    def _may_fly_our_mission(self, vehicle: Vehicle) -> bool:
        """Whether it may fly a mission of an earlier run that is not received again yet."""
        is_flying = vehicle.snapshot.armed is True and vehicle.mode_role in FLYING
        return self._is_starting and is_flying

    @property
    def _is_starting(self) -> bool:
        """Whether vehicles and missions of an earlier run may not have been received yet."""
        return self._clock.monotonic() - self._started_at <= STARTUP_S

    def _replace_vehicles(self, now: float) -> None:
        """Note where another vehicle with a system id is received, or may be, instead of before."""
        for system in self._router.take_unproven():
            if member := self._fleet.find(system):
                member.session.vehicle.doubt(now)
        for system in self._router.take_replaced():
            if member := self._fleet.find(system):
                with self._call(member, now) as call:
                    member.session.vehicle_replaced(now, call.effects)

    def _receive(self, message: Message, now: float) -> None:
        member = self._fleet.sender_of(message)
        if member is None:
            return
        is_of_autopilot = source_of(message).component == member.component
        if is_of_autopilot and not self._is_behind and message.get_type() == "HEARTBEAT":
            self._unheard.discard(member.system)
        if is_of_autopilot or message.get_type() in PAYLOAD_MESSAGES:
            with self._call(member, now) as call:
                if is_of_autopilot:
                    member.session.receive(message, now, call.effects)
                    if message.get_type() == "AUTOPILOT_VERSION":
                        self._records.recall(member.session, now, call.effects)
                else:
                    member.session.receive_payload(message, now, call.effects)
        if message.get_type() not in READ_LATER:
            self._to_step.add(member.system)

    def _take_job_outcome(self, system: int, outcome: JobOutcome, now: float) -> None:
        self._to_step.add(system)
        if member := self._fleet.find(system):
            with self._call(member, now) as call:
                member.session.take_outcome(outcome, now, call.effects)

    def _take_work(self, now: float) -> Iterator[Work]:
        """Give the new work in order; work that is not valid is refused.

        None is decided by what was true before the loop stood still.
        """
        if any(map(self._is_unheard, self._unheard)):
            return
        for raw in sorted(self._edge.take_work(), key=_work_id_of):
            try:
                work = self._inbox.read(raw, now, self._clock.utc())
            except WorkError as error:
                _LOG.warning("work refused: %s", error)
                self._refuse(error.work_id, str(error), raw)
            except Exception as error:  # noqa: BLE001  # the boundary of one piece of work
                number = raw.get("id")
                reason = self.internal_errors.record("work", error, now)
                self._refuse(number if isinstance(number, int) else None, reason, raw)
            else:
                if work is not None:
                    yield work

    def _refuse(self, work_id: int | None, reason: str, raw: Mapping[str, Any]) -> None:
        if work_id is not None:
            identity = raw.get("identity")
            known = identity if isinstance(identity, str) else None
            self._post(Acknowledgement(work_id, "refused", reason, known), 0)

    def _take_mission(self, work: MissionWork, now: float) -> None:
        system = self._config.system_of(work.vehicle_id)
        if system is None:
            reason = f"no system is vehicle {work.vehicle_id}"
            self._post(work.answer("refused", reason), work.vehicle_id)
            return
        self._to_step.add(system)
        member = self._fleet.get_or_add(system, work.vehicle_id)
        with self._call(member, now) as call:
            try:
                member.session.missions.take_mission(work, call.effects)
            except Exception as error:  # noqa: BLE001  # the boundary of one mission
                reason = self.internal_errors.record(_owner(member), error, now)
                call.effects.for_edge.append(work.answer("refused", reason))

    def _apply_acceptance_result(self, acceptance_result: AcceptanceResult, now: float) -> None:
        for member in self._fleet:
            with self._call(member, now) as call:
                member.session.missions.take_acceptance_result(acceptance_result, now, call.effects)

    def _take_event(self, work: EventWork, now: float) -> None:
        """Pass an event to its vehicle; an expired one, or one without a vehicle, is refused.

        A broker that has just started may not have received the vehicle yet: the event waits. So
        does one that an earlier run has accepted.
        """
        member = self._fleet.member_of(work.vehicle_id)
        if member is None and (work.was_accepted or self._is_starting):
            system = self._config.system_of(work.vehicle_id)
            member = None if system is None else self._fleet.get_or_add(system, work.vehicle_id)
        expired = work.is_expired(now)
        if member is None or expired:
            reason = "expired" if expired else f"vehicle {work.vehicle_id} is not known"
            self._post(work.answer("refused", reason), work.vehicle_id)
            return
        with self._call(member, now) as call:
            member.session.missions.take_event(work, now, call.effects)
        if call.has_failed:
            failure = self.internal_errors.warning(_owner(member), now)
            with self._call(member, now) as call:
                call.effects.for_edge.append(work.answer("refused", failure))

    def _answer_state_vector(self, work: StateVectorWork, now: float) -> None:
        """Publish the state of one vehicle or all; done if any of them was published."""
        expired = work.expires_at is not None and now >= work.expires_at
        reason = "expired" if expired else "no such vehicle is connected"
        answered = False
        for member in self._fleet:
            if not expired and work.vehicle_id in {None, member.session.vehicle.vehicle_id}:
                with self._call(member, now) as call:
                    answered |= member.session.publish_state(now, call.effects)
        status, message = ("done", None) if answered else ("refused", reason)
        self._post(Acknowledgement(work.work_id, status, message), work.vehicle_id or 0)

    def _carry_out(self, effects: Effects, member: FleetMember) -> list[Exception]:
        """Send messages, post reports and start jobs; returns errors of encoding.

        Without effects nothing waits for the recovery record: the next step updates it.
        """
        if not (effects.messages or effects.for_edge or effects.jobs):
            return []
        messages = member.session.permitted(effects.messages, self._clock.monotonic())
        if self._is_behind or self._is_unheard(member.system):
            messages = [message for message in messages if not is_order(message)]
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
        recorded_s = message.recorded_monotonic_s if isinstance(message, Result) else None
        recorded_at = self._time.at(self._clock.monotonic() if recorded_s is None else recorded_s)
        key = self._new_ulid()
        self._edge.post(post_for(message, vehicle_id=vehicle_id, recorded_at=recorded_at, key=key))


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


def _work_id_of(raw: dict[str, Any]) -> int:
    """Sort key: work is taken in the order of its ids, although events are delivered first."""
    number = raw.get("id")
    return number if isinstance(number, int) else 0
