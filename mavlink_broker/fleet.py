"""The vehicles of one broker by MAVLink system id, each with its session and its journal record.

Records are stored after each change and recalled after a restart. The interfaces of the loop to
edge server, jobs and journal are here too, and the time of day at which the fleet's results were
recorded (`FleetTime`).
"""

import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any, Final, Protocol, Self

from mavlink_broker.config import Config
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.wire import AcceptanceResult
from mavlink_broker.effects import EdgeMessage, Effects, Job, JobOutcome, failed
from mavlink_broker.live.follow_target import read_target_sources
from mavlink_broker.mavlink.dialect import (
    AUTOPILOT,
    ONBOARD_COMPUTER,
    Message,
    Route,
    Source,
    is_vehicle,
    replaces_autopilot,
    source_of,
)
from mavlink_broker.session import Session
from mavlink_broker.vehicle.recovery_state import (
    EMPTY_RECORD,
    RecordTracker,
    RecordUpdate,
    RecoveryRecord,
    RecoveryState,
    VehicleIdentity,
    merge_records,
)
from mavlink_broker.vehicle.vehicle import Vehicle

NO_NUMBER: Final = ""
"""Number of a vehicle that has sent none, or not yet."""
LONGEST_FLIGHT_S: Final = 6 * 3600.0
"""How long results keep the time of day of the flight after the machine's clock was set back."""
_READ_WITHIN: Final = timedelta(seconds=1.0)
"""Tolerance: the two clocks of the machine are read one after the other and are corrected
slowly."""
_LOG = logging.getLogger(__name__)


class Edge(Protocol):
    """The edge server: gives work, takes posts."""

    def take_work(self) -> list[dict[str, Any]]:
        """Return new work as the edge server sent it."""

    def post(self, post: Post) -> None:
        """Queue a post; posts are sent in order and repeated until they are answered."""

    def take_acceptance_results(self) -> Sequence[AcceptanceResult]:
        """Return the edge server's answers to acceptances of missions."""

    @property
    def waiting_pictures(self) -> int:
        """Number of pictures that are not answered yet."""

    def update_interval_of(self, vehicle_id: int) -> float | None:
        """Interval [s] at which it requests updates of a vehicle; None: the usual one."""

    def dead_letters_of(self, vehicle_id: int) -> int:
        """Number of posts of a vehicle that the edge server has rejected."""


class Jobs(Protocol):
    """Runs slow jobs outside of the loop."""

    def put(self, system: int, job: Job) -> None:
        """Queue a job of a vehicle."""

    def take_finished(self) -> Sequence[tuple[int, JobOutcome]]:
        """Return the outcomes since the last call, each with its system id."""


class Journal(Protocol):
    """The recovery records on disk."""

    def recall(self, identity: VehicleIdentity) -> RecoveryRecord:
        """Give the record of a vehicle; an empty one if there is none."""

    def put(self, update: RecordUpdate) -> None:
        """Queue a record to be written; only the newest of a vehicle is."""

    def take_settled(self) -> Sequence[tuple[VehicleIdentity, int]]:
        """Give the updates that were written or refused since the last call."""


class NoJobs:
    """Fails every job."""

    def __init__(self) -> None:
        self._refused: list[tuple[int, JobOutcome]] = []

    def put(self, system: int, job: Job) -> None:
        """Fail a job."""
        self._refused.append((system, failed(job, "this program runs no jobs")))

    def take_finished(self) -> Sequence[tuple[int, JobOutcome]]:
        """Return the failed jobs."""
        refused, self._refused = self._refused, []
        return refused


