"""The simulated vehicle's parts break by order, by file and by MAVLink's numbers."""

import math
from pathlib import Path

import pytest

from sim.config import SimulationConfig
from sim.faults.console import FaultConsole
from sim.simulation import Simulation
from uav_firmware.cal.faults import FaultInjector
from uav_firmware.drivers.jsbsim import JsbsimVehicle
from uav_firmware.drivers.jsbsim_build import simulated_vehicle

GYRO, BARO, GPS, MOTOR, SERVO, MAVLINK = 0, 3, 4, 101, 102, 105
OK, OFF, STUCK = 0, 1, 2


def vehicle(folder: Path | None = None) -> JsbsimVehicle:
    console = None if folder is None else FaultConsole(folder)
    return JsbsimVehicle(Simulation(SimulationConfig()), console)


def run(made: JsbsimVehicle, seconds: float) -> bool:
    """Let time pass; gives whether the barometer was heard."""
    heard = False
    for _ in range(round(seconds * 250)):
        made.advance()
        heard |= made.read_baro() is not None
    return heard


def started(folder: Path, *, world: str = "farm", faults: Path | None = None) -> JsbsimVehicle:
    return simulated_vehicle(
        number=2,
        seed=1,
        farm_seed=1,
        world=world,
        home=None,
        wind_m_s=0.0,
        wind_from_deg=270.0,
        gps="m9n",
        noise_factor=1.0,
        start_time_utc_us=1_780_300_800_000_000,
        faults_path=faults,
        console_folder=folder,
        pictures=None,
        truth_path=None,
    )


def test_it_can_be_asked_to_break_things() -> None:
    assert isinstance(vehicle(), FaultInjector)


def test_a_unit_fails_and_is_mended_by_number() -> None:
    made = vehicle()
    assert made.inject(BARO, OFF, 0)
    assert not run(made, 0.5)
    assert made.inject(BARO, OK, 0)
    assert run(made, 0.5)


def test_one_motor_of_four_is_mended() -> None:
    made = vehicle()
    assert made.inject(MOTOR, OFF, 0)
    assert made.inject(MOTOR, OK, 2)
    made.write_motors((0.3, 0.3, 0.3, 0.3))
    run(made, 1.0)
    esc = made.read_esc()
    while esc is None:
        made.advance()
        esc = made.read_esc()
    assert esc.rotor_rpm[1] > 3000.0
    assert max(esc.rotor_rpm[0], *esc.rotor_rpm[2:]) < 100.0


@pytest.mark.parametrize(
    ("unit", "failure", "instance"),
    [(SERVO, OFF, 0), (GPS, 7, 0), (MOTOR, OFF, 5), (GPS, OFF, 2), (SERVO, OK, 0), (-1, -1, -1)],
)
def test_what_the_vehicle_does_not_have_cannot_fail(unit: int, failure: int, instance: int) -> None:
    made = vehicle()
    assert not made.inject(unit, failure, instance)


def test_a_dead_gyroscope_tells_no_number() -> None:
    made = vehicle()
    made.inject(GYRO, OFF, 1)
    made.advance()
    assert all(math.isnan(rate) for rate in made.read_imu().rate_frd)


def test_a_lost_link_is_lost_from_the_order_on() -> None:
    made = vehicle()
    assert not made.link_lost
    made.inject(MAVLINK, OFF, 0)
    assert made.link_lost


def test_lines_in_the_file_are_carried_out_and_answered(tmp_path: Path) -> None:
    made = vehicle(tmp_path)
    run(made, 0.2)
    with (tmp_path / "faults.txt").open("a", encoding="utf-8") as file:
        file.write("baro_loss duration_s=1\nengine_loss\n")
    run(made, 0.2)
    assert not run(made, 0.5)
    run(made, 0.6)
    assert run(made, 0.2)
    made.close()
    log = (tmp_path / "faults.log").read_text(encoding="utf-8")
    assert "accepted: baro_loss duration_s=1" in log
    assert "refused: engine_loss: there is no fault 'engine_loss'" in log
    assert log.index("began: baro_loss") < log.index("ended: baro_loss")


def test_a_file_of_faults_is_followed(tmp_path: Path) -> None:
    path = tmp_path / "faults.toml"
    path.write_text('[[fault]]\nkind = "baro_loss"\nstart_s = 0.5\n', encoding="utf-8")
    made = started(tmp_path / "vehicle", faults=path)
    assert run(made, 0.4)
    run(made, 0.2)
    assert not run(made, 0.5)
    made.close()


def test_a_file_or_a_world_that_there_is_not_stops_the_start(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="there is no world 'moon'"):
        started(tmp_path, world="moon")
    with pytest.raises(OSError, match=r"nothing\.toml"):
        started(tmp_path, faults=tmp_path / "nothing.toml")


def test_vehicles_of_a_world_stand_there_side_by_side(tmp_path: Path) -> None:
    made = started(tmp_path, world="taveuni")
    truth = made.read_truth()
    assert truth.latitude_deg == pytest.approx(-16.855)
    metres = ((truth.longitude_deg - 179.9999) % 360.0) * 106_500.0
    assert metres == pytest.approx(3.0, abs=0.1)
    made.close()
