"""The whole autopilot in this process, operated by orders, in vehicle time.

Nothing is paced, nothing listens on a socket; the operator's commands still travel as MAVLink.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v20 import common

from sim.config import SimulationConfig
from sim.physics.truth import Truth
from sim.simulation import Simulation
from tests.support.geodesy import LocalGround
from tests.support.ground_station import GroundStation, MemoryLink
from uav_firmware.cal.log_store import LogStore
from uav_firmware.drivers.file_storage import FileStorage
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.module_errors import end_flight
from uav_firmware.modules.mavlink.wire.peers import Peer
from uav_firmware.msg.estimate import VehicleLocalPosition
from uav_firmware.msg.status import LandDetected, NavigationState, VehicleStatus
from uav_firmware.topology import Autopilot

SYSTEM_ID: Final = 1
_HEARTBEAT_STEPS: Final = 250
_PX4_AUTO: Final = 4
_PX4_AUTO_MISSION: Final = 4


class TimeoutInVehicleTimeError(AssertionError):
    """What the operator waits for has not happened in time."""


class AutopilotTester:
    """One vehicle and its operator."""

    def __init__(
        self,
        config: SimulationConfig,
        folder: Path,
        *,
        link: MemoryLink | None = None,
        peers: Sequence[Peer] = (),
        log_store: LogStore | None = None,
        on_error: Callable[[str, Exception], None] | None = end_flight,
    ) -> None:
        self.simulation = Simulation(config)
        self._link = MemoryLink() if link is None else link
        self.lines: list[str] = []
        self.autopilot = Autopilot(
            JsbsimVehicle(self.simulation),
            self._link,
            FileStorage(folder),
            system_id=SYSTEM_ID,
            peers=peers,
            boot_time_utc_us=0,
            write_line=lambda time_us, text: self.lines.append(f"{time_us * 1e-6:.2f} {text}"),
            log_store=log_store,
            on_error=on_error,
        )
        self.ground_station = GroundStation(self._link, SYSTEM_ID)
        self.start = start = self.simulation.truth
        self._ground = LocalGround(start.latitude_deg, start.longitude_deg, start.altitude_amsl_m)
        self._steps = 0
        self.heartbeats = True  # Whether the operator's ground station sends heartbeats
        self._watchers: list[Callable[[], None]] = []

    # What the operator does.

    def wait_until_ready(self) -> None:
        """Wait until the vehicle may be armed."""
        self.wait_until(lambda: self.status.preflight_checks_pass, 60.0, "ready to arm")

    def arm(self) -> None:
        """Arm; the vehicle must accept."""
        self.send_command(common.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def take_off(self, height_m: float) -> None:
        """Take off to a height above home and hold there."""
        home = self.autopilot.topics.home_position.value
        assert home is not None
        altitude = home.altitude_amsl_m + height_m
        nan = math.nan
        self.send_command(common.MAV_CMD_NAV_TAKEOFF, 0.0, nan, nan, nan, nan, nan, altitude)
        self.arm()

    def land(self) -> None:
        """Land here."""
        self.send_command(common.MAV_CMD_NAV_LAND)

    def return_home(self) -> None:
        """Fly home and land."""
        self.send_command(common.MAV_CMD_NAV_RETURN_TO_LAUNCH)

    def upload(self, items: Sequence[Any]) -> None:
        """Upload a mission; the vehicle must accept it."""
        self.ground_station.upload(items)
        self.wait_until(
            lambda: self.ground_station.mission_ack is not None, 5.0, "mission acknowledged"
        )
        assert self.ground_station.mission_ack == common.MAV_MISSION_ACCEPTED

    def start_mission(self) -> None:
        """Change to mission mode, then arm."""
        self.send_command(common.MAV_CMD_DO_SET_MODE, 1.0, _PX4_AUTO, _PX4_AUTO_MISSION)
        self.arm()

    def send_command(self, command: int, *parameters: float) -> None:
        """Send a command; the vehicle must accept.

        An enemy's commands may be answered to everybody in between.
        """
        station = self.ground_station
        before = len(station.acks)
        station.command(command, *parameters)

        def results() -> list[int]:
            return [result for answered, result in station.acks[before:] if answered == command]

        self.wait_until(lambda: bool(results()), 2.0, f"answered command {command}")
        assert results()[-1] == common.MAV_RESULT_ACCEPTED, station.texts[-3:]

    # What the operator waits for.

    def run_for(self, seconds: float) -> None:
        """Let vehicle time pass."""
        for _ in range(round(seconds * 1e6 / self.autopilot.vehicle.step_us)):
            self._step()

    def wait_until(self, condition: Callable[[], bool], seconds: float, what: str) -> None:
        """Let vehicle time pass until something holds."""
        for _ in range(round(seconds * 1e6 / self.autopilot.vehicle.step_us)):
            if condition():
                return
            self._step()
        raise TimeoutInVehicleTimeError(f"not {what} within {seconds} s; {self.lines[-5:]}")

    def wait_until_landed(self, seconds: float = 120.0) -> None:
        """Wait until the flight is over: on the ground, motors disarmed."""
        self.wait_until(lambda: not self.landed, 30.0, "taken off")
        self.wait_until(lambda: self.landed, seconds, "landed")
        self.wait_until(lambda: not self.status.armed, 10.0, "disarmed")

    def watch(self, watcher: Callable[[], None]) -> None:
        """Call `watcher` after every step from now on."""
        self._watchers.append(watcher)

    # What the operator sees.

    @property
    def status(self) -> VehicleStatus:
        """State of the vehicle."""
        status = self.autopilot.topics.vehicle_status.value
        if status is None:
            self._step()
            return self.status
        return status

    @property
    def mode(self) -> NavigationState:
        """Flight mode."""
        return self.status.navigation_state

    def is_in(self, mode: NavigationState) -> bool:
        """Whether it flies in a mode."""
        return self.mode is mode

    def has_status_text(self, text: str) -> bool:
        """Whether the vehicle has sent a status text that contains this text."""
        return any(text in line for line in self.lines)

    @property
    def landed(self) -> bool:
        """Whether the land detector sees the ground."""
        land: LandDetected | None = self.autopilot.topics.land_detected.value
        return land is None or land.landed

    @property
    def estimate(self) -> VehicleLocalPosition:
        """What the estimator believes."""
        estimate = self.autopilot.topics.vehicle_local_position.value
        assert estimate is not None
        return estimate

    @property
    def truth(self) -> Truth:
        """What the simulator knows."""
        return self.simulation.truth

    def true_position(self) -> tuple[float, float, float]:
        """True metres north, east and up of where the vehicle stood."""
        truth = self.simulation.truth
        north, east = self.north_east_m(truth.latitude_deg, truth.longitude_deg)
        return north, east, truth.altitude_amsl_m - self.start.altitude_amsl_m

    def north_east_m(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """Metres north and east of the start."""
        return self._ground.north_east_m(latitude_deg, longitude_deg)

    def place(self, north_m: float, east_m: float, height_m: float) -> tuple[float, float, float]:
        """Latitude, longitude [deg] and height [m] of a place about the start."""
        return (*self._ground.place(north_m, east_m), height_m)

    def _step(self) -> None:
        if self.heartbeats and self._steps % _HEARTBEAT_STEPS == 0:
            self.ground_station.heartbeat()
        self._steps += 1
        self.autopilot.scheduler.step()
        self.ground_station.receive()
        for watcher in self._watchers:
            watcher()


def hovering_tester(folder: Path, seed: int, height_m: float) -> AutopilotTester:
    """Return a vehicle with an RTK receiver that holds at a height above home [m]."""
    tester = AutopilotTester(SimulationConfig(gps="rtk", seed=seed), folder)
    tester.wait_until_ready()
    tester.take_off(height_m)
    tester.wait_until(lambda: tester.mode is NavigationState.AUTO_LOITER, 30.0, "up")
    return tester
