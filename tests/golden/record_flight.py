"""Records the flight that the estimator is replayed on: `python -m tests.golden.record_flight`.

Needed only when the sensors' messages change; the log is an input, so `make golden` leaves it.
A minute at noise factor 1 in 6 m/s of wind: rest, take-off, a triangle at 8 m/s with turns of the
nose, a climb, a stop.
"""

import tempfile
from pathlib import Path
from typing import Any, Final

from sim.config import SimulationConfig
from tests.bench.flight_courses import takeoff_item, waypoint
from tests.golden.sensor_log import Arrival, Message, save
from tests.support.autopilot_tester import AutopilotTester
from uav_firmware.bus import Topic

LOG: Final = Path(__file__).parent / "estimator" / "flight.npz"
FLIGHT_S: Final = 60.0
_LEGS: Final = ((30.0, 0.0, 8.0), (30.0, 30.0, 15.0), (0.0, 0.0, 6.0))


class Recorder:
    """Notes each message of the sensors and of the land detector once."""

    def __init__(self, tester: AutopilotTester) -> None:
        self.arrivals: list[Arrival] = []
        topics = tester.autopilot.topics
        self._vehicle = tester.autopilot.vehicle
        self._topics: tuple[Topic[Any], ...] = (
            topics.sensor_imu,
            topics.sensor_baro,
            topics.sensor_mag,
            topics.sensor_gps,
            topics.land_detected,
        )
        self._counts = [0] * len(self._topics)
        tester.watch(self._note)

    def _note(self) -> None:
        for index, topic in enumerate(self._topics):
            message: Message | None = topic.value
            if topic.count != self._counts[index] and message is not None:
                self._counts[index] = topic.count
                self.arrivals.append(Arrival(self._vehicle.time_us, message))


def main() -> None:
    """Fly and write."""
    with tempfile.TemporaryDirectory() as folder:
        tester = AutopilotTester(SimulationConfig(wind_speed_m_s=6.0), Path(folder))
        recorder = Recorder(tester)
        tester.wait_until_ready()
        tester.autopilot.registry.set("MPC_XY_CRUISE", 8.0)
        points = [waypoint(tester, n, (x, y), up) for n, (x, y, up) in enumerate(_LEGS, start=1)]
        tester.upload([takeoff_item(tester), *points])
        tester.start_mission()
        tester.run_for(FLIGHT_S - tester.truth.time_us * 1e-6)
    save(LOG, recorder.arrivals)


if __name__ == "__main__":
    main()
