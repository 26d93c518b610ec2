"""The broker's one loop: hear vehicles, take work, step the sessions, pass on what they say.

Everything that touches a clock, a socket or the edge server is handed in, so that tests can run
a day of it in a second.

Every call into a session has a boundary: an exception in one vehicle's session fails the mission
of that vehicle with its reason, is counted and shown, and no other vehicle notices it.
"""

import logging
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Final

from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.config import Config
from mavlink_broker.edge.posts import post_for
from mavlink_broker.edge.work import EventWork, MissionWork, StateVectorWork, Verdict
from mavlink_broker.edge.work_parser import Inbox, WorkError
from mavlink_broker.effects import Acknowledgement, Effects, ForEdge
from mavlink_broker.fleet import Fleet, Peer
from mavlink_broker.forwarding.verdict import Tenure
from mavlink_broker.internal_errors import Faults
from mavlink_broker.live.tracking import TRACKED_WORDS as TRACKED
from mavlink_broker.mavlink.dialect import Message, source_of
from mavlink_broker.mission.states import State
from mavlink_broker.peers import Edge, Jobs, Journal, NoJobs
from mavlink_broker.pictures.pictures import HEARD as PICTURED
from mavlink_broker.routing.routing import Clock, Link, Traffic
from mavlink_broker.session import Session
from mavlink_broker.vehicle.measurements import OBSERVED
from mavlink_broker.vehicle.vehicle import Vehicle
from mavlink_broker.vehicle_records import Bookkeeping

IDLE_WAIT_S: Final = 0.02
"""Longest sleep: what is overdue is noticed that late. Datagrams and work end it at once."""
SWEEP_EVERY_S: Final = 10.0
STEP_ALL_EVERY_S: Final = 0.015
"""In between only those who have spoken are seen to: twenty vehicles say 500 things a second."""
PAYLOAD_WORDS: Final = frozenset({"COMMAND_ACK", "HEARTBEAT"}) | OBSERVED | PICTURED | TRACKED
"""What is taken from a vehicle's other components, such as its camera."""

MOST_WARNING: Final = 255
"""Characters that the edge server takes of a vehicle's warning."""
PICTURES_WAITING: Final = 8
"""With so many unanswered none is fetched: they are safer on the vehicle than in memory."""

SETTLED_AFTER_S: Final = 30.0
"""By then a restarted broker has its unfinished missions again."""
FLYING: Final = frozenset({ModeRole.MISSION, ModeRole.GUIDED})
TRANSFERS: Final = frozenset(
    {State.ATTACHING, State.FENCING, State.UPLOADING, State.VERIFYING, State.SELECTING}
)
"""States in which a mission is sent or read back."""

_LOG = logging.getLogger(__name__)


