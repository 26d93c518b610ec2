"""Builds the simulated vehicle of a configuration: its world, faults, camera and console."""

from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from sim.config import SimulationConfig, start_east_m
from sim.faults.console import FaultConsole
from sim.faults.notation import read_faults
from sim.physics.worlds import world as world_named
from sim.simulation import Simulation
from uav_firmware.cal.vehicle import Fitted
from uav_firmware.drivers.file_room import Room
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.drivers.jsbsim_camera import JsbsimCamera
from uav_firmware.drivers.jsbsim_video import JsbsimRecorder, JsbsimStreamer

STANDARD: Final = Fitted(imus=3, barometers=2, compasses=2)
"""Sensors of a flight controller board of the Pixhawk class."""

_FARM_DEG: Final = 0.02  # Two kilometres: farther away a home has a farm of its own


class Pictures(NamedTuple):
    """Storage and timing of the camera's pictures."""

    folder: Path
    room: Room  # Quota of the folder
    in_step: bool  # Vehicle time waits for pictures, so that the same flight has the same reports
    hurried: bool  # Faster than real time: vehicle time waits for a camera whose memory is full
    live_port: int = 0  # TCP port of the live view; 0 none
    live_at_once: bool = False  # It is offered from the start


def simulated_vehicle(
    *,
    number: int,
    seed: int,
    farm_seed: int,
    world: str,
    home: tuple[float, float, float, float] | None,
    wind_m_s: float,
    wind_from_deg: float,
    gps: str,
    noise_factor: float,
    start_time_utc_us: int,
    faults_path: Path | None,
    console_folder: Path | None,
    pictures: Pictures | None,
    truth_path: Path | None,
    fitted: Fitted = STANDARD,
) -> JsbsimVehicle:
    """Make vehicle 1, 2, 3, ... of a farm.

    `home` is latitude [deg], longitude [deg], altitude above mean sea level [m] and heading
    [deg]; None is the home of `world`, where the vehicles stand side by side. The farm is at the
    world's home, or at `home` if that is far from it. The GNSS receiver
    reports `start_time_utc_us` [us since 1970] at time zero. `faults_path` is a file of scheduled
    faults; in `console_folder` more can be injected in flight. Without `pictures` there is no
    camera.

    Raises:
        ValueError: if a value is out of range, or the file of faults cannot be used.
        OSError: if a file cannot be read or created.
    """
    place = world_named(world)
    yard = (place.latitude_deg, place.longitude_deg, place.altitude_amsl_m)
    config = SimulationConfig(
        seed=seed,
        farm_seed=farm_seed,
        farm_origin=yard if home is None or _on_the_farm(yard, home) else None,
        home_latitude_deg=place.latitude_deg,
        home_longitude_deg=place.longitude_deg,
        home_altitude_amsl_m=place.altitude_amsl_m,
        wind_speed_m_s=wind_m_s,
        wind_from_deg=wind_from_deg,
        gps=gps,
        sensor_noise_factor=noise_factor,
        start_time_utc_us=start_time_utc_us,
        faults=() if faults_path is None else read_faults(faults_path),
        truth_log_path=truth_path,
        imus=fitted.imus,
        barometers=fitted.barometers,
        compasses=fitted.compasses,
    )
    if home is None:
        config = replace(config, start_east_m=start_east_m(number))
    else:
        latitude, longitude, altitude, heading = home
        config = replace(
            config,
            home_latitude_deg=latitude,
            home_longitude_deg=longitude,
            home_altitude_amsl_m=altitude,
            heading_deg=heading,
        )
    console = None if console_folder is None else FaultConsole(console_folder)
    simulation, camera, recorder, streamer = Simulation(config), None, None, None
    if pictures is not None:
        serial = f"F450-{number:04}"
        folder, room, in_step = pictures.folder, pictures.room, pictures.in_step
        camera = JsbsimCamera(
            simulation, folder, room, serial=serial, in_step=in_step, hurried=pictures.hurried
        )
        recorder = JsbsimRecorder(simulation, folder, room, in_step=in_step)
        streamer = (
            JsbsimStreamer(simulation, pictures.live_port, starts_at_once=pictures.live_at_once)
            if pictures.live_port
            else None
        )
    return JsbsimVehicle(simulation, console, camera, recorder, streamer)


def _on_the_farm(yard: tuple[float, float, float], home: tuple[float, float, float, float]) -> bool:
    """Whether a home is on the farm about a yard: near it, and on the same level ground."""
    near = all(
        abs(there - here) < _FARM_DEG for there, here in zip(home[:2], yard[:2], strict=True)
    )
    return near and home[2] == yard[2]
