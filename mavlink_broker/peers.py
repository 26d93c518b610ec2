"""Whom the loop speaks to beside the vehicles: the edge server, those who do slow work, a disk."""

from collections.abc import Sequence
from typing import Any, Protocol

from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.work import Verdict
from mavlink_broker.jobs import Job, JobFailed, JobOutcome
from mavlink_broker.recovery.progress import Note
from mavlink_broker.recovery.record import Memo, Owner


class Edge(Protocol):
    """The edge server: work comes from it, posts go to it."""

    def take_work(self) -> list[dict[str, Any]]:
        """Give new work as the edge server wrote it."""

    def post(self, post: Post) -> None:
        """Leave a post to be sent, in order, until it is answered."""

    def take_verdicts(self) -> Sequence[Verdict]:
        """Give what the edge server has answered to missions that were accepted."""

    @property
    def waiting_pictures(self) -> int:
        """How many pictures have not been answered yet."""

    def dead_letters_of(self, vehicle_id: int) -> int:
        """How many posts of a vehicle were given up and wait for a person."""


class Jobs(Protocol):
    """What is done beside the loop."""

    def put(self, system: int, job: Job) -> None:
        """Have a job done for a vehicle."""

    def take_finished(self) -> Sequence[tuple[int, JobOutcome]]:
        """Give what has been done."""


class Journal(Protocol):
    """What must outlive the broker."""

    def recall(self, owner: Owner) -> Memo:
        """Give what an earlier run has noted of a vehicle; nothing, if nothing."""

    def put(self, note: Note) -> None:
        """Leave a page to be written; the newest of a vehicle counts."""

    def take_settled(self) -> Sequence[tuple[Owner, int]]:
        """Give the numbers of the pages that are on the disk by now, or were refused."""


class NoJobs:
    """Does nothing beside the loop."""

    def __init__(self) -> None:
        self._refused: list[tuple[int, JobOutcome]] = []

    def put(self, system: int, job: Job) -> None:
        """Refuse a job."""
        self._refused.append((system, JobFailed(job.number, "nobody is there to do it")))

    def take_finished(self) -> Sequence[tuple[int, JobOutcome]]:
        """Give what has been refused."""
        refused, self._refused = self._refused, []
        return refused
