"""Interfaces of the loop besides the links: edge server, jobs, recovery journal."""

from collections.abc import Sequence
from typing import Any, Protocol

from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.work import AcceptanceResult
from mavlink_broker.effects import Job, JobFailed, JobOutcome
from mavlink_broker.recovery.record import RecoveryRecord, VehicleIdentity
from mavlink_broker.recovery.record_tracker import RecordUpdate


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
        self._refused.append((system, JobFailed(job.number, "this program runs no jobs")))

    def take_finished(self) -> Sequence[tuple[int, JobOutcome]]:
        """Return the failed jobs."""
        refused, self._refused = self._refused, []
        return refused