class VehicleRecords:
    """All records of one broker; without a journal there are none."""

    def __init__(self, journal: Journal | None) -> None:
        self._journal = journal

    def new_tracker(self) -> RecordTracker:
        """Make the tracker of a new vehicle."""
        return RecordTracker(in_use=self._journal is not None)

    def recall(self, session: Session, now: float, effects: Effects) -> None:
        """Recall what an earlier run has noted of a vehicle, once its identity is known.

        A vehicle that sends its number late keeps its record; another vehicle in its place gets a
        record of its own.
        """
        vehicle = session.vehicle
        system, before = vehicle.route.target_system, vehicle.recovery.tracker.identity
        identity = VehicleIdentity(system, vehicle.uid)
        if self._journal is None or not vehicle.is_identified or identity == before:
            return
        number = vehicle.vehicle_id
        if before is not None and not identity.uid:
            return
        if before is not None and before.uid != NO_NUMBER:
            if not session.change_vehicle():
                return
            _LOG.warning("vehicle %d is another one: %s, before %s", number, identity, before)
        on_disk = self._journal.recall(identity)
        without_number = self._journal.recall(VehicleIdentity(system, NO_NUMBER))
        vehicle.recovery.tracker.load(identity, on_disk)
        recalled = merge_records(on_disk, without_number)
        if recalled != EMPTY_RECORD:
            _LOG.info("vehicle %d: an earlier run of the broker has left a record of it", number)
            session.missions.recall(recalled, now, effects)
        if identity.uid and without_number != EMPTY_RECORD:
            self.store(vehicle, now)  # Under its own number first
            self._journal.put(RecordUpdate(VehicleIdentity(system, NO_NUMBER), 0, EMPTY_RECORD))

    def store(self, vehicle: Vehicle, now: float) -> bool:
        """Store what has changed; whether all of it is on the disk, or never will be."""
        update = vehicle.recovery.tracker.update(vehicle.recovery.record, now)
        if update is not None and self._journal is not None:
            self._journal.put(update)
        return vehicle.recovery.tracker.is_settled

    def confirm(self, find: Callable[[int], Session | None]) -> None:
        """Receive which records are on the disk; `find` gives the session of a system id."""
        if self._journal is None:
            return
        for identity, number in self._journal.take_settled():
            session = find(identity.system)
            if session is not None and session.vehicle.recovery.tracker.identity == identity:
                session.vehicle.recovery.tracker.confirm(number)


class FleetTime:
    """The time of day of results: it does not go back while a vehicle is armed.

    A machine without a clock of its own starts with a wrong time, and sets it when it reaches a
    network. Results that were recorded before an earlier one would be in no flight, or in another.
    What was recorded in a flight has the flight's time also if it is sent after that. A vehicle may
    stay armed for days: after `LONGEST_FLIGHT_S` the machine's time counts again. A broker that is
    restarted begins with the machine's time.
    """

    def __init__(self) -> None:
        self._began: datetime | None = None  # When the monotonic clock showed 0
        self._ahead_since: float | None = None  # Since when the machine's time of day is behind
        self._until = -math.inf  # What was recorded before then has the time of day of a flight
        self._began_before: datetime | None = None  # The same as `_began`, in that flight

    def update(self, utc: datetime, now: float, *, is_flying: bool) -> None:
        """Follow the machine's time of day, at a time of its monotonic clock [s]."""
        began = utc - timedelta(seconds=now)
        is_behind = self._began is not None and began < self._began - _READ_WITHIN
        if not is_behind:
            self._began = max(self._began or began, began) if is_flying else began
            self._ahead_since = None
            return
        if self._ahead_since is None:
            self._ahead_since = now
        if not is_flying or now - self._ahead_since >= LONGEST_FLIGHT_S:
            self._began_before, self._until = self._began, now
            self._began, self._ahead_since = began, None

    def at(self, now: float) -> datetime:
        """Give the time of day at a time of the monotonic clock [s]; `update` comes before."""
        began = self._began_before if now < self._until else self._began
        if began is None:
            raise ValueError("the time of day is not known before the first update")
        return began + timedelta(seconds=now)


@dataclass(slots=True)
class FleetMember:
    """A vehicle's session; `component` is its autopilot's, None before the first heartbeat."""

    session: Session
    component: int | None = None
    unsent: list[EdgeMessage] = field(default_factory=list)  # Until the record is on the disk

    @property
    def system(self) -> int:
        """The vehicle's MAVLink system id."""
        return self.session.vehicle.route.target_system


