"""`python -m deploy.training_flight FOLDER`: fly the build in a folder, for GCC's counters.

`FARM_PURE=1` must be set, so that the build in use is not loaded instead. A vehicle takes off in a
light wind, flies to a place, returns and lands, with telemetry to a ground station and a companion
and with a flight log. Nothing paces it, so that it is over within seconds. Whatever is not flown
here is compiled as without counts.

Exit code 1: the folder holds no build, or the vehicle has not flown.
"""

import math
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from uav_firmware.compiled import CompiledModules, read_manifest

if TYPE_CHECKING:
    from uav_firmware.cal.link import Address
    from uav_firmware.topology import Autopilot

_GROUND_STATION: Final = ("192.0.2.2", 14550)
_COMPANION: Final = ("192.0.2.1", 14540)
_SYSTEM_ID: Final = 1
_READY_S: Final = 30
_HEIGHT_M: Final = 8.0
_NORTH_DEG: Final = 2e-4  # 22 m
_LEG_S: Final = 15
_LANDING_S: Final = 40
_ARM, _TAKE_OFF, _REPOSITION, _RETURN = 400, 22, 192, 20  # MAV_CMD


class _Nowhere:
    """A link whose datagrams reach nobody."""

    def receive(self) -> "Sequence[tuple[bytes, Address]]":
        """Nothing."""
        return ()

    def send(self, datagram: bytes, address: "Address") -> None:
        """Drop a datagram."""

    def refused_addresses(self) -> "Sequence[Address]":
        """None."""
        return ()

    def close(self) -> None:
        """Nothing to release."""


def fly(folder: Path) -> bool:
    """Fly once, with the vehicle's files in a folder; whether it has taken off."""
    from sim.config import SimulationConfig  # noqa: PLC0415 - not before `main` has found the build
    from sim.simulation import Simulation  # noqa: PLC0415 - as above
    from uav_firmware.drivers.file_storage import FileStorage  # noqa: PLC0415 - as above
    from uav_firmware.drivers.jsbsim import JsbsimVehicle  # noqa: PLC0415 - as above
    from uav_firmware.drivers.log_folder import LogFolder  # noqa: PLC0415 - as above
    from uav_firmware.module_errors import end_flight  # noqa: PLC0415 - as above
    from uav_firmware.modules.mavlink.wire.peers import Peer, Profile  # noqa: PLC0415 - as above
    from uav_firmware.topology import Autopilot  # noqa: PLC0415 - as above

    simulation = Simulation(SimulationConfig(wind_speed_m_s=3.0))
    autopilot = Autopilot(
        JsbsimVehicle(simulation),
        _Nowhere(),
        FileStorage(folder),
        system_id=_SYSTEM_ID,
        peers=(
            Peer(address=_COMPANION, profile=Profile.ONBOARD),
            Peer(address=_GROUND_STATION, profile=Profile.GROUND_STATION),
        ),
        boot_time_utc_us=0,
        write_line=lambda _time_us, _text: None,
        log_store=LogFolder(folder / "log"),
        on_error=end_flight,
    )
    _run(autopilot, _READY_S)
    home = autopilot.topics.home_position.value
    if home is None:
        return False
    altitude_m = home.altitude_amsl_m + _HEIGHT_M
    place = (home.latitude_deg + _NORTH_DEG, home.longitude_deg, altitude_m)
    _command(autopilot, _TAKE_OFF, 0.0, math.nan, math.nan, altitude_m)
    _command(autopilot, _ARM, 1.0, 0.0, 0.0, 0.0)
    _run(autopilot, _LEG_S)
    height_m = simulation.truth.height_above_home_m
    _command(autopilot, _REPOSITION, -1.0, *place)
    _run(autopilot, _LEG_S)
    _command(autopilot, _RETURN, 0.0, 0.0, 0.0, 0.0)
    _run(autopilot, _LANDING_S)
    autopilot.logger.close()
    return height_m > 0.5 * _HEIGHT_M


def _command(
    autopilot: "Autopilot", command: int, first: float, x: float, y: float, z: float
) -> None:
    """Let the vehicle's own computer order something: parameters 1 and 5 to 7."""
    from uav_firmware.msg.status import VehicleCommand  # noqa: PLC0415 - as above

    second_to_fourth = (0.0, 0.0, 0.0) if command == _ARM else (0.0, 0.0, math.nan)
    now_us = autopilot.vehicle.time_us
    autopilot.topics.vehicle_command.publish(
        VehicleCommand(now_us, command, first, *second_to_fourth, x, y, z, 0, 0, 0, 0)
    )
    autopilot.scheduler.step()


def _run(autopilot: "Autopilot", seconds: int) -> None:
    for _ in range(seconds * 1_000_000 // autopilot.vehicle.step_us):
        autopilot.scheduler.step()


def main(arguments: Sequence[str]) -> int:
    """Load the build, then fly."""
    build = Path(arguments[0])
    manifest = read_manifest(build)
    if manifest is None:
        print(f"{build} holds no build", file=sys.stderr)
        return 1
    sys.meta_path.insert(0, CompiledModules(manifest.modules, build))
    with tempfile.TemporaryDirectory() as folder:
        if fly(Path(folder)):
            return 0
    print("the vehicle has not taken off", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
