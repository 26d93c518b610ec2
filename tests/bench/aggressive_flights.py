"""No false alarm of a sensor in aggressive flight: `python -m tests.bench.aggressive_flights`.

Each flight has its own seed: noise, scale factors and misalignments of the instruments, and what is
flown: flips, throttle punches with free fall, hard banks to and fro, spins, then a hard landing.
One inertial unit, so that no vote hides what the estimator suspects. Arguments: how many flights
(1000), the first seed (1). A line for each alarm, then the count; 0 if there was none.
"""

import argparse
import math
import random
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from tests.support.autopilot_tester import SYSTEM_ID, AutopilotTester

FLIGHTS: Final = 1000
_HEIGHT_M: Final = 30.0
_HOVER: Final = 0.225
_MANOEUVRES: Final = 5
_STREAM_STEPS: Final = 5  # 50 Hz
_ATTITUDE_IGNORED: Final = 128
_RATES_IGNORED: Final = 7
_PX4_OFFBOARD: Final = 6
_FALSE: Final = (
    "Gyroscope", "Accelerometer", "Compass", "Barometer", "Motor", "disagree", "Crash",
)  # fmt: skip
"""What no text may name, since nothing is broken."""


class Flight:
    """One vehicle led by streamed attitudes and rates."""

    def __init__(self, seed: int, folder: Path, **config: Any) -> None:
        self._random = random.Random(seed)
        self.tester = AutopilotTester(
            SimulationConfig(seed=seed, wind_speed_m_s=self._random.uniform(0.0, 6.0), **config),
            folder,
        )
        self._message: Any = self._attitude(0.0, 0.0, _HOVER)
        self._steps = 0

    def fly(self) -> list[str]:
        """Take off, fly wild, land hard; texts that blame a sensor or motor."""
        tester = self.tester
        tester.autopilot.registry.set("COM_OF_LOSS_T", 5.0)
        tester.wait_until_ready()
        tester.take_off(_HEIGHT_M)
        tester.wait_until(lambda: tester.true_position()[2] > _HEIGHT_M - 2.0, 60.0, "up")
        tester.watch(self._stream)
        tester.run_for(0.5)
        tester.ground_station.command(common.MAV_CMD_DO_SET_MODE, 1.0, _PX4_OFFBOARD, 0.0)
        tester.run_for(0.5)
        choices = (self._flip, self._punch, self._bank, self._spin)
        for _ in range(_MANOEUVRES):
            self._random.choice(choices)()
            self._recover()
        self._come_down()
        tester.run_for(3.0)
        return [line for line in tester.lines if any(name in line for name in _FALSE)]

    def _flip(self) -> None:
        rate = self._random.choice((-1.0, 1.0)) * self._random.uniform(6.0, 10.0)
        roll, pitch = self._random.choice(((rate, 0.0), (0.0, rate)))
        self._lead(self._rates(roll, pitch, 0.0, 0.3), 2.0 * math.pi / abs(rate))

    def _punch(self) -> None:
        up = self._attitude(0.0, 0.0, self._random.uniform(0.6, 1.0))
        self._lead(up, self._random.uniform(0.6, 1.5))
        self._lead(self._attitude(0.0, 0.0, 0.0), self._random.uniform(0.5, 1.2))

    def _bank(self) -> None:
        for _ in range(4):
            roll, pitch = self._random.uniform(-50.0, 50.0), self._random.uniform(-50.0, 50.0)
            self._lead(self._attitude(roll, pitch, 0.3), self._random.uniform(0.3, 0.8))

    def _spin(self) -> None:
        yaw = self._random.choice((-1.0, 1.0)) * self._random.uniform(2.0, 4.0)
        self._lead(self._rates(0.0, 0.0, yaw, _HOVER), 2.5)

    def _recover(self) -> None:
        """Level; up again when low, or down again when high."""
        self._lead(self._attitude(0.0, 0.0, 0.35), 0.6)
        for _ in range(20):
            height, sink = self.tester.true_position()[2], self.tester.truth.velocity_ned[2]
            wanted = max(-3.0, min(3.0, 0.5 * (height - _HEIGHT_M)))
            thrust = max(0.05, min(0.6, _HOVER + 0.04 * (sink - wanted)))
            self._lead(self._attitude(0.0, 0.0, thrust), 0.2)

    def _come_down(self) -> None:
        """Land by itself, and hard."""
        tester = self.tester
        tester.autopilot.registry.set("MPC_LAND_SPEED", self._random.uniform(0.8, 1.6))
        self._message = None
        tester.land()
        tester.wait_until(lambda: not tester.status.armed, 90.0, "disarmed")

    def _lead(self, message: Any, seconds: float) -> None:
        self._message = message
        self.tester.run_for(seconds)

    def _stream(self) -> None:
        self._steps += 1
        if self._message is not None and self._steps % _STREAM_STEPS == 0:
            self.tester.ground_station.send(self._message)

    @staticmethod
    def _attitude(roll_deg: float, pitch_deg: float, thrust: float) -> Any:
        roll, pitch = math.radians(0.5 * roll_deg), math.radians(0.5 * pitch_deg)
        q = [
            math.cos(roll) * math.cos(pitch),
            math.sin(roll) * math.cos(pitch),
            math.cos(roll) * math.sin(pitch),
            -math.sin(roll) * math.sin(pitch),
        ]
        return common.MAVLink_set_attitude_target_message(
            0, SYSTEM_ID, 1, _RATES_IGNORED, q, 0.0, 0.0, 0.0, thrust
        )

    @staticmethod
    def _rates(roll: float, pitch: float, yaw: float, thrust: float) -> Any:
        return common.MAVLink_set_attitude_target_message(
            0, SYSTEM_ID, 1, _ATTITUDE_IGNORED, [1.0, 0.0, 0.0, 0.0], roll, pitch, yaw, thrust
        )


def alarms(seeds: Iterator[int] | range, note: Callable[[int, str], None], **config: Any) -> int:
    """Fly each seed; how many flights raised an alarm."""
    count = 0
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder:
            texts = Flight(seed, Path(folder), **config).fly()
        count += bool(texts)
        for text in texts:
            note(seed, text)
    return count


def main() -> int:
    """Fly, print; 0 if nothing was blamed."""
    parser = argparse.ArgumentParser(description="Fly aggressively; no sensor may be blamed.")
    parser.add_argument(
        "flights", type=int, nargs="?", default=FLIGHTS, help="how many: %(default)s"
    )
    parser.add_argument("first", type=int, nargs="?", default=1, help="the first seed: %(default)s")
    options = parser.parse_args()
    flights: int = options.flights
    first: int = options.first
    write = sys.stdout.write

    def note(seed: int, text: str) -> None:
        write(f"seed {seed}: {text}\n")
        sys.stdout.flush()

    count = alarms(range(first, first + flights), note, imus=1)
    write(f"{count} of {flights} flights with an alarm\n")
    return min(count, 1)


if __name__ == "__main__":
    sys.exit(main())
