"""Kill -9 under load: every acknowledged record arrives, once in effect, in order per stream.

Senders post as a broker does: one report after the other, under a key of its own, again until it
is acknowledged. Meanwhile one process after the other is killed where it stands: the relay, the
server's worker, the server's parent, the supervisor with all below it.
"""

import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Final

import requests

from tests.support.fake_cloud import FakeCloud, running_cloud
from tests.support.polling import PATIENCE_S
from tests.support.process_tree import command_words, descendants, gone
from tests.support.system import wait_for
from tests.unit.edge_server import documents
from tests.unit.edge_server.program import Program, program_in

DEATHS_FORGIVEN: Final = 3
"""Of a part, before the supervisor itself goes: it gives up at the fifth within a minute."""
_ACKNOWLEDGED_BETWEEN: Final = (1, 8)
_RETRY_S: Final = 0.02
_BULK: Final = 5


@dataclass(frozen=True, slots=True)
class Stream:
    """What one sender sends: one kind of one vehicle, alone or several in a request."""

    vehicle_id: int
    kind: str
    bulk: int = 1


STREAMS: Final = (Stream(1, "pose"), Stream(2, "alarm"), Stream(3, "state_vector", _BULK))


@dataclass(slots=True)
class Outcome:
    """What a run has come to."""

    kills: Counter[str] = field(default_factory=Counter)
    acknowledged: dict[Stream, int] = field(default_factory=dict)
    sent_again: int = 0


class Sender(threading.Thread):
    """Posts one stream without end; a report counts once it is acknowledged."""

    def __init__(self, program: Program, stream: Stream) -> None:
        super().__init__(daemon=True)
        self.stream = stream
        self.acknowledged = 0
        self._program = program
        self._stopping = threading.Event()

    def stop(self) -> None:
        """End after the present request."""
        self._stopping.set()

    def run(self) -> None:
        """Post, again and again under the same keys until it is acknowledged."""
        session = requests.Session()
        session.headers["X-API-Key"] = self._program.key("broker")
        while not self._stopping.is_set():
            try:
                accepted = self._post(session)
            except requests.RequestException:
                accepted = False
            if accepted:
                self.acknowledged += self.stream.bulk
            else:
                time.sleep(_RETRY_S)
        session.close()

    def _post(self, session: requests.Session) -> bool:
        first = self.acknowledged
        stream = self.stream
        reports = [
            documents.telemetry(stream.kind, number, stream.vehicle_id)
            for number in range(first, first + stream.bulk)
        ]
        keys = [f"{stream.vehicle_id}-{number}" for number in range(first, first + stream.bulk)]
        if stream.bulk == 1:
            answer = session.post(
                f"{self._program.url}/{stream.kind}/",
                json=reports[0],
                headers={"Idempotency-Key": keys[0]},
                timeout=PATIENCE_S,
            )
            return answer.status_code == 201
        records = [
            {stream.kind: report, "idempotency_key": key}
            for report, key in zip(reports, keys, strict=True)
        ]
        url = f"{self._program.url}/telemetry/"
        answer = session.post(url, json={"records": records}, timeout=PATIENCE_S)
        return answer.status_code == 200 and all(
            record["status"] == 201 for record in answer.json()["records"]
        )


def run(cycles: int, state_dir: Path, seed: int) -> Outcome:
    """Kill so many times under load; raises AssertionError when the promise is broken."""
    random = Random(seed)
    outcome = Outcome()
    with running_cloud() as cloud, program_in(state_dir, cloud.url) as program:
        program.start()
        with _sending(program, STREAMS) as senders:
            deaths: Counter[str] = Counter()
            for _ in range(cycles):
                _wait_for_progress(senders, random)
                victim = _choose(random, deaths)
                _kill(program, victim)
                outcome.kills[victim] += 1
                deaths[victim] += 1
                if victim == "supervisor":
                    deaths.clear()
                    program.start()
            _wait_for_progress(senders, random)
        _judge(cloud, senders, outcome)
        code, errors = program.end()
        assert code == 0, errors
    return outcome


@contextmanager
def _sending(program: Program, streams: Sequence[Stream]) -> Iterator[list[Sender]]:
    senders = [Sender(program, stream) for stream in streams]
    for sender in senders:
        sender.start()
    try:
        yield senders
    finally:
        for sender in senders:
            sender.stop()
        for sender in senders:
            sender.join()


def _wait_for_progress(senders: Sequence[Sender], random: Random) -> None:
    """Every sender gets something acknowledged: the server is there again and takes in."""
    wanted = [sender.acknowledged + random.randint(*_ACKNOWLEDGED_BETWEEN) for sender in senders]
    wait_for(
        lambda: all(s.acknowledged >= least for s, least in zip(senders, wanted, strict=True)),
        "acknowledged reports",
    )


def _choose(random: Random, deaths: Counter[str]) -> str:
    victim = random.choices(("relay", "worker", "server", "supervisor"), (3, 5, 1, 1))[0]
    return "supervisor" if deaths[victim] == DEATHS_FORGIVEN and victim != "worker" else victim


def _kill(program: Program, victim: str) -> None:
    assert program.process is not None
    if victim == "supervisor":
        below = descendants(program.process.pid)
        program.end(signal.SIGKILL)
        assert gone(below, PATIENCE_S)
        return
    found = wait_for(lambda: _find(program, victim), victim)
    os.kill(found, signal.SIGKILL)
    assert gone([found], PATIENCE_S)


def _find(program: Program, name: str) -> int | None:
    """Process id of a part, None while it is not there (again)."""
    assert program.process is not None
    for process_id in descendants(program.process.pid):
        arguments = command_words(process_id)
        is_worker = _parent(process_id) != program.process.pid
        if name == "relay" and "relay" in arguments:
            return process_id
        if "serve" in arguments and is_worker == (name == "worker"):
            return process_id
    return None


def _parent(process_id: int) -> int:
    try:
        status = Path(f"/proc/{process_id}/stat").read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return 0
    return int(status.rpartition(")")[2].split()[1])


def _judge(cloud: FakeCloud, senders: Sequence[Sender], outcome: Outcome) -> None:
    """Hold what the cloud has against what was acknowledged."""
    for sender in senders:
        stream = sender.stream
        cloud.store.wait_for_stream(stream.vehicle_id, stream.kind, sender.acknowledged)
        arrived = cloud.store.stream(stream.vehicle_id, stream.kind)
        # The last request may have been stored though its answer was lost with the sender
        assert arrived[: sender.acknowledged] == list(range(sender.acknowledged)), stream
        assert arrived == list(range(len(arrived))), stream
        outcome.acknowledged[stream] = sender.acknowledged
    outcome.sent_again = len(cloud.store.seen) - len({r.key for r in cloud.store.seen})