class SessionCall:
    """One call into a vehicle's session, in a `with` block: its effects, and whether it failed.

    Every message of every vehicle is one: a generator would take twice as long.
    """

    __slots__ = ("_end", "_member", "_now", "effects", "has_failed")

    def __init__(
        self,
        end: Callable[[FleetMember, float, Effects, Exception | None], bool],
        member: FleetMember,
        now: float,
    ) -> None:
        self._end, self._member, self._now = end, member, now
        self.effects = Effects()
        self.has_failed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, error: BaseException | None, _trace: object
    ) -> bool:
        if error is not None and not isinstance(error, Exception):
            return False
        self.has_failed = self._end(self._member, self._now, self.effects, error)
        return True


class Fleet:
    """All vehicles that are received or have work."""

    def __init__(
        self, config: Config, records: VehicleRecords, new_session_id: Callable[[], str]
    ) -> None:
        self._config = config
        self._records = records
        self._new_session_id = new_session_id
        self._members: dict[int, FleetMember] = {}
        self._target_sources = read_target_sources(config.follow_targets, self.vehicle)

    def __iter__(self) -> Iterator[FleetMember]:
        return iter(tuple(self._members.values()))

    def find(self, system: int) -> FleetMember | None:
        """Return the member with a system id; None if there is none."""
        return self._members.get(system)

    def session(self, system: int) -> Session | None:
        """Return the session of a system id; None if there is none."""
        member = self.find(system)
        return None if member is None else member.session

    def member_of(self, vehicle_id: int) -> FleetMember | None:
        """Return the member with a vehicle id; None if there is none."""
        members = self._members.values()
        return next((m for m in members if m.session.vehicle.vehicle_id == vehicle_id), None)

    def vehicle(self, vehicle_id: int) -> Vehicle | None:
        """Return a vehicle by its vehicle id; None if there is none."""
        member = self.member_of(vehicle_id)
        return None if member is None else member.session.vehicle

    def sender_of(self, message: Message) -> FleetMember | None:
        """Return the sender of a message; the first heartbeat adds a member."""
        source = source_of(message)
        if message.get_type() == "HEARTBEAT" and is_vehicle(message):
            self._register(source)
        member = self.find(source.system)
        return None if member is None or member.component is None else member

    def _register(self, source: Source) -> None:
        vehicle_id = self._config.vehicle_id(source.system)
        if vehicle_id is None:
            return
        member = self.get_or_add(source.system, vehicle_id)
        if replaces_autopilot(source.component, member.component):
            _LOG.info("vehicle %d: connected, component %d", vehicle_id, source.component)
            member.component = source.component
            member.session.change_autopilot(source.component)

    def get_or_add(self, system: int, vehicle_id: int) -> FleetMember:
        """Return the member with a system id; adds it if it is new."""
        if system not in self._members:
            config = self._config
            log_limit_bytes = config.vehicle_log_mib << 20
            vehicle = Vehicle(
                vehicle_id,
                Route(config.system_id, ONBOARD_COMPUTER, system, AUTOPILOT),
                recovery=RecoveryState(self._records.new_tracker()),
                target_source=self._target_sources.get(vehicle_id),
            )
            session = Session(
                vehicle,
                new_session_id=self._new_session_id,
                state_vector_every_s=config.state_vector_every_s,
                observations_every_s=config.observations_every_s,
                battery_capacity_ah=config.battery_capacity_ah,
                log_limit_bytes=log_limit_bytes,
                log_limit_s=config.vehicle_log_time_s,
                frames_limit_bytes=log_limit_bytes if config.traffic.tlog_dir else 0,
                observes=config.observes,
            )
            self._members[system] = FleetMember(session)
        return self._members[system]

    def remove_strangers(self, now: float) -> list[int]:
        """Remove systems that have sent only heartbeats, such as a scan; returns their ids."""
        strangers = [s for s, member in self._members.items() if member.session.is_stranger(now)]
        for system in strangers:
            del self._members[system]
        return strangers
