"""Flies one seeded flight into a folder: `python -m tests.golden.recorded_flight FOLDER`.

Everything that leaves the vehicle is written down: the bytes of its telemetry, the flight log,
the true track, the console's lines, the stored parameters. Two builds of the flight stack are the
same if their folders are. A minute and a half: checks, parameters, a mission in gusts with two
faults, a return, a landing.
"""

import sys
from pathlib import Path
from typing import Final

from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from sim.fault_schedule import Fault, Kind
from tests.bench.flight_courses import takeoff_item, waypoint
from tests.support.autopilot_tester import SYSTEM_ID, AutopilotTester
from tests.support.ground_station import MemoryLink
from uav_firmware import compiled
from uav_firmware.cal.link import Address
from uav_firmware.drivers.log_folder import LogFolder

STATE: Final = "compiled.txt"
"""Name of the file that says whether the flight was compiled; the only one that may differ."""
_LEGS: Final = ((25.0, 0.0, 8.0), (25.0, 25.0, 12.0), (0.0, 10.0, 6.0))
_FLIGHT_S: Final = 45.0
_FAULTS: Final = (
    Fault(
        kind=Kind.WIND_GUST,
        start_us=30_000_000,
        end_us=33_000_000,
        values={"speed_m_s": 3.0, "from_deg": 80.0},
    ),
    Fault(kind=Kind.GPS_LOSS, start_us=40_000_000, end_us=42_000_000),
)


class _Recording(MemoryLink):
    """Keeps every datagram for good."""

    def __init__(self) -> None:
        super().__init__()
        self.sent = bytearray()

    def send(self, datagram: bytes, address: Address) -> None:
        super().send(datagram, address)
        self.sent += datagram


def fly(folder: Path) -> None:
    """Fly, and write what left the vehicle."""
    truth = folder / "truth.csv"
    config = SimulationConfig(
        seed=7, wind_speed_m_s=4.0, wind_from_deg=200.0, faults=_FAULTS, truth_log_path=truth
    )
    link = _Recording()
    tester = AutopilotTester(config, folder, link=link, log_store=LogFolder(folder / "log"))
    tester.wait_until_ready()
    station = tester.ground_station
    station.send(common.MAVLink_param_request_list_message(SYSTEM_ID, 1))
    tester.autopilot.registry.set("MPC_XY_CRUISE", 7.0)
    points = [waypoint(tester, n, (x, y), up) for n, (x, y, up) in enumerate(_LEGS, start=1)]
    tester.upload([takeoff_item(tester), *points])
    tester.start_mission()
    tester.run_for(_FLIGHT_S)
    tester.send_command(common.MAV_CMD_DO_SET_MODE, 1.0, 4, 5)
    tester.wait_until_landed()
    tester.autopilot.logger.close()
    tester.autopilot.parameter_storage.finish()
    tester.simulation.close()
    (folder / "telemetry.bin").write_bytes(link.sent)
    (folder / "lines.txt").write_text("\n".join(tester.lines), encoding="utf-8")
    (folder / STATE).write_text(str(compiled.is_installed()), encoding="utf-8")


if __name__ == "__main__":
    fly(Path(sys.argv[1]))
