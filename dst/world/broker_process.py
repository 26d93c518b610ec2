"""The real broker, without threads: its loop, edge client, spool and journal on a virtual clock."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from http import HTTPStatus
from itertools import count
from pathlib import Path
from random import Random
from typing import Any, Final

from requests import RequestException

from afarcloud.enumerations import Status
from dst.scheduler import Clock, Scheduler
from dst.vehicles.pictures import PictureJobs
from dst.world import http_wire
from dst.world.disk import Disk
from dst.world.edge_process import EdgeDownError, EdgeProcess
from dst.world.owed import STORED_AFTER_S, Owed
from mavlink_broker.app import App
from mavlink_broker.config import Config
from mavlink_broker.database import Database
from mavlink_broker.edge.bounded_http import Answer, BoundedHttp
from mavlink_broker.edge.client import RETRY_WORK_S, EdgeClient, Pause, headers_of
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.spool import MIB, Spool
from mavlink_broker.links.url import Address
from mavlink_broker.recovery.journal import RETRY_AFTER_S, JournalTable, JournalWriter
from mavlink_broker.vehicle.recovery_state import RecordUpdate, RecoveryRecord, VehicleIdentity

IDLE_STEP_S: Final = 0.5
"""Period of the loop without datagrams."""
QUIET_STEP_S: Final = 10.0
"""Period of the loop, and of the look for posts, while no vehicle is switched on."""
QUIET_AFTER_S: Final = 120.0
"""Without a datagram for this time, every vehicle is taken for switched off."""
WAKE_S: Final = 0.02
"""Datagrams that arrive within this time are taken together."""
POLL_S: Final = 0.5
"""How often a long poll looks for new work."""
LONG_POLL_S: Final = 20.0
SENDERS: Final = 2
UPDATE_INTERVALS_S: Final = (None, "5", "10")
"""Of which an edge server on a slow line asks for one; None: the usual one."""
LOOK_S: Final = 1.0
"""How often senders that wait look whether a post is due again; a new post ends their wait."""
STALL_S: Final = 10.0
"""How long a client waits for an answer that does not come."""
LASTING_SHARE: Final = 0.5
"""Of the reports that always fail: they do so also when the other faults have ended."""
INTERNAL_ERROR: Final = Answer(500, b'{"error": {"code": "internal", "message": "internal error"}}')
STATE_VECTOR_S: Final = 30.0

Arrival = tuple[Answer | Exception, float]
"""What arrives of an answer, and after how long [s]."""


class EdgeHttp:
    """HTTP between broker and edge server: requests and answers may be late or lost."""

    def __init__(self, scheduler: Scheduler, edge: EdgeProcess) -> None:
        self._scheduler = scheduler
        self._random = scheduler.random("edge HTTP")
        self.edge = edge
        self.is_up = True
        self.request_loss = 0.0
        self.answer_loss = 0.0
        self.stall_rate = 0.0
        self.foreign_rate = 0.0
        """How often somebody else answers: a proxy, a captive portal."""
        self.poison_rate = 0.0
        """How often a report of a running mission fails with 500, for good: a fault that one
        report meets in the edge server, while others are taken."""
        self._poison = scheduler.random("poisoned reports")
        self._poisoned: dict[str | None, tuple[bool, bool]] = {}
        # By idempotency key: whether it fails, and whether it does so also after the faults' end
        self.portal: bytes | None = None
        """What answers each request in the edge server's place."""
        self.cut_rate = 0.0
        """How often the edge server is out of reach just after an answer with work, or in place of
        the answer to the report that ends a mission."""
        self.on_cut: Callable[[], None] = lambda: None
        """Called when it is; whoever sets it ends this."""
        self._cuts = scheduler.random("cuts after answers")
        self.owed = Owed(scheduler)
        self.delay_s = 0.005
        intervals = UPDATE_INTERVALS_S
        self._update_interval = scheduler.random("update interval").choice(intervals)
        self.on_taken: Callable[[Post, Answer], None] = lambda _post, _answer: None
        """Called when the edge server has answered a post, whether or not the answer arrives."""
        self.on_accepted: Callable[[], None] = lambda: None
        """Called when the edge server has taken the broker's acceptance of some work."""
        self.on_answered: Callable[[Post, Answer], None] = lambda _post, _answer: None
        """As `on_taken`, for the counters."""
        self.on_change: list[Callable[[Post, Answer], None]] = []
        """As `on_taken`, for the faults."""

    @property
    def is_perfect(self) -> bool:
        """Whether each request is answered."""
        rates = self.request_loss, self.answer_loss, self.stall_rate, self.foreign_rate
        is_cut = self.cut_rate > 0.0 or self.portal is not None
        return self.is_up and not is_cut and not any((*rates, self.poison_rate))

    def restore(self) -> None:
        """Have each request answered."""
        self.is_up, self.portal = True, None
        self.request_loss = self.answer_loss = self.stall_rate = 0.0
        self.foreign_rate = self.poison_rate = self.cut_rate = 0.0

    def exchange(
        self,
        method: str,
        path: str,
        post: Post | None,
        settle: Callable[[Answer | Exception], None],
    ) -> None:
        """Send a request of the broker; `settle` takes the answer, later."""

        def serve() -> None:
            arrived, delay_s = self._obstacle(method, path, post) or self._served(
                method, path, post
            )
            if post is not None:
                self.owed.note(post, arrived)
            self._scheduler.after(delay_s, lambda: settle(arrived))

        self._scheduler.after(self.delay_s, serve)

    def _obstacle(self, method: str, path: str, post: Post | None) -> Arrival | None:
        """Give what arrives of a request that the edge server does not get, and when."""
        if not self.is_up or self._random.random() < self.request_loss:
            return RequestException("no connection"), self.delay_s
        if self.portal is not None or self._random.random() < self.foreign_rate:
            foreign = self.portal or self._random.choice(http_wire.FOREIGN_ANSWERS)
            return self._read(foreign), self.delay_s
        if post is not None and self._fails_always(post):
            self._scheduler.note("broker", "edge server", f"{method} {path} 500")
            return INTERNAL_ERROR, self.delay_s
        return None

    def _served(self, method: str, path: str, post: Post | None) -> Arrival:
        """Have the edge server answer; gives what arrives, and when."""
        body, headers = (None, {}) if post is None else (post.body, headers_of(post))
        waited_s = self.edge.disk.waited_s
        try:
            response = self.edge.request(method, path, "broker", body, headers)
        except EdgeDownError as error:
            return RequestException(str(error)), self.delay_s
        delay_s = self.delay_s + self.edge.disk.waited_s - waited_s
        answer = Answer(response.status, response.body, self._update_interval)
        if post is not None:
            text = f"{method} {path} {answer.status_code}{_facts_of(post)}"
            self._scheduler.note("broker", "edge server", text)
            self.owed.take(post, answer)
            self.on_taken(post, answer)
            self.on_answered(post, answer)
            for note in self.on_change:
                note(post, answer)
            if post.is_acceptance and answer.status_code < HTTPStatus.BAD_REQUEST:
                self.on_accepted()
        if self._is_cut(post, answer):
            self.is_up = False
            self.on_cut()
            if post is not None:
                return RequestException("connection lost"), self.delay_s
        if self._random.random() < self.answer_loss:
            whole = http_wire.answer_bytes(answer.status_code, answer.body)
            return self._read(*http_wire.broken(whole, self._random)), delay_s
        if delay_s > STALL_S or self._random.random() < self.stall_rate:
            return RequestException("no answer in time"), STALL_S
        return answer, delay_s

    def _is_cut(self, post: Post | None, answer: Answer) -> bool:
        """Whether the connection is lost with an answer that matters."""
        if not self.cut_rate:
            return False
        if post is None:
            matters = b'"commands":[{' in answer.body.replace(b" ", b"")
        else:
            matters = post.body.get("mission_status_id", 0) > Status.RUNNING
        return matters and self._cuts.random() < self.cut_rate

    def _read(self, data: bytes, is_reset: bool = False) -> Answer | Exception:  # noqa: FBT001, FBT002  # as `broken` gives it
        """Read what arrives with the broker's client."""
        with http_wire.serving(lambda _request: (data, is_reset)), BoundedHttp() as http:
            try:
                return http.exchange(
                    "GET", "http://edge/", within_s=60.0, timeouts_s=(5.0, 5.0), max_bytes=MIB
                )
            except RequestException as error:
                return error

    def _fails_always(self, post: Post) -> bool:
        """Whether a report meets a fault of the edge server at each attempt."""
        key = post.idempotency_key
        if post.body.get("mission_status_id") != Status.RUNNING:
            return False
        if key not in self._poisoned:
            is_poisoned = self._poison.random() < self.poison_rate
            is_lasting = self._poison.random() < LASTING_SHARE
            self._poisoned[key] = is_poisoned, is_lasting
        is_poisoned, is_lasting = self._poisoned[key]
        return is_poisoned and (is_lasting or self.poison_rate > 0.0)

    def is_lasting(self, key: str) -> bool:
        """Whether a report fails for good."""
        return all(self._poisoned.get(key, (False, False)))


