"""How far a single gyroscope whose bias jumps leads astray: `python -m tests.bench.gyro_jump`.

Sizes, axes, hover or flight at 8 m/s, calm or wind of 8 m/s; 25 s from the jump on, by the truth.
A table of the greatest horizontal distance from the place or the leg [m] is printed; arguments are
the sizes [deg/s] to fly instead of all.
"""

import argparse
import math
import sys
from itertools import product
from typing import Final

from sim.fault_schedule import Kind
from tests.bench.flight_courses import Figures, ready_vehicle, takeoff_item, waypoint
from tests.bench.flight_failures import break_now
from tests.support.autopilot_tester import AutopilotTester

_SIZES_DEG_S: Final = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0)
_AXES: Final[dict[str, tuple[int, int, int]]] = {
    "roll": (1, 0, 0),
    "yaw": (0, 0, 1),
    "roll, pitch": (1, 1, 0),
    "pitch, yaw": (0, -1, 1),
    "all": (1, -1, -1),
}
_CRUISE_M_S: Final = 8.0
_WINDS_M_S: Final = (0.0, 8.0)
_HEIGHT_M: Final = 15.0
_LEG_M: Final = 600.0
_WATCHED_S: Final = 25.0


def gyro_jump(
    seed: int,
    *,
    jump_deg_s: tuple[float, float, float] = (3.0, 3.0, 0.0),
    cruise: bool = False,
    wind: float = 8.0,
) -> Figures:
    """How far off the vehicle gets, beside its leg or from its place, and whether it flies on."""
    tester = ready_vehicle(seed, wind=wind, imus=1)
    (_cruise if cruise else _hover)(tester)
    begin_north, begin_east, _ = tester.true_position()
    farthest_m = 0.0

    def note() -> None:
        nonlocal farthest_m
        north, east, _ = tester.true_position()
        off = 0.0 if cruise else north - begin_north
        farthest_m = max(farthest_m, math.hypot(off, east - begin_east))

    tester.watch(note)
    x, y, z = jump_deg_s
    break_now(tester, Kind.GYRO_BIAS, x_deg_s=x, y_deg_s=y, z_deg_s=z)
    tester.run_for(_WATCHED_S)
    return {"off": farthest_m, "unharmed": 0.0 if tester.simulation.wrecked else 1.0}


def _hover(tester: AutopilotTester) -> None:
    tester.take_off(_HEIGHT_M)
    tester.run_for(18.0)


def _cruise(tester: AutopilotTester) -> None:
    """Northward, at full speed."""
    tester.autopilot.registry.set("MPC_XY_CRUISE", _CRUISE_M_S)
    far = waypoint(tester, 1, (_LEG_M, 0.0), _HEIGHT_M)
    tester.upload([takeoff_item(tester, _HEIGHT_M), far])
    tester.start_mission()
    tester.wait_until(lambda: tester.true_position()[0] > 30.0, 60.0, "30 m out")


def main() -> int:
    """Fly, print the table; 0 if no vehicle was harmed."""
    parser = argparse.ArgumentParser(description="Let the only gyroscope jump in flight.")
    parser.add_argument("sizes", type=float, nargs="*", help="sizes of the jump [deg/s]")
    sizes = parser.parse_args().sizes or _SIZES_DEG_S
    cases = list(product((False, True), _WINDS_M_S))
    heads = [f"{'8 m/s' if cruise else 'hover'}, wind {wind:g} m/s" for cruise, wind in cases]
    write = sys.stdout.write
    write(f"| jump [deg/s] | axes | {' | '.join(heads)} |\n|{'---|' * (2 + len(cases))}\n")
    harmed = 0
    for size, (name, (x, y, z)) in product(sizes, _AXES.items()):
        jump = (size * x, size * y, size * z)
        flown = [gyro_jump(1, jump_deg_s=jump, cruise=c, wind=w) for c, w in cases]
        harmed += sum(figures["unharmed"] < 1.0 for figures in flown)
        cells = " | ".join(f"{figures['off']:.2f}" for figures in flown)
        write(f"| {size:g} | {name} | {cells} |\n")
        sys.stdout.flush()
    return min(harmed, 1)


if __name__ == "__main__":
    sys.exit(main())
