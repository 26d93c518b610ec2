from pathlib import Path

import pytest

from uav_firmware.config import ConfigError, Endpoint, Home, read_config


def test_without_flags_the_documented_defaults_hold() -> None:
    config = read_config([], {})
    assert config.system_id == 1
    assert config.speed == 1.0
    assert config.port == 14581
    assert config.broker == Endpoint(host="127.0.0.1", port=14540)
    assert config.gcs == Endpoint(host="127.0.0.1", port=14550)
    assert config.folder == Path("var/vehicle-1")
    assert not config.truth


def test_environment_overrides_defaults() -> None:
    config = read_config(
        ["--system-id", "3"],
        {
            "SPEED": "5",
            "SEED": "7",
            "WIND": "6",
            "MAVLINK_PORT": "15140",
            "GCS_PORT": "15150",
            "VEHICLE_PORT_BASE": "15180",
            "STATE_DIR": "/elsewhere",
            "TRUTH": "1",
        },
    )
    assert (config.speed, config.seed, config.wind_m_s) == (5.0, 7, 6.0)
    assert (config.broker.port, config.gcs.port, config.port) == (15140, 15150, 15183)
    assert config.folder == Path("/elsewhere/vehicle-3")
    assert config.truth


def test_flags_override_the_environment() -> None:
    config = read_config(
        ["--speed", "2", "--broker", "farm:9", "--port", "1234", "--truth"],
        {"SPEED": "5", "MAVLINK_PORT": "15140", "TRUTH": "0"},
    )
    assert config.speed == 2.0
    assert config.broker == Endpoint(host="farm", port=9)
    assert config.port == 1234
    assert config.truth


@pytest.mark.parametrize(("text", "speed"), [("max", 0.0), ("0", 0.0), ("0.5", 0.5)])
def test_speed_is_a_ratio_or_max(text: str, speed: float) -> None:
    assert read_config(["--speed", text], {}).speed == speed


def test_home_is_latitude_longitude_altitude_heading() -> None:
    assert read_config(["--home", "40.5,-3.5,600,370"], {}).home == Home(
        latitude_deg=40.5, longitude_deg=-3.5, altitude_amsl_m=600.0, heading_deg=10.0
    )


@pytest.mark.parametrize(
    "flags", [["--home", "-33.9,-151.2,-430,0"], ["--home=-33.9,-151.2,-430,0"]]
)
def test_home_may_lie_in_the_south_and_below_the_sea(flags: list[str]) -> None:
    home = read_config([*flags, "--system-id", "2"], {}).home
    assert home == Home(
        latitude_deg=-33.9, longitude_deg=-151.2, altitude_amsl_m=-430.0, heading_deg=0.0
    )


@pytest.mark.parametrize(
    ("flags", "named"),
    [
        (["--system-id", "0"], "--system-id"),
        (["--system-id", "251"], "--system-id"),
        (["--system-id", "one"], "--system-id"),
        (["--speed", "-1"], "--speed"),
        (["--speed", "nan"], "--speed"),
        (["--seed", "1.5"], "--seed"),
        (["--wind", "inf"], "--wind"),
        (["--noise", "-1"], "--noise"),
        (["--port", "70000"], "--port"),
        (["--broker", "14540"], "--broker"),
        (["--gcs", "host:port"], "--gcs"),
        (["--home", "40,3"], "--home"),
        (["--home", "91,3,0,0"], "--home"),
        (["--home", "40,3,0,inf"], "--home"),
        (["--truth", "perhaps"], "--truth"),
    ],
)
def test_a_bad_value_is_refused_by_name(flags: list[str], named: str) -> None:
    with pytest.raises(ConfigError, match=named):
        read_config(flags, {})
