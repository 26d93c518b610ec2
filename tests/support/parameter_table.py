"""The parameter table of the firmware's README: `python -m tests.support.parameter_table`.

Rewrites the table after parameters have changed, so that the change shows as a reviewed diff.
"""

import tempfile
from pathlib import Path
from typing import Final

from sim.config import SimulationConfig
from sim.simulation import Simulation
from tests.support.ground_station import MemoryLink
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.topology import Autopilot

README: Final = Path(__file__).parents[2] / "uav_firmware" / "README.md"
HEADING: Final = "| name | default | unit | range | meaning |\n|---|---|---|---|---|\n"


def autopilot(folder: Path) -> Autopilot:
    """A whole flight stack that nobody steps."""
    return Autopilot(
        JsbsimVehicle(Simulation(SimulationConfig())),
        MemoryLink(),
        FileStorage(folder),
        system_id=1,
        peers=(),
        boot_time_utc_us=0,
        write_line=lambda _time_us, _text: None,
    )


def table() -> str:
    """One row for each parameter, by name."""
    with tempfile.TemporaryDirectory() as folder:
        registry = autopilot(Path(folder)).registry
    rows = []
    for name in registry.names():
        entry = registry.declaration(name)
        span = f"{entry.minimum:g} to {entry.maximum:g}"
        rows.append(f"| `{name}` | {entry.default:g} | {entry.unit} | {span} | {entry.short} |\n")
    return HEADING + "".join(rows)


def main() -> None:
    """Put the table where it stood."""
    text = README.read_text(encoding="utf-8")
    README.write_text(text.split(HEADING)[0] + table(), encoding="utf-8")


if __name__ == "__main__":
    main()
