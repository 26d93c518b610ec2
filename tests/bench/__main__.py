"""`make bench`: measure the system, print a page, write STATE_DIR/bench/results.json.

`BENCH` chooses what, separated by commas: `flight` (how well it flies, some minutes on both
cores), `speed` (how fast it is simulated), `system` (the running programs), `links`
(files over MAVLink), `missions` (their upload, by a tight client and by the broker), `edge` (what
the edge server takes in and sends on), `hostile` (the same among bad clients and behind a bad
network), `console` (how fast its STOP acts, and what its viewers cost), `seed` (times and memory
per message type beside those of the first system's thesis), `dst` (simulated hours per hour),
`board` (memory of edge server and broker after MINUTES, by default an hour). Without it, all but
`board`.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final

from tests.bench import (
    board,
    broker_upload,
    console,
    dst,
    edge,
    edge_hostile,
    flight_quality,
    links,
    mission_upload,
    seed_table,
    simulation,
    system,
)
from tests.bench.results import Result, page, row, write
from tests.support.parts import choose


def _missions() -> Iterable[Result]:
    yield from mission_upload.measure()
    yield from broker_upload.measure()


def _system() -> Iterable[Result]:
    with tempfile.TemporaryDirectory() as state_dir:
        yield from system.measure(Path(state_dir))


def _board() -> Iterable[Result]:
    with tempfile.TemporaryDirectory() as state_dir:
        yield from board.measure(Path(state_dir))


PARTS: Final[Mapping[str, Callable[[], Iterable[Result]]]] = {
    "flight": flight_quality.measure,
    "speed": simulation.measure,
    "system": _system,
    "links": links.measure,
    "missions": _missions,
    "edge": edge.measure,
    "hostile": edge_hostile.measure,
    "console": console.measure,
    "seed": seed_table.measure,
    "dst": dst.measure,
    "board": _board,
}
_ON_REQUEST: Final = frozenset({"board"})


def main() -> int:
    """Measure; 0 whatever the figures say: a bench measures, tests judge."""
    chosen = choose("BENCH", PARTS, __doc__)
    if not os.environ.get("BENCH"):
        chosen = [name for name in chosen if name not in _ON_REQUEST]
    folder = Path(os.environ.get("STATE_DIR") or "var") / "bench"
    results: list[Result] = []
    for name in chosen:
        print(f"measuring {name}", file=sys.stderr, flush=True)
        for result in PARTS[name]():
            results.append(result)
            write(results, folder)  # What is measured is kept if the rest is interrupted
            print(row(result), file=sys.stderr, flush=True)
    print(page(results))
    print(f"written to {folder}/results.json and {folder}/results.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
