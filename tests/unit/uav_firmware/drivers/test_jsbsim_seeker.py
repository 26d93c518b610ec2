"""The camera finds the farm's tractor in its picture, and only what is there."""

import math

import pytest

from sim.config import SimulationConfig
from sim.fault_schedule import Fault, Kind
from sim.simulation import Simulation
from tests.support.messages import changed
from uav_firmware.cal.camera import Gaze
from uav_firmware.drivers import jsbsim_seeker
from uav_firmware.drivers.jsbsim_seeker import JsbsimSeeker
from uav_firmware.lib.rotation import from_euler
from uav_firmware.msg.payload import Box, CameraLens

LENS = CameraLens(4.5, 6.3, 4.725, 2048, 1536)
WHOLE = Box(0.0, 0.0, 1.0, 1.0)


def world(noise: float = 0.0) -> Simulation:
    """A vehicle that hangs 20 m above the place that lies 20 m south of the tractor."""
    simulation = Simulation(SimulationConfig(sensor_noise_factor=noise))
    tractor = simulation.farm.subjects(simulation.farm_time_s)[0]
    east, north = tractor.place
    latitude, longitude = simulation.farm.plane.geodetic((east, north - 20.0))
    simulation.truth = changed(
        simulation.truth, latitude_deg=latitude, longitude_deg=longitude, altitude_amsl_m=671.35
    )
    return simulation


def looking(pitch_deg: float, yaw_deg: float, simulation: Simulation) -> Gaze:
    q = from_euler(0.0, math.radians(pitch_deg), math.radians(yaw_deg))
    return Gaze(LENS, q, simulation.truth.q_ned_frd)


def test_what_lies_ahead_and_below_is_in_the_middle() -> None:
    simulation = world()
    seeker = JsbsimSeeker(simulation)
    gaze = looking(-45.0, 0.0, simulation)
    assert seeker.lock(WHOLE, gaze)
    box = seeker.seen(gaze)
    assert box is not None
    assert 0.5 * (box.left + box.right) == pytest.approx(0.5, abs=0.02)
    assert 0.5 * (box.top + box.bottom) == pytest.approx(0.5, abs=0.02)
    assert box.left < box.right
    assert box.top < box.bottom


def test_it_is_seen_right_when_the_camera_turns_left_and_low_when_it_looks_up() -> None:
    simulation = world()
    seeker = JsbsimSeeker(simulation)
    assert seeker.lock(WHOLE, looking(-45.0, 0.0, simulation))
    left = seeker.seen(looking(-45.0, -15.0, simulation))
    up = seeker.seen(looking(-35.0, 0.0, simulation))
    assert left is not None
    assert up is not None
    assert left.left > 0.5
    assert up.top > 0.5


def test_beside_the_tractor_there_is_nothing_to_hold_on_to() -> None:
    simulation = world()
    seeker = JsbsimSeeker(simulation)
    assert not seeker.lock(Box(0.0, 0.0, 0.1, 0.1), looking(-45.0, 0.0, simulation))
    assert seeker.seen(looking(-45.0, 0.0, simulation)) is None


def test_out_of_the_picture_it_is_not_seen_and_it_comes_back() -> None:
    simulation = world()
    seeker = JsbsimSeeker(simulation)
    assert seeker.lock(WHOLE, looking(-45.0, 0.0, simulation))
    assert seeker.seen(looking(-45.0, 180.0, simulation)) is None
    assert seeker.seen(looking(-45.0, 0.0, simulation)) is not None


def test_a_dead_camera_sees_nothing() -> None:
    simulation = world()
    seeker = JsbsimSeeker(simulation)
    simulation.add_fault(Fault(kind=Kind.CAMERA_FAILURE))
    assert not seeker.lock(WHOLE, looking(-45.0, 0.0, simulation))


def test_behind_the_barn_the_tractor_is_neither_found_nor_held(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    simulation = world()
    seeker, gaze = JsbsimSeeker(simulation), looking(-45.0, 0.0, simulation)
    assert seeker.lock(WHOLE, gaze)
    monkeypatch.setattr(jsbsim_seeker, "share_in_sight", lambda _farm, _camera, _subject: 0.4)
    assert seeker.seen(gaze) is None
    assert not JsbsimSeeker(simulation).lock(WHOLE, gaze)
    monkeypatch.undo()
    assert seeker.seen(gaze) is not None
