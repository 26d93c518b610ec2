"""HTTP between broker and edge server: answers that are late, lost, cut or of another program."""

from collections.abc import Callable
from http import HTTPStatus
from typing import Final

from requests import RequestException

from afarcloud.enumerations import Status
from dst.scheduler import Scheduler
from dst.world import http_wire
from dst.world.edge_process import EdgeDownError, EdgeProcess
from dst.world.owed import Owed
from mavlink_broker.edge.bounded_http import Answer, BoundedHttp
from mavlink_broker.edge.client import headers_of
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.spool import MIB

STALL_S: Final = 10.0
"""How long a client waits for an answer that does not come."""
LASTING_SHARE: Final = 0.5
"""Of the reports that always fail: they do so also when the other faults have ended."""
INTERNAL_ERROR: Final = Answer(500, b'{"error": {"code": "internal", "message": "internal error"}}')
UPDATE_INTERVALS_S: Final = (None, "5", "10")
"""Of which an edge server on a slow line asks for one; None: the usual one."""

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
        life = self.owed.life

        def serve() -> None:
            arrived, delay_s = self._obstacle(method, path, post) or self._served(
                method, path, post
            )
            if post is not None and life == self.owed.life:
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
