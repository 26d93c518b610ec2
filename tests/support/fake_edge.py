"""The edge server's API for the broker in memory: work out, reports in.

`FakeEdge` stands in the broker's own process and answers at once; `FakeEdgeServer` serves the
same over HTTP and can fail on request.
"""

import json
import ssl
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

from afarcloud.enumerations import Status
from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.wire import AcceptanceResult


class FakeEdge:
    """Keeps work and reports; a mission's work closes with its terminal report."""

    def __init__(self) -> None:
        self.posts: list[Post] = []
        self.work: dict[int, dict[str, Any]] = {}
        self.closed: set[int] = set()
        self._new: list[dict[str, Any]] = []
        self._acceptance_results: list[AcceptanceResult] = []
        self.dead_letters: dict[int, int] = {}  # By vehicle
        self.update_intervals: dict[int, float] = {}  # By vehicle
        self.is_stalled = False  # Stores nothing: what is posted is lost if the broker is killed
        self.answers_acceptances = True  # False while it is slow or unreachable

    # What tests do.

    def plan(
        self,
        mission: dict[str, Any],
        *,
        expires_at: str | None = None,
        geofence: dict[str, Any] | None = None,
        rally_points: Sequence[dict[str, Any]] = (),
    ) -> int:
        """Hand out a mission; gives the number of the work."""
        number = len(self.work) + 1
        self.work[number] = {
            "id": number,
            "kind": "mission",
            "vehicle_id": mission["vehicle_id"],
            "plan_id": f"01PLAN{number}",
            "expires_at": expires_at,
            "state": "queued",
            "mission": mission,
            "geofence": geofence,
            "rally_points": list(rally_points),
            "report": None,
        }
        self._new.append(dict(self.work[number]))
        return number

    def event(
        self, kind: int, vehicle_id: int = 1, identity: str | None = None, **more: Any
    ) -> int:
        """Hand out an event; an older edge server gives no identity."""
        number = len(self.work) + 1
        event = {"sequence_number": number, "vehicle_id": vehicle_id, "event_type_id": kind}
        self.work[number] = {
            "id": number,
            "kind": "event",
            "vehicle_id": vehicle_id,
            "identity": identity,
            "expires_at": None,
            "state": "queued",
            "event": event | more,
        }
        self._new.append(dict(self.work[number]))
        return number

    def request_state(self, vehicle_id: int | None = None) -> int:
        """Request a fresh state vector."""
        number = len(self.work) + 1
        self.work[number] = {
            "id": number,
            "kind": "latest_state_vector",
            "vehicle_id": vehicle_id,
            "sequence_number": number,
            "expires_at": None,
        }
        self._new.append(dict(self.work[number]))
        return number

    def hand_out_again(self) -> None:
        """Give all unfinished work once more, as to a broker that was restarted."""
        self._new = [dict(w) for n, w in self.work.items() if n not in self.closed]

    def cancel(self, number: int) -> None:
        """Withdraw work whose acceptance has not arrived."""
        self.closed.add(number)
        self._acceptance_results = [
            AcceptanceResult(v.work_id, v.is_confirmed and v.work_id != number)
            for v in self._acceptance_results
        ]

    def fail_acceptance(self, number: int, reason: str) -> None:
        """Have the acceptance of work given up, as the edge client does after many failures."""
        self.work[number]["state"] = "queued"
        self._acceptance_results = [v for v in self._acceptance_results if v.work_id != number]
        self._acceptance_results.append(AcceptanceResult(number, False, reason, has_failed=True))

    def bodies(self, path: str) -> list[dict[str, Any]]:
        """Bodies of all posts to a path, in order."""
        return [post.body for post in self.posts if post.path == path]

    def reports(self, mission_id: int) -> list[dict[str, Any]]:
        """Reports of one mission."""
        return [b for b in self.bodies("/mission_report/") if b["mission_id"] == mission_id]

    def statuses(self, mission_id: int) -> list[int]:
        """Statuses of one mission's commands as last reported."""
        report = self.reports(mission_id)[-1]
        return [c["command_status_id"] for c in report["command_report_array"]]

    def status(self, mission_id: int) -> int | None:
        """Status of one mission as last reported."""
        reports = self.reports(mission_id)
        return reports[-1]["mission_status_id"] if reports else None

    def acknowledgements(self, number: int) -> list[dict[str, Any]]:
        """Acknowledgements of one piece of work, in order."""
        return self.bodies(f"/broker/commands/{number}/ack")

    # What the broker does.

    def take_work(self) -> list[dict[str, Any]]:
        """Give new work."""
        work, self._new = self._new, []
        return work

    def take_acceptance_results(self) -> list[AcceptanceResult]:
        """Give the answers to what was accepted."""
        if not self.answers_acceptances:
            return []
        results, self._acceptance_results = self._acceptance_results, []
        return results

    waiting_pictures = 0

    def update_interval_of(self, vehicle_id: int) -> float | None:
        """What a test has set."""
        return self.update_intervals.get(vehicle_id)

    def dead_letters_of(self, vehicle_id: int) -> int:
        """Give what the test has set."""
        return self.dead_letters.get(vehicle_id, 0)

    def post(self, post: Post) -> None:
        """Take a post; it is answered at once."""
        if self.is_stalled:
            return
        self.posts.append(post)
        if post.path.endswith("/ack"):
            self._acknowledged(int(post.path.split("/")[3]), post.body["status"])
        elif post.path == "/mission_report/":
            self._reported(post.body)

    def _acknowledged(self, number: int, status: str) -> None:
        if status == "accepted":
            holds = number not in self.closed
            self._acceptance_results.append(AcceptanceResult(number, is_confirmed=holds))
            if holds:
                self.work[number]["state"] = "accepted"
        else:
            self.closed.add(number)
            self._changed_speed(self.work[number], status)

    def _changed_speed(self, work: dict[str, Any], status: str) -> None:
        """A new speed that is done is that of the mission that flies."""
        speed = work.get("event", {}).get("maximum_speed")
        if status == "done" and speed is not None:
            missions = (w for n, w in self.work.items() if "mission" in w and n not in self.closed)
            for flown in list(missions)[:1]:
                flown["mission"] = flown["mission"] | {"maximum_speed": speed}

    def _reported(self, report: dict[str, Any]) -> None:
        for number, work in reversed(self.work.items()):
            mission = work.get("mission")
            if number in self.closed or mission is None:
                continue
            if mission["mission_id"] == report["mission_id"]:
                work["report"] = _merged(work["report"], report)
                if Status(report["mission_status_id"]).is_terminal:
                    self.closed.add(number)
                return


