"""Killed -9 again and again while it has much to send: nothing is lost, nothing out of order.

The edge server is away, refuses for now, or is there. Some deaths leave a torn log behind.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Final

from mavlink_broker.database import DATABASE_FILE
from tests.soak.spool_client import KEY_FILE, LANES, SPOOL, client_in
from tests.support.fake_edge import FakeEdgeServer
from tests.support.system import ROOT, wait_for

NOWHERE: Final = "http://127.0.0.1:9"
LONGEST_LIFE_S: Final = 1.0
MOST_REFUSALS: Final = 3
TORN: Final = b"\x00\x00\x00\x07 not a whole frame"
_GAP: Final = 1000
"""Numbers are never used again, also those that a dead broker had not printed yet."""


@dataclass(slots=True)
class Outcome:
    """What a run has come to."""

    safe: set[int] = field(default_factory=set)  # Numbers that must not be lost any more
    arrived: dict[str, list[int]] = field(default_factory=dict)  # By line, in order, once each
    sent_twice: int = 0


def run(cycles: int, folder: Path, seed: int, print_line: Callable[[str], None]) -> Outcome:
    """Kill so often, let the last one send all; raises AssertionError on a loss."""
    random, outcome = Random(seed), Outcome()
    key = f"key-{seed}"
    (folder / KEY_FILE).write_text(key, encoding="ascii")
    with FakeEdgeServer(0, key).running() as server:
        for _ in range(cycles):
            server.failures.extend([503] * random.randint(0, MOST_REFUSALS))
            _live_and_die(random.choice((NOWHERE, server.url, server.url)), folder, random, outcome)
            server.failures.clear()
        client, spool = client_in(folder, server.url)
        print_line(f"{client.waiting} reports left, {spool.damaged} damaged")
        wait_for(lambda: not client.waiting, "the last message")
        client.stop(1.0)
        spool.database.close()
        _judge(server, outcome)
    print_line(
        f"{len(outcome.safe)} reports were safe and arrived; {outcome.sent_twice} were sent twice"
    )
    return outcome


def _live_and_die(url: str, folder: Path, random: Random, outcome: Outcome) -> None:
    first = max(outcome.safe, default=0) + _GAP
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.soak.spool_client", url, str(folder), str(first)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    with process:
        assert process.stdout is not None
        printed = process.stdout.readline()
        time.sleep(random.uniform(0.0, LONGEST_LIFE_S))
        os.kill(process.pid, signal.SIGKILL)
        printed += process.stdout.read()
    outcome.safe |= {int(line) for line in printed.split("\n")[:-1]}
    log = folder / SPOOL / f"{DATABASE_FILE}-wal"
    if log.exists() and random.random() < 0.2:
        with log.open("ab") as file:
            file.write(TORN)


def _judge(server: FakeEdgeServer, outcome: Outcome) -> None:
    keys: dict[str, int] = {}
    for post in server.edge.posts:
        keys.setdefault(str(post.idempotency_key), post.body["sequence_number"])
    outcome.sent_twice = len(server.edge.posts) - len(keys)
    for lane in LANES:
        numbers = [number for key, number in keys.items() if key.startswith(lane)]
        assert numbers == sorted(numbers), f"{lane} is out of order"
        outcome.arrived[lane] = numbers
    lost = outcome.safe - {number for numbers in outcome.arrived.values() for number in numbers}
    assert not lost, f"{len(lost)} reports are lost: {sorted(lost)[:10]}"
