"""Prove that the laws find: `python -m dst.prove` breaks the product in one place at a time.

Each break is a mistake that was made, or that a careless change would make, in a copy of the
project. Printed is after how many seeds a law fails. Arguments choose breaks by a part of their
name. Exit code 0: each was found.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

from dst.faults.kinds import Fault
from dst.simulate import FAULTS_S

ROOT: Final = Path(__file__).resolve().parents[1]
PARTS: Final = ("afarcloud", "dst", "edge_server", "farm_flight_bridge", "mavlink_broker")
SEEDS: Final = int(os.environ.get("SEEDS") or 1000)
"""Within which a mistake is to be found."""
JOBS: Final = int(os.environ.get("JOBS") or os.cpu_count() or 1)
LONGEST_S: Final = 3600.0


class Change(NamedTuple):
    """A part of a file that occurs once, and what replaces it."""

    file: str
    line: str
    broken: str


class Break(NamedTuple):
    """A mistake. What two places guard against is broken in both."""

    mistake: str
    changes: tuple[Change, ...]
    needs: tuple[Fault, ...] = ()
    """Seeds without these faults cannot find it; they are counted, and not simulated."""
    shift_s: float = FAULTS_S
    """Seconds with faults: many at once let little be flown in a short shift."""


BREAKS: Final = (
    Break(
        "an answer that is cut off in the middle stops the relay",
        (
            Change(
                "edge_server/uplinks/cloud_http.py",
                "    urllib3.exceptions.HTTPError,\n    http.client.HTTPException,\n    OSError,\n"
                "    ValueError,\n",
                "    OSError,\n",
            ),
            Change(
                "edge_server/outbox/senders.py",
                "        except Exception as error:\n",
                "        except NotImplementedError as error:\n",
            ),
        ),
        (Fault.CLOUD_ANSWERS_LOST,),
    ),
    Break(
        "a repeated report finishes a mission that nobody flew",
        (
            Change(
                "edge_server/services/fleet/progress.py",
                "    return report_matching.find(_known(connection, report), report)\n",
                "    every = work.missions_of(connection, report.vehicle_id, report.mission_id)\n"
                "    return every[-1] if every else None\n",
            ),
            Change(
                "edge_server/services/fleet/report_matching.py",
                "    _check_accepted(mission, report)\n",
                "",
            ),
        ),
        (
            Fault.REPEATED_POSTS,
            Fault.REPEATED_MISSIONS,
        ),
    ),
    Break(
        "an abort is forgotten by a restart of the broker",
        (
            Change(
                "mavlink_broker/mission/mission_queue.py",
                "            self._events.recall_abort(record.abort, now, effects)\n",
                "            pass\n",
            ),
        ),
        (
            Fault.POWER_CUT,
            Fault.ABORTS,
        ),
    ),
    Break(
        "a report that always fails blocks those behind it",
        (
            Change(
                "mavlink_broker/edge/outbox.py",
                "MAX_ATTEMPTS: Final = 20",
                "MAX_ATTEMPTS: Final = 1_000_000",
            ),
        ),
        (Fault.REPORT_ALWAYS_FAILS,),
    ),
    Break(
        "a suspended broker orders by old telemetry",
        (
            Change(
                "mavlink_broker/app.py",
                "        if ran_at is not None and now - ran_at > STOOD_STILL_S:\n",
                "        if ran_at is not None and now - ran_at > 1e9:\n",
            ),
        ),
        (Fault.BROKER_SUSPENDED, Fault.PILOT),
    ),
    Break(
        "a pilot's takeover is not noticed",
        (
            Change(
                "mavlink_broker/vehicle/control_authority.py",
                "    if not seen.armed:\n        return Authority.BROKER\n",
                "    if seen:\n        return Authority.BROKER\n",
            ),
        ),
        (Fault.PILOT,),
    ),
    Break(
        "a POST that is repeated is carried out again",
        (
            Change(
                "edge_server/api/access/auth.py",
                "return Caller(g.role, key, g.key.name, _instance())",
                "return Caller(g.role, None, g.key.name, _instance())",
            ),
        ),
        (Fault.REPEATED_POSTS,),
    ),
    Break(
        "a request of the edge server that fails once is not repeated",
        (
            Change(
                "mavlink_broker/edge/client.py",
                "            if not outcome.is_settled:\n                is_dead",
                "            if status is None:\n                self._outbox.answered(post)\n"
                "            elif not outcome.is_settled:\n                is_dead",
            ),
        ),
        (Fault.EDGE_KILLED,),
    ),
    Break(
        "an answer of somebody else than the edge server settles a post",
        (
            Change(
                "mavlink_broker/edge/answers.py",
                "if isinstance(answer.json(), dict):",
                "if answer is not None:",
            ),
        ),
        (Fault.EDGE_ANSWERS_FOREIGN,),
    ),
    Break(
        "a report without an answer is not stored on disk",
        (
            Change(
                "mavlink_broker/edge/outbox.py",
                "        if first is None or not first.must_survive:\n",
                "        if first is None or first.must_survive:\n",
            ),
        ),
        (Fault.EDGE_UNREACHABLE,),
    ),
    Break(
        "a record is deleted although the cloud was not reached",
        (
            Change(
                "edge_server/outbox/answers.py",
                "Result(Outcome.NO_CLOUD, reply.reason)",
                "Result(Outcome.CONFIRMED, reply.reason)",
            ),
        ),
        (Fault.CLOUD_UNREACHABLE,),
    ),
    Break(
        "a cancelled mission is flown, since its acceptance is not waited for",
        (
            Change(
                "mavlink_broker/mission/phases/waiting.py",
                "self._begin_transfer() if mission.is_confirmed else None",
                "self._begin_transfer()",
            ),
        ),
        (
            Fault.CANCELLATIONS,
            Fault.EDGE_UNREACHABLE,
        ),
    ),
    Break(
        "a mission that has ended takes another status",
        (
            Change(
                "edge_server/services/fleet/report_matching.py",
                "    if has_ended and report.mission_status_id != status:\n",
                "    if has_ended and report.mission_status_id is None:\n",
            ),
            Change(
                "edge_server/services/fleet/progress.py",
                "    was_open = mission.state != work.CLOSED\n",
                "    was_open = True\n",
            ),
            Change(
                "edge_server/services/fleet/progress.py",
                "    return not Status(current).is_terminal and reported > current\n",
                "    return reported != current\n",
            ),
        ),
        (Fault.REPORT_ALWAYS_FAILS,),
    ),
    Break(
        "a commit of the edge server is not on the disk",
        (
            Change(
                "edge_server/store/connection/engines.py",
                "PRAGMA synchronous=FULL",
                "PRAGMA synchronous=OFF",
            ),
        ),
        (Fault.POWER_LOST,),
    ),
    Break(
        "a commit of the broker is not on the disk",
        (Change("mavlink_broker/database.py", '"synchronous=FULL"', '"synchronous=OFF"'),),
        (Fault.POWER_LOST,),
    ),
    Break(
        "a motor that has failed raises no alarm",
        (
            Change(
                "mavlink_broker/vehicle/alarms.py",
                "    (mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS, PROPELLERS),\n",
                "",
            ),
        ),
        (Fault.VEHICLE_FAILS,),
    ),
    Break(
        "a parameter that a mission has borrowed is not given back",
        (
            Change(
                "mavlink_broker/microservices/config_overrides.py",
                "                return Setting(name, overridden.before)\n",
                "                continue\n",
            ),
        ),
    ),
    Break(
        "an attitude that is no number is taken for one",
        (
            Change(
                "mavlink_broker/vehicle/telemetry.py",
                "    if all(math.isfinite(angle) for angle in angles):\n",
                "    if angles:\n",
            ),
        ),
        (Fault.NOT_A_NUMBER,),
    ),
    Break(
        "a picture is given to the command before the one that took it",
        (
            Change(
                "mavlink_broker/pictures/attribution.py",
                "            if interval.missing_of(camera)\n            and interval.earliest_s",
                "            if interval.command\n            and interval.earliest_s",
            ),
        ),
        (Fault.PICTURES,),
    ),
    Break(
        "a picture whose announcement was lost is not asked for",
        (
            Change(
                "mavlink_broker/pictures/announcements.py",
                "                self._images.setdefault(missing, _PendingRequest())\n",
                "                continue\n",
            ),
        ),
        (Fault.PICTURES, Fault.LOSS),
        shift_s=300.0,
    ),
    Break(
        "what is borrowed of a swapped aircraft is noted as of the former one",
        (
            Change(
                "mavlink_broker/fleet.py",
                "            if not session.change_vehicle():\n",
                "            if session is not None:\n",
            ),
        ),
        (Fault.SWAPPED,),
        shift_s=300.0,
    ),
    Break(
        "a mission that expires while it goes onto the vehicle is flown",
        (
            Change(
                "mavlink_broker/mission/mission_executor.py",
                "        if self.state in TRANSFERRING and self._context.is_expired(now):\n",
                "        if now < 0.0:\n",
            ),
            Change(
                "mavlink_broker/mission/phases/preparing.py",
                "sends_until=self._mission.expires_at)",
                'sends_until=float("inf"))',
            ),
        ),
        (Fault.EXPIRIES,),
    ),
    Break(
        "a vehicle that answers nothing is not warned of",
        (
            Change(
                "mavlink_broker/microservices/link_state.py",
                "            self.is_unanswered = not self._lacks_timesync\n",
                "",
            ),
        ),
        (Fault.LINK_DOWN,),
    ),
)


def main(chosen: list[str]) -> int:
    """Break and simulate; 0 if each break was found."""
    breaks = [one for one in BREAKS if not chosen or any(part in one.mistake for part in chosen)]
    missed = 0
    for one in breaks:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder)
            _copy(copy)
            for change in one.changes:
                apply(copy, change)
            outcome = _find(copy, one)
        missed += outcome is None
        sys.stdout.write(f"{outcome or 'NOT FOUND'}: {one.mistake}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{len(breaks) - missed} of {len(breaks)} mistakes are found\n")
    return int(missed > 0)


def _copy(copy: Path) -> None:
    for part in PARTS:
        shutil.copytree(ROOT / part, copy / part, ignore=shutil.ignore_patterns("__pycache__"))


def apply(copy: Path, change: Change) -> None:
    """Change a file.

    Raises:
        LookupError: if the part is not there once; the product has changed.
    """
    file = copy / change.file
    text = file.read_text()
    if text.count(change.line) != 1:
        raise LookupError(f"{change.line!r} is not once in {change.file}")
    file.write_text(text.replace(change.line, change.broken))


def _find(copy: Path, one: Break) -> str | None:
    """Simulate with one mistake; after how many seeds it was found, and by what.

    A seed that fails without the mistake too has not found it.
    """
    first, simulated = 1, 0
    while first <= SEEDS:
        output = _simulate(copy, first, SEEDS - first + 1, one)
        count = re.search(r"^(\d+) seeds, (\d+) failed", output, re.MULTILINE)
        if count is None:
            raise RuntimeError(f"the simulation of {one.mistake!r} has ended: {output[-2000:]}")
        simulated += int(count[1])
        found = re.search(r"^seed (\d+): (.*)$", output, re.MULTILINE)
        if found is None:
            return None
        seed = int(found[1])
        if ", 0 failed" in _simulate(ROOT, seed, 1, one):
            return f"after {seed:>3} seeds, {simulated} of them simulated ({found[2][:90]})"
        first = seed + 1
    return None


def _simulate(project: Path, first: int, seeds: int, one: Break) -> str:
    """Run the simulation of a project until a seed fails; what it prints."""
    run = subprocess.run(  # noqa: S603  # this program itself
        [
            *(sys.executable, "-m", "dst", f"--first={first}", f"--seeds={seeds}"),
            *(f"--jobs={JOBS}", "--stop", f"--shift-s={one.shift_s:g}"),
            f"--needs={','.join(one.needs) or 'none'}",
        ],
        cwd=project,
        env={**os.environ, "PYTHONPATH": str(project)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    return run.stdout


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