class App:
    """All vehicles of one broker."""

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
        """Take what the loop needs.

        Without `jobs` no picture can be fetched or made to fit; without a `journal` a broker that
        is killed forgets what it has borrowed of its vehicles.
        """
        self._config = config
        self._edge = edge
        self._clock = clock
        self._new_ulid = new_ulid
        self._jobs = jobs or NoJobs()
        self._books = Bookkeeping(journal)
        self._inbox = Inbox()
        self.faults = Faults()
        self._traffic = Traffic(config, link, clock, self._tenure, self.faults)
        self._fleet = Fleet(config, self._books, new_ulid)
        self._sweep_at = 0.0
        self._step_all_at = 0.0
        self._began_at = clock.monotonic()

    @property
    def sessions(self) -> dict[int, Session]:
        """Sessions by MAVLink system id."""
        return {peer.system: peer.session for peer in self._fleet}

    def step(self, wait_s: float = IDLE_WAIT_S) -> None:
        """Go round once."""
        messages = self._traffic.receive(wait_s)
        now = self._clock.monotonic()
        for message in messages:
            self._dispatch(message, now)
        work = sorted(self._edge.take_work(), key=_number_of)
        for raw in work:
            self._take(raw, now)
        verdicts = self._edge.take_verdicts()
        for verdict in verdicts:
            self._judge(verdict, now)
        self._books.settle(self._fleet.session)
        finished = self._jobs.take_finished()
        for system, outcome in finished:
            peer = self._fleet.find(system)
            if peer is not None:
                self._call(peer, now, partial(peer.session.pictures.take_outcome, outcome, now))
        if work or verdicts or finished or now >= self._step_all_at:
            self._step_all_at = now + STEP_ALL_EVERY_S
            self._step(self._fleet, now)
        else:
            speakers = {source_of(message).system for message in messages}
            self._step(filter(None, map(self._fleet.find, speakers)), now)
        if now >= self._sweep_at:
            self._sweep_at = now + SWEEP_EVERY_S
            for system in self._fleet.forget_strangers(now):
                self._traffic.forget(system)

    def _step(self, peers: Iterable[Peer], now: float) -> None:
        """Let time pass for some vehicles."""
        has_room = self._edge.waiting_pictures < PICTURES_WAITING
        for peer in peers:
            peer.session.watch(self._traffic.asked_of(peer.system, now))
            peer.session.vehicle.warning = self._warning_of(peer, now)
            peer.session.pictures.has_room = has_room
            self._call(peer, now, partial(self._books.open, peer.session, now))
            self._call(peer, now, partial(peer.session.step, now))

    def close(self) -> None:
        """Leave no word untold, end what goes on beside the loop; the links are the caller's."""
        for peer in self._fleet:
            self._tell_all(peer)
        self._traffic.close()

    def _call(self, peer: Peer, now: float, action: Callable[[Effects], object]) -> bool:
        """Call one vehicle's session and carry out what it wants; whether it ended well."""
        effects = Effects()
        errors = [*_error_of(partial(action, effects)), *self._carry_out(effects, peer)]
        for error in errors[:1]:
            self._break_off(peer, error, now)
        return not errors

    def _break_off(self, peer: Peer, error: Exception, now: float) -> None:
        """End the mission in which an unexpected error has occurred; the broker goes on.

        Where that fails too, the mission is dropped: the session is free, whatever it was doing.
        """
        reason = self.faults.note(_owner(peer), error, now)
        for end in (peer.session.break_off, peer.session.drop_mission):
            effects = Effects()
            errors = _error_of(partial(end, reason, now, effects))
            for another in (*errors, *self._carry_out(effects, peer)):
                self.faults.note(_owner(peer), another, now)
            if not errors:
                return

    def _warning_of(self, peer: Peer, now: float) -> str | None:
        """What somebody should know about a vehicle: its link, dead letters, internal errors."""
        dead = self._edge.dead_letters_of(peer.session.vehicle.vehicle_id)
        warnings = (
            self._traffic.warning_of(peer.system, now),
            f"{dead} reports could not be delivered: see dead-letters" if dead else None,
            self.faults.warning(_owner(peer), now),
        )
        return "; ".join(warning for warning in warnings if warning)[:MOST_WARNING] or None

    def _tenure(self, system: int) -> Tenure:
        """Whose a vehicle is, for ground stations."""
        session = self._fleet.session(system)
        if session is None:
            return Tenure.FREE
        state = session.state
        if state is State.IDLE:
            return Tenure.MISSION if self._may_be_ours(session.vehicle) else Tenure.FREE
        return Tenure.TRANSFER if state in TRANSFERS else Tenure.MISSION

    def _may_be_ours(self, vehicle: Vehicle) -> bool:
        """Whether it flies what a broker before us has begun, and we are just about to hear of."""
        is_settled = self._clock.monotonic() - self._began_at > SETTLED_AFTER_S
        return not is_settled and vehicle.snapshot.armed is True and vehicle.mode_role in FLYING

    def _dispatch(self, message: Message, now: float) -> None:
        """Hand a message to the session of its vehicle."""
        peer = self._fleet.speaker(message)
        if peer is None:
            return
        if source_of(message).component == peer.component:
            self._call(peer, now, partial(peer.session.receive, message, now))
        elif message.get_type() in PAYLOAD_WORDS:
            self._call(peer, now, partial(peer.session.receive_payload, message, now))

    def _take(self, raw: dict[str, Any], now: float) -> None:
        try:
            work = self._inbox.read(raw, now, self._clock.utc())
        except WorkError as error:
            _LOG.warning("work refused: %s", error)
            self._refuse(error.work_id, str(error))
            return
        except Exception as error:  # noqa: BLE001  # the boundary of one piece of work
            number = raw.get("id")
            reason = self.faults.note("work", error, now)
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
        """Refuse work that cannot be read, where it has a number."""
        if work_id is not None:
            self._tell(Acknowledgement(work_id, "refused", reason), 0)

    def _take_mission(self, work: MissionWork, now: float) -> None:
        system = self._config.system_of(work.vehicle_id)
        if system is None:
            reason = f"no system is vehicle {work.vehicle_id}"
            self._tell(Acknowledgement(work.work_id, "refused", reason), work.vehicle_id)
            return
        peer = self._fleet.enlist(system, work.vehicle_id)
        self._call(peer, now, partial(self._accept, peer, work, now))

    def _accept(self, peer: Peer, work: MissionWork, now: float, effects: Effects) -> None:
        """Hand a mission to its session; one that cannot even be read is refused, and no other."""
        try:
            peer.session.take_mission(work, effects)
        except Exception as error:  # noqa: BLE001  # the boundary of one mission
            reason = self.faults.note(_owner(peer), error, now)
            effects.for_edge.append(Acknowledgement(work.work_id, "refused", reason))

    def _judge(self, verdict: Verdict, now: float) -> None:
        """Tell whom it concerns whether an accepted mission may be flown."""
        for peer in self._fleet:
            self._call(peer, now, partial(peer.session.take_verdict, verdict, now))

    def _take_event(self, work: EventWork, now: float) -> None:
        """Interrupt a vehicle; what has expired, or is for nobody, is refused.

        One that an earlier run has accepted may be for a vehicle that is still to be heard.
        """
        system = self._config.system_of(work.vehicle_id)
        if system is not None and work.was_accepted:
            peer: Peer | None = self._fleet.enlist(system, work.vehicle_id)
        else:
            peer = self._fleet.find(system)
        late = work.expires_at is not None and now >= work.expires_at
        expired = late and not work.was_accepted
        if peer is None or expired:
            reason = "expired" if expired else f"vehicle {work.vehicle_id} is not known"
            self._tell(Acknowledgement(work.work_id, "refused", reason), work.vehicle_id)
            return
        if not self._call(peer, now, partial(peer.session.take_event, work, now)):
            failure = self.faults.warning(_owner(peer), now)
            refused = Acknowledgement(work.work_id, "refused", failure)
            self._call(peer, now, lambda effects: effects.for_edge.append(refused))

    def _answer_state_vector(self, work: StateVectorWork, now: float) -> None:
        """Have one vehicle or all report; done if any of them could."""
        expired = work.expires_at is not None and now >= work.expires_at
        reason = "expired" if expired else "no such vehicle is heard"
        answered = False
        for peer in self._fleet:
            if not expired and work.vehicle_id in {None, peer.session.vehicle.vehicle_id}:
                answers: list[bool] = []
                self._call(peer, now, partial(_answer_state, peer.session, work, now, answers))
                answered |= any(answers)
        status, message = ("done", None) if answered else ("refused", reason)
        self._tell(Acknowledgement(work.work_id, status, message), work.vehicle_id or 0)

    def _carry_out(self, effects: Effects, peer: Peer) -> list[Exception]:
        """Send, tell and begin what a session wants; gives what could not be put into bytes."""
        messages = peer.session.permitted(effects.messages, self._clock.monotonic())
        errors = self._traffic.send(peer.system, messages) if messages else []
        peer.untold += peer.session.due(effects.for_edge)
        errors += _error_of(partial(self._tell_when_noted, peer))
        for job in effects.jobs:
            self._jobs.put(peer.system, job)
        return errors

    def _tell_when_noted(self, peer: Peer) -> None:
        """Note what is new, and tell what follows from it when that is on the disk."""
        if self._books.note(peer.session.vehicle, self._clock.monotonic()):
            self._tell_all(peer)

    def _tell_all(self, peer: Peer) -> None:
        while peer.untold:
            self._tell(peer.untold.pop(0), peer.session.vehicle.vehicle_id)

    def _tell(self, word: ForEdge, vehicle_id: int) -> None:
        post = post_for(
            word,
            vehicle_id=vehicle_id,
            recorded_at=self._clock.utc(),
            key=self._new_ulid(),
        )
        self._edge.post(post)


def _owner(peer: Peer) -> str:
    return f"vehicle {peer.session.vehicle.vehicle_id}"


def _error_of(action: Callable[[], object]) -> list[Exception]:
    """Call something; gives the error that it ends by, if any.

    This is the boundary of one vehicle's session: whoever calls it counts and shows the error.
    """
    try:
        action()
    except Exception as error:  # noqa: BLE001  # nothing that may go wrong in there is left out
        return [error]
    return []


def _answer_state(
    session: Session, work: StateVectorWork, now: float, answers: list[bool], effects: Effects
) -> None:
    """Report the state of one vehicle; whether it could be is added to the answers."""
    answers.append(session.answer_state_vector(work, now, effects))


def _number_of(raw: dict[str, Any]) -> int:
    """Work in the order in which it was given, though events are handed out first."""
    number = raw.get("id")
    return number if isinstance(number, int) else 0
