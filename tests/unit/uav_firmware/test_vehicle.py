import socket
from pathlib import Path

import pytest

from uav_firmware.config import ConfigError, read_config
from uav_firmware.drivers.named_link import NamedLink
from uav_firmware.msg.sensors import SensorTruth
from uav_firmware.vehicle import addresses, bind_link, build_vehicle

METRES_PER_DEGREE_EAST = 84_800.0  # about, at the simulation's home


def truth_of(folder: Path, *flags: str) -> SensorTruth:
    vehicle = build_vehicle(read_config(["--state-dir", str(folder), *flags], {}), 0)
    truth = vehicle.read_truth()
    vehicle.close()
    assert truth is not None
    return truth


def test_vehicles_stand_three_metres_apart_to_the_east(tmp_path: Path) -> None:
    first, third = (truth_of(tmp_path, "--system-id", number) for number in ("1", "3"))
    east_m = (third.longitude_deg - first.longitude_deg) * METRES_PER_DEGREE_EAST
    assert east_m == pytest.approx(6.0, rel=0.01)
    assert third.latitude_deg == pytest.approx(first.latitude_deg, abs=1e-9)


def test_a_home_that_is_given_is_taken_as_it_is(tmp_path: Path) -> None:
    truth = truth_of(tmp_path, "--system-id", "3", "--home", "41.5,-4.25,700,90")
    assert truth.latitude_deg == pytest.approx(41.5, abs=1e-7)
    assert truth.longitude_deg == pytest.approx(-4.25, abs=1e-7)
    assert truth.altitude_amsl_m == pytest.approx(700.0, abs=0.3)


def test_the_true_track_is_written_only_when_asked_for(tmp_path: Path) -> None:
    truth_of(tmp_path / "without")
    assert not list(tmp_path.rglob("truth.csv"))
    truth_of(tmp_path / "with", "--truth")
    assert (tmp_path / "with" / "vehicle-1" / "truth.csv").is_file()


def test_two_vehicles_of_one_seed_do_not_share_their_noise(tmp_path: Path) -> None:
    forces = set()
    for number in ("1", "2"):
        config = read_config(["--system-id", number, "--state-dir", str(tmp_path)], {})
        vehicle = build_vehicle(config, 0)
        vehicle.advance()
        forces.add(vehicle.read_imu().specific_force_frd)
        vehicle.close()
    assert len(forces) == 2


def test_a_taken_port_is_named() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        with pytest.raises(OSError, match=str(port)):
            bind_link(read_config(["--port", str(port)], {}))


def test_names_of_this_machine_become_addresses() -> None:
    broker, gcs = addresses(read_config(["--broker", "localhost:9"], {}))
    assert broker == ("127.0.0.1", 9)
    assert gcs == ("127.0.0.1", 14550)


def test_a_name_of_another_machine_stays_a_name_that_the_link_looks_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(socket, "gethostbyname", lambda _host: "192.0.2.7")
    config = read_config(
        ["--broker", "broker:14540", "--gcs", "192.0.2.9:14550", "--port", "0"], {}
    )
    assert addresses(config)[0] == ("broker", 14540)
    link = bind_link(config)
    assert isinstance(link, NamedLink)
    link.close()


def test_numeric_peers_need_no_looking_up() -> None:
    link = bind_link(read_config(["--broker", "192.0.2.7:14540", "--port", "0"], {}))
    assert not isinstance(link, NamedLink)
    link.close()


def test_a_host_without_address_is_named() -> None:
    with pytest.raises(ConfigError, match="--gcs"):
        addresses(read_config(["--gcs", "no.such.host.invalid:9"], {}))