def _facts_of(post: Post) -> str:
    """Give what a post says of a mission or an event, for the trace."""
    body = post.body
    if "mission_status_id" in body:
        return f": mission {body['mission_id']} {Status(body['mission_status_id']).name}"
    if post.path.endswith("/ack"):
        return f": {body['status']} {body.get('message') or ''}"
    return ""


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
        self._started_s = 0.0
        self._received: list[tuple[Address, bytes]] = []
        self._is_due = False
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
    def was_restarted(self) -> bool:
        """Whether it was ever killed."""
        return self._starts > 1

    def start(self) -> None:
        """Start on what is on the disk."""
        self._starts += 1
        self._started_s = self._scheduler.now_s
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
        disk_worked_s = self._scheduler.now_s - self.disk.troubled_s
        self.may_lack_records |= disk_worked_s < STORED_AFTER_S
        self._http.owed.broker_ends(self._http.is_lasting, disk_worked_s=disk_worked_s)
        if self._journal is not None:
            self._journal.end()
        if self._database is not None:
            self._database.close()
        self.app = self.client = self._database = self._journal = None
        self._received.clear()
        self._idle_senders = 0

    # The link.

    def arrive(self, address: Address, frame: bytes) -> None:
        """Handle a datagram of a vehicle; lost if the broker does not run."""
        if self.is_up:
            self._received_s = self._scheduler.now_s
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
        if self.app is not None:
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
        post = client.take_post()
        if post is None:
            self._idle_senders += 1
            return

        def settle(answer: Answer | Exception) -> None:
            if self.client is client:
                client.settle(post, answer)
                self._send_posts(start)

        self._http.exchange(post.method, post.path, post, settle)

    def _poll(self, start: int) -> None:
        """Ask for work without a wait, and look again when there may be some."""
        client = self.client
        if client is None or self._starts != start:
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
                self._scheduler.after(RETRY_WORK_S, lambda: self._poll(start))

        self._http.exchange("GET", poll.path.partition("&wait=")[0] + "&wait=0", None, settle)

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
