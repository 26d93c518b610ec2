"""`make bench`: measure the system, print a page, write STATE_DIR/bench/results.json."""

import os
import sys
import tempfile
from pathlib import Path

from tests.bench import simulation, system
from tests.bench.results import page, write


def main() -> int:
    """Measure; 0 whatever the figures say: a bench measures, tests judge."""
    folder = Path(os.environ.get("STATE_DIR") or "var") / "bench"
    results = list(simulation.measure())
    with tempfile.TemporaryDirectory() as state_dir:
        results += system.measure(Path(state_dir))
    write(results, folder)
    print(page(results))
    print(f"written to {folder}/results.json and {folder}/results.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
