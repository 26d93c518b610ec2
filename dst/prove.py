"""Prove that the laws find: `python -m dst.prove` breaks the product in one place at a time.

Each break is a mistake that was made, or that a careless change would make, in a copy of the
project. Printed is after how many seeds a law fails. Arguments choose breaks by a part of their
file's path. Exit code 0: each was found.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parents[1]
PARTS: Final = ("afarcloud", "dst", "edge_server", "farm_flight_bridge", "mavlink_broker")
SEEDS: Final = int(os.environ.get("SEEDS") or 1000)
"""Within which a mistake is to be found."""
JOBS: Final = int(os.environ.get("JOBS") or os.cpu_count() or 1)
LONGEST_S: Final = 3600.0


class Break(NamedTuple):
    """A mistake: a part of a file that occurs once, and what replaces it."""

    mistake: str
    file: str
    line: str
    broken: str


BREAKS: Final = (
    Break(
        "an answer of somebody else than the edge server settles a post",
        "mavlink_broker/edge/client.py",
        "if isinstance(answer.json(), dict):",
        "if answer is not None:",
    ),
    Break(
        "a pilot's takeover is not noticed",
        "mavlink_broker/vehicle/control_authority.py",
        "    if not seen.armed:\n        return Authority.BROKER\n",
        "    if seen:\n        return Authority.BROKER\n",
    ),
    Break(
        "a POST that is repeated is carried out again",
        "edge_server/api/access/auth.py",
        "return Caller(g.role, key, g.key.name, _instance())",
        "return Caller(g.role, None, g.key.name, _instance())",
    ),
    Break(
        "a cancelled mission is flown, since its acceptance is not waited for",
        "mavlink_broker/mission/phases/waiting.py",
        "self._begin_transfer() if mission.is_confirmed else None",
        "self._begin_transfer()",
    ),
    Break(
        "an abort is forgotten by a restart of the broker",
        "mavlink_broker/mission/mission_queue.py",
        "            self._events.recall_abort(record.abort)\n",
        "            pass\n",
    ),
    Break(
        "a report without an answer is not stored on disk",
        "mavlink_broker/edge/outbox.py",
        "        if first is None or not first.must_survive:\n",
        "        if first is None or first.must_survive:\n",
    ),
    Break(
        "a record is deleted although the cloud was not reached",
        "edge_server/outbox/answers.py",
        "Result(Outcome.NO_CLOUD, reply.reason)",
        "Result(Outcome.CONFIRMED, reply.reason)",
    ),
    Break(
        "a mission that has ended takes another status",
        "edge_server/services/fleet/progress.py",
        "return not Status(current).is_terminal and reported > current",
        "return reported != current",
    ),
    Break(
        "a report finishes a mission of the same number that nobody flew",
        "edge_server/services/fleet/progress.py",
        "    return report_matching.find(_known(connection, report), report)\n",
        "    missions = work.missions_of(connection, report.vehicle_id, report.mission_id)\n"
        "    return missions[-1] if missions else None\n",
    ),
    Break(
        "a report that always fails blocks those behind it",
        "mavlink_broker/edge/outbox.py",
        "MAX_ATTEMPTS: Final = 20",
        "MAX_ATTEMPTS: Final = 1_000_000",
    ),
    Break(
        "a request of the edge server that fails once is not repeated",
        "mavlink_broker/edge/client.py",
        "            if status is None or not is_settled:\n                is_dead",
        "            if status is None:\n                self._outbox.answered(post)\n"
        "            elif not is_settled:\n                is_dead",
    ),
    Break(
        "a commit of the edge server is not on the disk",
        "edge_server/store/connection/engines.py",
        "PRAGMA synchronous=FULL",
        "PRAGMA synchronous=OFF",
    ),
    Break(
        "a commit of the broker is not on the disk",
        "mavlink_broker/database.py",
        '"synchronous=FULL"',
        '"synchronous=OFF"',
    ),
    Break(
        "a deleted plan stays in the broker's feed",
        "edge_server/store/rows/work.py",
        "    connection.execute(delete(work).where(work.c.plan == plan_row))\n",
        "    pass\n",
    ),
)


def main(chosen: list[str]) -> int:
    """Break and simulate; 0 if each break was found."""
    breaks = [one for one in BREAKS if not chosen or any(part in one.file for part in chosen)]
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for part in PARTS:
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / part, copy / part, ignore=ignored)
        for one in breaks:
            outcome = _find(copy, one)
            missed += outcome is None
            sys.stdout.write(f"{outcome or 'NOT FOUND'}: {one.mistake}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{len(breaks) - missed} of {len(breaks)} mistakes are found\n")
    return int(missed > 0)


def _find(copy: Path, one: Break) -> str | None:
    """Simulate with one mistake; after how many seeds it was found, and by what."""
    file = copy / one.file
    text = file.read_text()
    if text.count(one.line) != 1:
        raise LookupError(f"{one.line!r} is not once in {one.file}")
    file.write_text(text.replace(one.line, one.broken))
    try:
        run = subprocess.run(  # noqa: S603  # this program itself
            [sys.executable, "-m", "dst", f"--seeds={SEEDS}", f"--jobs={JOBS}", "--stop"],
            cwd=copy,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(copy)},
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
            check=False,
        )
    finally:
        file.write_text(text)
    count = re.search(r"^(\d+) seeds, (\d+) failed", run.stdout, re.MULTILINE)
    if count is None:
        raise RuntimeError(f"the simulation of {one.mistake!r} has ended: {run.stderr[-2000:]}")
    reason = re.search(r"^seed \d+: (.*)$", run.stdout, re.MULTILINE)
    return None if reason is None else f"{count[1]:>4} seeds ({reason[1][:90]})"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
