"""`make soak`: what takes too long for every test run, one after the other, until one fails.

`SOAK` chooses, separated by commas: `kill` (the edge server killed again and again under load),
`outage` (72 simulated hours without a cloud; `BURST_S` (3600) seconds of each the vehicles report).
`contract` (EXAMPLES requests per operation, 100, that fit its OpenAPI document and that do not),
`broker` (killed up to three times per flight, EVERY_S (1) of a mission with all eleven commands
and of one that borrows fence, rally points and parameters of its vehicle), `links`
(MISSIONS (100) over each of nine links that lose and delay), `events` (every event in every state
of a mission, over a good link and over a bad one).
`spool` (a broker that has much to send is killed CYCLES times).
`hostile` (the real system under everything at once for MINUTES (120) with VEHICLES (20): cut
answers of the cloud, slow sockets, kills, a full disk, aborts, pilots who take vehicles over).
`radio` (a mission in real time over a telemetry radio that is pulled out again and again).
Without it, all. `CYCLES` (200) is the number of kills; `SEED` chooses order and requests.
"""

import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from edge_server.config import Config
from tests.soak import (
    broker_death,
    broker_events,
    broker_links,
    broker_loans,
    hostile,
    kill_nine,
    outage,
    radio,
    spool_death,
)
from tests.support import contract_fuzz
from tests.support.flying_world import PERFECT
from tests.support.parts import choose


def _contract() -> None:
    examples = int(os.environ.get("EXAMPLES") or 100)
    number = int(os.environ.get("SEED") or 1)
    for mode in contract_fuzz.MODES:
        with tempfile.TemporaryDirectory() as folder, contract_fuzz.served(Path(folder)) as server:
            failures = list(contract_fuzz.failures(*server, mode, examples, number))
        print(f"{mode.value}: {len(failures)} operations fail")
        assert not failures, "\n".join(failures)


def _kill() -> None:
    cycles = int(os.environ.get("CYCLES") or 200)
    seed = int(os.environ.get("SEED") or 1)
    with tempfile.TemporaryDirectory() as folder:
        outcome = kill_nine.run(cycles, Path(folder) / "state", seed)
    kills = ", ".join(f"{name} {number}" for name, number in sorted(outcome.kills.items()))
    print(f"killed: {kills}")
    for stream, number in outcome.acknowledged.items():
        print(f"{stream.kind} of vehicle {stream.vehicle_id}: {number} acknowledged, all arrived")
    print(f"sent again under the same key: {outcome.sent_again}")


def _outage() -> None:
    burst_s = int(os.environ.get("BURST_S") or 3600)
    with tempfile.TemporaryDirectory() as folder:
        outcome = outage.run(Config(state_dir=Path(folder), data_budget_mib=64), burst_s)
    print(f"{outcome.taken} records in {outage.HOURS} simulated hours without a cloud:")
    print(f"{outcome.delivered} arrived, {outcome.declared} declared in {outcome.gaps} gaps")
    print(f"at most {outcome.largest_share:.1%} of the budget in use")


def _radio() -> None:
    with tempfile.TemporaryDirectory() as folder:
        _, counts = radio.run(Path(folder))
    print("FINISHED over a radio: " + ", ".join(f"{n} {what}" for what, n in counts.items()))


def _hostile() -> None:
    minutes = float(os.environ.get("MINUTES") or 120.0)
    vehicles = int(os.environ.get("VEHICLES") or 20)
    folder = Path(tempfile.mkdtemp(prefix="hostile-"))
    try:
        hostile.run(folder, vehicles, minutes, _seed(), _print_line)
    except BaseException:
        _print_line(f"logs and true tracks are kept in {folder}")
        raise
    shutil.rmtree(folder)


def _spool() -> None:
    cycles = int(os.environ.get("CYCLES") or 200)
    with tempfile.TemporaryDirectory() as folder:
        spool_death.run(cycles, Path(folder), _seed(), _print_line)


def _print_line(line: str) -> None:
    print(line, flush=True)


def _seed() -> int:
    return int(os.environ.get("SEED") or 1)


def _broker() -> None:
    every_s = float(os.environ.get("EVERY_S") or 1.0)
    broker_loans.run(every_s, _seed(), _print_line)
    for conditions in (PERFECT, broker_links.conditions(0.0, 0.3)):
        broker_death.run(every_s, _seed(), _print_line, conditions)


def _links() -> None:
    broker_links.run(int(os.environ.get("MISSIONS") or 100), _seed(), _print_line)


def _events() -> None:
    for conditions in (PERFECT, broker_links.conditions(0.2, 0.3)):
        broker_events.run(conditions, _seed(), _print_line)


PARTS: Final[Mapping[str, Callable[[], None]]] = {
    "kill": _kill,
    "contract": _contract,
    "outage": _outage,
    "broker": _broker,
    "links": _links,
    "events": _events,
    "spool": _spool,
    "radio": _radio,
    "hostile": _hostile,
}


def main() -> int:
    """Run what was chosen; 0 when every promise was kept."""
    chosen = choose("SOAK", PARTS, __doc__)
    for name in chosen:
        print(f"== {name}", flush=True)
        PARTS[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
