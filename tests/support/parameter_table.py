"""A whole flight stack on simulated hardware, for tests that read what it declares."""

from pathlib import Path

from sim.config import SimulationConfig
from sim.simulation import Simulation
from tests.support.ground_station import MemoryLink
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.module_errors import end_flight
from uav_firmware.topology import Autopilot


def autopilot(folder: Path) -> Autopilot:
    """A whole flight stack that is not stepped."""
    return Autopilot(
        JsbsimVehicle(Simulation(SimulationConfig())),
        MemoryLink(),
        FileStorage(folder),
        system_id=1,
        peers=(),
        boot_time_utc_us=0,
        write_line=lambda _time_us, _text: None,
        on_error=end_flight,
    )
