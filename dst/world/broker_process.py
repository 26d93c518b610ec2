"""The real broker, without threads: its loop, edge client, spool and journal on a virtual clock."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path
from random import Random
from typing import Any, Final

from dst.scheduler import Clock, Scheduler
from dst.vehicles.pictures import PictureJobs
from dst.world.disk import Disk
from dst.world.edge_http import EdgeHttp
from dst.world.owed import STORED_AFTER_S
from mavlink_broker.app import App
from mavlink_broker.config import Config
from mavlink_broker.database import Database
from mavlink_broker.edge.bounded_http import Answer
from mavlink_broker.edge.client import RETRY_WORK_S, EdgeClient, Pause
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.spool import MIB, Spool
from mavlink_broker.journal import RETRY_AFTER_S, JournalTable, JournalWriter
from mavlink_broker.links.url import Address
from mavlink_broker.vehicle.recovery_state import RecordUpdate, RecoveryRecord, VehicleIdentity

IDLE_STEP_S: Final = 0.5
"""Period of the loop without datagrams."""
QUIET_STEP_S: Final = 10.0
"""Period of the loop, and of the look for posts, while no vehicle is switched on."""
QUIET_AFTER_S: Final = 120.0
"""Without a datagram for this time, every vehicle is taken for switched off."""
BUFFERED: Final = 100
"""Datagrams that a suspended broker's socket keeps, the oldest: those of some three seconds.

Linux keeps 212,992 bytes, some 277 small datagrams; vehicles here send fewer than real ones do.
"""
WAKE_S: Final = 0.02
"""Datagrams that arrive within this time are taken together."""
POLL_S: Final = 0.5
"""How often a long poll looks for new work."""
LONG_POLL_S: Final = 20.0
SENDERS: Final = 2
LOOK_S: Final = 1.0
"""How often senders that wait look whether a post is due again; a new post ends their wait."""
STATE_VECTOR_S: Final = 30.0


class Journal:
    """The broker's journal, written a while later; what is not written is lost by a kill."""

    def __init__(self, scheduler: Scheduler, table: JournalTable, lag_s: float) -> None:
        self._scheduler = scheduler
        self._lag_s = lag_s
        self._writer = JournalWriter(table, lambda: None)
        self._is_ended = False

    def recall(self, identity: VehicleIdentity) -> RecoveryRecord:
        """Give the record of a vehicle."""
        return self._writer.recall(identity)

    def put(self, update: RecordUpdate) -> None:
        """Queue a record to be written."""
        self._writer.put(update)
        self._scheduler.after(self._lag_s, self._write)

    def take_settled(self) -> list[tuple[VehicleIdentity, int]]:
        """Give the updates that were written or refused."""
        return self._writer.take_settled()

    def end(self) -> None:
        """Write nothing any more."""
        self._is_ended = True

    def _write(self) -> None:
        if not self._is_ended and not self._writer.write_due():
            self._scheduler.after(RETRY_AFTER_S, self._write)


