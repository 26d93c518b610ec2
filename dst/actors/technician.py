"""The technician: sends what was given up again, and may send a report twice.

A report that the edge server has taken may come once more without its key: from a proxy, from a
broker of an earlier version, from a person with the log in hand. It is the same report, of the same
flight.
"""

from collections.abc import Collection
from typing import Final

from afarcloud.enumerations import Status
from dst.faults.kinds import Fault
from dst.world.edge_process import EdgeDownError
from dst.world.world import World
from mavlink_broker.database import add_requests
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.spool import read_dead_letters

LOOK_S: Final = 30.0
LATEST_REPETITION_S: Final = 40.0
REPEATED_SHARE: Final = 0.8


class Technician:
    """A person at the broker's machine."""

    def __init__(self, world: World, enabled: Collection[Fault]) -> None:
        self._world = world
        self._random = world.scheduler.random("technician")
        self._repeats_reports = Fault.REPEATED_POSTS in enabled
        if Fault.REPORT_ALWAYS_FAILS in enabled:
            world.scheduler.every(LOOK_S, self._retry_dead_letters)

    def note(self, post: Post, answer: Answer) -> None:
        """Take a report that the edge server has answered, perhaps to send it again."""
        is_end = post.body.get("mission_status_id", 0) > Status.RUNNING
        if self._repeats_reports and is_end and answer.status_code < 300:
            pause_s = self._random.uniform(0.0, LATEST_REPETITION_S)
            if self._random.random() < REPEATED_SHARE:
                self._world.scheduler.after(pause_s, lambda: self._send_again(post))

    def _send_again(self, post: Post) -> None:
        world = self._world
        try:
            status = world.edge.request(post.method, post.path, "broker", post.body).status
        except EdgeDownError:
            return
        text = f"mission {post.body['mission_id']} once more: {status}"
        world.scheduler.note("technician", "edge server", text)

    def _retry_dead_letters(self) -> None:
        """Have the broker send again what it has given up."""
        machine = self._world.broker_machine
        try:
            numbers = [letter.number for letter in read_dead_letters(machine.disk.folder)]
            if numbers:
                add_requests(machine.disk.folder, "retry", numbers)
        except OSError:
            return
        if numbers:
            text = f"retry {len(numbers)} dead letters"
            self._world.scheduler.note("technician", "broker", text)