def _accepts_everything(path: str, body: dict[str, Any]) -> int | None:
    """Give the status of the answer to a body that is always refused; None: it is accepted."""
    del path, body
    return None


def _merged(before: dict[str, Any] | None, report: dict[str, Any]) -> dict[str, Any]:
    """Keep the statuses of commands that a later report leaves out."""
    reported = [] if before is None else before["command_report_array"]
    known = {one["command_id"]: one for one in (*reported, *report["command_report_array"])}
    return report | {"command_report_array": list(known.values())}


class FakeEdgeServer:
    """A `FakeEdge` behind HTTP on the loopback."""

    def __init__(self, port: int, key: str) -> None:
        self.edge = FakeEdge()
        self.key = key
        self.judge: Callable[[str, dict[str, Any]], int | None] = _accepts_everything
        self.failures: deque[int] = deque()  # Status codes of the next POST and PUT answers
        self.keys_seen: list[tuple[str, str | None]] = []
        self.instances_seen: set[tuple[str, str | None]] = set()  # By method
        self._changed = threading.Condition()
        self._server = ThreadingHTTPServer(("127.0.0.1", port), self._handler())
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,))

    @property
    def url(self) -> str:
        """Where it is."""
        return f"http://127.0.0.1:{self._server.server_address[1]}"

    def plan(self, mission: dict[str, Any]) -> int:
        """Hand out a mission to the broker that polls."""
        with self._changed:
            number = self.edge.plan(mission)
            self._changed.notify_all()
            return number

    def event(self, kind: int, vehicle_id: int = 1) -> int:
        """Hand out an event to the broker that polls."""
        with self._changed:
            number = self.edge.event(kind, vehicle_id)
            self._changed.notify_all()
            return number

    def wait_for(self, path: str, count: int, timeout_s: float = 10.0) -> list[dict[str, Any]]:
        """Wait until so many bodies have come to a path; gives what has come."""
        with self._changed:
            self._changed.wait_for(lambda: len(self.edge.bodies(path)) >= count, timeout_s)
            return self.edge.bodies(path)

    def use_tls(self, context: ssl.SSLContext) -> None:
        """Serve HTTPS; to be called before `running`."""
        self._server.socket = context.wrap_socket(self._server.socket, server_side=True)

    @contextmanager
    def running(self) -> Iterator["FakeEdgeServer"]:
        """Serve for as long as the context lasts."""
        self._thread.start()
        try:
            yield self
        finally:
            self._server.shutdown()
            self._server.server_close()
            self._thread.join()

    def work_after(self, after: int, wait_s: float) -> dict[str, Any]:
        """Answer a long poll: the work behind a cursor, or none after `wait_s`."""

        def unfinished() -> list[dict[str, Any]]:
            edge = self.edge
            return [w for n, w in edge.work.items() if n > after and n not in edge.closed]

        with self._changed:
            self._changed.wait_for(lambda: bool(unfinished()), min(wait_s, 1.0))
            commands = unfinished()
            return {"cursor": max((c["id"] for c in commands), default=after), "commands": commands}

    def accept(self, method: str, path: str, key: str | None, body: dict[str, Any]) -> int:
        """Process a request body; returns the status code of the answer."""
        with self._changed:
            self.keys_seen.append((path, key))
            status = self.failures.popleft() if self.failures else 201
            status = self.judge(path, body) or status
            if status < 300:
                self.edge.post(
                    Post(
                        method=method,
                        path=path,
                        body=body,
                        vehicle_id=0,
                        lane="",
                        urgency=0,  # type: ignore[arg-type]  # HTTP does not carry it
                        idempotency_key=key,
                    )
                )
            self._changed.notify_all()
            return status

    def _handler(self) -> type["_Handler"]:
        return type("Handler", (_Handler,), {"fake": self})


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    wbufsize = -1  # One packet per answer: the second would wait for the first's receipt
    disable_nagle_algorithm = True
    fake: FakeEdgeServer

    def log_message(self, *_: Any) -> None:
        """Keep quiet."""

    def do_GET(self) -> None:
        query = parse_qs(urlsplit(self.path).query)
        if self._is_allowed():
            after, wait = int(query["after"][0]), float(query["wait"][0])
            self._answer(200, self.fake.work_after(after, wait))

    def do_POST(self) -> None:
        self._take("POST")

    def do_PUT(self) -> None:
        self._take("PUT")

    def _take(self, method: str) -> None:
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        if self._is_allowed():
            key = self.headers.get("Idempotency-Key")
            self._answer(self.fake.accept(method, self.path, key, body), {})

    def _is_allowed(self) -> bool:
        self.fake.instances_seen.add((self.command, self.headers.get("Broker-Instance")))
        allowed = self.headers.get("Authorization") == f"Bearer {self.fake.key}"
        if not allowed:
            self._answer(401, {})
        return allowed

    def _answer(self, status: int, body: dict[str, Any]) -> None:
        data = json.dumps(body).encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)
