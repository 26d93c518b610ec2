"""Whether the same seed gives the same flight, byte for byte, in wind and with all noise."""

import tempfile
from pathlib import Path

from tests.bench.flight_courses import Figures, ready_vehicle


def same_flight_twice(seed: int) -> Figures:
    """Two flights of half a minute; 1 when their truth logs are equal and not empty."""
    first, second = _truth_log(seed), _truth_log(seed)
    return {"identical": 1.0 if first == second and len(first) > 100_000 else 0.0}


def _truth_log(seed: int) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "truth.csv"
        tester = ready_vehicle(seed, wind=4.0, truth_log_path=path)
        tester.take_off(5.0)
        tester.run_for(20.0)
        tester.simulation.close()
        return path.read_bytes()
