"""MAVSDK's client, which knows nothing of this project, with a vehicle process to talk to."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission_raw import MissionItem
from mavsdk.plugins.telemetry import FlightMode, Telemetry

from tests.conformance.ground_station import vehicle_process
from tests.support.system import free_ports, wait_for

METRES_PER_DEGREE = 111_320.0
LATITUDE_DEG, LONGITUDE_DEG, ALTITUDE_AMSL_M = 40.4434, -3.7382, 650.0
"""Where the simulation puts a vehicle."""


@contextmanager
def connected(system_id: int, speed: float, state: Path) -> Iterator[Any]:
    """A vehicle that is ready, as MAVSDK's system."""
    own, broker, ground = free_ports(3)
    with vehicle_process(system_id, speed, (own, broker, ground), state):
        sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
        sdk.add_any_connection(f"udpin://127.0.0.1:{ground}")
        system = wait_for(lambda: sdk.first_autopilot(timeout_s=5.0), "MAVSDK's discovery")
        wait_for(Telemetry(system).health_all_ok, "a vehicle that is ready")
        yield system
        sdk.destroy()


class Pilot:
    """What every flight needs: where the vehicle is, in which mode, up and down again."""

    def __init__(self, system: Any) -> None:
        self.action: Any = Action(system)
        self.telemetry: Any = Telemetry(system)
        self.telemetry.set_rate_position(10.0)
        self.telemetry.set_rate_velocity_ned(10.0)
        self.telemetry.set_rate_attitude_euler(20.0)
        wait_for(lambda: math.isfinite(self.height_m), "a position")
        wait_for(lambda: math.isfinite(self.speed_m_s), "a velocity")
        wait_for(lambda: self.telemetry.attitude_euler().timestamp_us > 0, "the vehicle's time")

    @property
    def time_s(self) -> float:
        """The vehicle's own time, whatever the speed of the simulation."""
        return float(self.telemetry.attitude_euler().timestamp_us) / 1e6

    @property
    def height_m(self) -> float:
        """Above home."""
        return float(self.telemetry.position().relative_altitude_m)

    @property
    def speed_m_s(self) -> float:
        """Over the ground."""
        velocity = self.telemetry.velocity_ned()
        return math.hypot(velocity.north_m_s, velocity.east_m_s)

    @property
    def mode(self) -> FlightMode:
        return FlightMode(self.telemetry.flight_mode())

    def place_m(self) -> tuple[float, float]:
        """North and east of the simulation's home."""
        position = self.telemetry.position()
        return offset_m(position.latitude_deg, position.longitude_deg)

    def distance_m(self, north_m: float, east_m: float) -> float:
        """From a place, horizontally."""
        return math.dist(self.place_m(), (north_m, east_m))

    def from_home_m(self) -> float:
        """Horizontally, from where a return ends."""
        home = self.telemetry.home()
        return math.dist(self.place_m(), offset_m(home.latitude_deg, home.longitude_deg))

    def watch(self, duration_s: float, look: Callable[[], float]) -> list[float]:
        """What a look gives over some of the vehicle's time."""
        until_s = self.time_s + duration_s
        seen: list[float] = []

        def over() -> bool:
            seen.append(look())
            return self.time_s > until_s

        wait_for(over, f"{duration_s} s of the vehicle's time")
        return seen

    def take_off(self, height_m: float = 8.0) -> None:
        """Up to a height and hold, from the ground or the air."""
        if self.telemetry.armed():
            return
        self.action.set_takeoff_altitude(height_m)
        self.action.takeoff()
        self.action.arm()
        wait_for(lambda: self.height_m > height_m - 0.5, f"{height_m} m height")
        wait_for(lambda: self.mode is FlightMode.HOLD, "hold after take-off")

    def land(self) -> None:
        """Down, and wait for the motors to stop."""
        if self.telemetry.armed():
            self.action.land()
            wait_for(lambda: not self.telemetry.armed(), "the landing")


_SHRINKING = math.cos(math.radians(LATITUDE_DEG))


def offset_m(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """North and east of the simulation's home."""
    return (
        (latitude_deg - LATITUDE_DEG) * METRES_PER_DEGREE,
        (longitude_deg - LONGITUDE_DEG) * METRES_PER_DEGREE * _SHRINKING,
    )


def place(north_m: float, east_m: float) -> tuple[float, float]:
    """Latitude and longitude of a place near home [deg]."""
    return (
        LATITUDE_DEG + north_m / METRES_PER_DEGREE,
        LONGITUDE_DEG + east_m / METRES_PER_DEGREE / _SHRINKING,
    )


def as_text(items: list[MissionItem]) -> list[str]:
    """Comparable form of items, in which NaN equals NaN."""
    return [repr(sorted(vars(each).items())) for each in items]
