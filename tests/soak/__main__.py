"""`make soak`: what takes too long for every test run, one after the other, until one fails.

`SOAK` chooses, separated by commas: `kill` (the edge server killed again and again under load).
Without it, all. `CYCLES` (200) says how often it is killed, `SEED` in which order.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from tests.soak import kill_nine


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


PARTS: Final[Mapping[str, Callable[[], None]]] = {"kill": _kill}


def main() -> int:
    """Run what was chosen; 0 when every promise was kept, 2 when there is no such part."""
    chosen = [name for name in os.environ.get("SOAK", "").split(",") if name] or list(PARTS)
    unknown = [name for name in chosen if name not in PARTS]
    if unknown:
        print(f"SOAK: there is no {', '.join(unknown)}; there are {', '.join(PARTS)}")
        return 2
    for name in chosen:
        print(f"== {name}", flush=True)
        PARTS[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main())