class _Client(EdgeClient):
    """The edge client, which calls `on_post` where it wakes its threads."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.on_post: Callable[[], None] = lambda: None

    def post(self, post: Post) -> None:
        """Queue a post to be sent."""
        super().post(post)
        self.on_post()


class BrokerProcess:
    """The broker's process; killed and started at any time, its state folder stays."""

    def __init__(
        self,
        scheduler: Scheduler,
        http: EdgeHttp,
        folder: Path,
        disk: Disk,
        clock: Clock,
        send: Callable[[Address, bytes], None],
        *,
        journal_lag_s: float = 0.01,
    ) -> None:
        """Start; `disk` has the folder, `send` takes each frame to a vehicle."""
        folder.mkdir()
        self.disk = disk
        self.download_failure_share = 0.0
        """Of the pictures."""
        self.may_lack_records = False
        """Whether it was killed while its disk refused what it has to restore on its vehicles."""
        self.clock = clock
        self._scheduler = scheduler
        self._http = http
        self._folder = folder
        self._send = send
        self._journal_lag_s = journal_lag_s
        self._ulids = count(1)
        self._starts = 0
        self.started_s = 0.0
        self._received: list[tuple[Address, bytes]] = []
        self._is_due = False
        self.is_suspended = False
        self.resumed_s = 0.0
        """When it last went on after it was suspended."""
        self._postponed: list[Callable[[], None]] = []  # What its threads do when they run again
        self._idle_senders = 0
        self._received_s = 0.0
        self._stepped_s = -IDLE_STEP_S
        self.app: App | None = None
        self.client: EdgeClient | None = None
        self._database: Database | None = None
        self._journal: Journal | None = None
        self.start()

    @property
    def is_up(self) -> bool:
        """Whether it runs."""
        return self.app is not None

    @property
    def is_running(self) -> bool:
        """Whether it is up, and not suspended."""
        return self.is_up and not self.is_suspended

    @property
    def was_restarted(self) -> bool:
        """Whether it was ever killed."""
        return self._starts > 1

    def start(self) -> None:
        """Start on what is on the disk."""
        self._starts += 1
        self.started_s = self._scheduler.now_s
        start, scheduler = self._starts, self._scheduler
        database = self._database = Database(self._folder)
        with suppress(OSError):  # As the program: spool and journal log it
            database.open()
        spool = _spool(database)
        client = self.client = _Client(
            "http://edge",
            self._folder / "broker.key",
            self.wake,
            spool=spool,
            clock=self.clock.monotonic,
            jitter=Random(f"{scheduler.seed}/jitter/{start}"),
        )
        client.on_post = self._wake_senders
        config = replace(Config(), state_vector_every_s=STATE_VECTOR_S)
        lag_s = self._journal_lag_s + 2.0 * self.disk.sync_s
        journal = self._journal = Journal(scheduler, JournalTable(database), lag_s)
        jobs = PictureJobs(scheduler, self.wake, lambda: self.download_failure_share)
        self.app = App(config, self, client, self.clock, self._new_ulid, jobs, journal)

        def while_up(period_s: float, action: Callable[[], None]) -> None:
            def act() -> None:
                if self._starts == start and self.is_up:
                    if self.is_running:
                        action()
                    scheduler.after(self._period(period_s), act)

            scheduler.after(0.0, act)

        while_up(IDLE_STEP_S, self._step_if_idle)
        while_up(1.0, client.update_spool)
        while_up(LOOK_S, self._wake_senders)
        for _ in range(SENDERS):
            self._send_posts(start)
        self._poll(start)

    def kill(self) -> None:
        """Lose everything that is not on the disk."""
        worked_since_s = max(self.disk.troubled_s, self.resumed_s)
        disk_worked_s = self._scheduler.now_s - worked_since_s if self.is_running else 0.0
        self.may_lack_records |= disk_worked_s < STORED_AFTER_S
        self._http.owed.broker_ends(self._http.is_lasting, disk_worked_s=disk_worked_s)
        if self._journal is not None:
            self._journal.end()
        if self._database is not None:
            self._database.close()
        self.app = self.client = self._database = self._journal = None
        self._received.clear()
        self._postponed.clear()
        self.is_suspended = False
        self._idle_senders = 0

    def suspend(self) -> None:
        """Stand still, as a process that was stopped or one of a machine that sleeps."""
        self.is_suspended = self.is_up

    def resume(self) -> None:
        """Go on with what has waited meanwhile."""
        if self.is_suspended:
            self.is_suspended = False
            self.resumed_s = self._scheduler.now_s
            postponed, self._postponed = self._postponed, []
            for action in postponed:
                action()
            self.wake()

    def _when_running(self, action: Callable[[], None]) -> None:
        """Do something now, or when the process goes on."""
        if self.is_suspended:
            self._postponed.append(action)
        else:
            action()

    # The link.

    def arrive(self, address: Address, frame: bytes) -> None:
        """Handle a datagram of a vehicle; lost if the broker does not run."""
        if self.is_up:
            self._received_s = self._scheduler.now_s
            if self.is_suspended and len(self._received) >= BUFFERED:
                return
            self._received.append((address, frame))
            self.wake()

    def receive(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        """Give what has arrived; there is no waiting here."""
        del timeout_s
        received, self._received = self._received, []
        return received

    def send(self, address: Address, frame: bytes) -> None:
        """Send a frame to a vehicle; nothing is sent without power."""
        if not self.disk.is_dead:
            self._send(address, frame)

    def radio_status(self, address: Address, free_percent: int) -> None:
        """Ignore it: there is no radio with a buffer."""

    def contact_addresses(self) -> list[Address]:
        """Nobody: vehicles send first."""
        return []

    # Steps.

    def _period(self, period_s: float) -> float:
        """Give the period of something, which is longer while every vehicle is switched off."""
        is_quiet = self._scheduler.now_s - self._received_s > QUIET_AFTER_S
        return QUIET_STEP_S if is_quiet else period_s

    def wake(self) -> None:
        """Have the loop run soon."""
        if not self._is_due:
            self._is_due = True
            self._scheduler.after(WAKE_S, self._step)

    def _step_if_idle(self) -> None:
        """Run the loop unless a datagram has just done so, which ends its wait."""
        if self._scheduler.now_s - self._stepped_s >= IDLE_STEP_S:
            self._step()

    def _step(self) -> None:
        self._is_due = False
        if self.app is not None and self.is_running:
            self._stepped_s = self._scheduler.now_s
            self.app.step(0.0)

    def _wake_senders(self) -> None:
        """Have every sender that waits look for posts."""
        waiting, self._idle_senders = self._idle_senders, 0
        for _ in range(waiting):
            self._send_posts(self._starts)

    def _send_posts(self, start: int) -> None:
        """One sender: take a post, exchange, settle, again."""
        client = self.client
        if client is None or self._starts != start:
            return
        if self.is_suspended:
            self._postponed.append(lambda: self._send_posts(start))
            return
        post = client.take_post()
        if post is None:
            self._idle_senders += 1
            return

        def settle(answer: Answer | Exception) -> None:
            if self.client is client:
                client.settle(post, answer)
                self._send_posts(start)

        self._http.exchange(
            *(post.method, post.path, post),
            lambda answer: self._when_running(partial(settle, answer)),
        )

    def _poll(self, start: int) -> None:
        """Ask for work without a wait, and look again when there may be some."""
        client = self.client
        if client is None or self._starts != start:
            return
        if self.is_suspended:
            self._postponed.append(lambda: self._poll(start))
            return
        poll = client.next_poll()
        seen = self._http.edge.work_count

        def settle(answer: Answer | Exception) -> None:
            if self.client is not client:
                return
            pause = client.take_answer(poll, answer)
            if pause is Pause.NONE:
                self._await_work(start, seen, self._scheduler.now_s + LONG_POLL_S)
            else:
                self._scheduler.after(self._period(RETRY_WORK_S), lambda: self._poll(start))

        self._http.exchange(
            *("GET", poll.path.partition("&wait=")[0] + "&wait=0", None),
            lambda answer: self._when_running(partial(settle, answer)),
        )

    def _await_work(self, start: int, seen: int, until_s: float) -> None:
        if self._http.edge.work_count != seen or self._scheduler.now_s >= until_s:
            self._poll(start)
        else:
            self._scheduler.after(POLL_S, lambda: self._await_work(start, seen, until_s))

    def _new_ulid(self) -> str:
        return f"01{self._starts:06d}{next(self._ulids):018d}"


def _spool(database: Database) -> Spool | None:
    """Read the spool as the program does: without one where the disk refuses."""
    try:
        return Spool(database, max_bytes=16 * MIB)
    except OSError:
        return None
