import re
import subprocess
import sys
from pathlib import Path

import pytest

from sim.launch.settings import VARIABLES, SettingsError, from_environment
from tests.support.system import ROOT


def test_the_help_and_the_guide_list_every_variable() -> None:
    shown = subprocess.run(
        [sys.executable, "-m", "sim", "--help"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    guide = (ROOT / "docs/how-to/run-the-simulation.md").read_text().split("## The mock cloud")[0]
    cells = [line.split("|")[1] for line in guide.splitlines() if line.startswith("| `")]
    named = {name for cell in cells for name in re.findall(r"`([A-Z_]+)`", cell)}
    assert named == set(VARIABLES)
    assert all(re.search(rf"^  {name} ", shown, re.MULTILINE) for name in VARIABLES)


def test_without_variables_the_documented_defaults_hold() -> None:
    settings = from_environment({})
    assert (settings.vehicles, settings.speed) == (1, 1.0)
    assert settings.edge_url == "http://127.0.0.1:8000"
    assert settings.cloud_url == "http://127.0.0.1:8100"
    assert (settings.mavlink_port, settings.gcs_port, settings.vehicle_port(2)) == (
        14540,
        14550,
        14582,
    )
    assert settings.key_path("operator") == Path("var/keys/operator.key")


def test_records_go_over_http_unless_a_broker_has_a_port() -> None:
    assert from_environment({"MQTT_PORT": ""}).mqtt_url is None
    settings = from_environment({"MQTT_PORT": "1884"})
    assert settings.mqtt_url == "mqtt://127.0.0.1:1884/afarcloud/farm"
    assert settings.cloud_url == "http://127.0.0.1:8100"


def test_a_broker_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda *_, **__: None)
    assert from_environment({}).mosquitto is None
    with pytest.raises(SettingsError, match=r"MQTT_PORT.*mosquitto"):
        from_environment({"MQTT_PORT": "1884"})


def test_an_empty_variable_is_no_variable() -> None:
    assert from_environment({"PLAN": "", "VEHICLES": "", "STATE_DIR": ""}) == from_environment({})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("VEHICLES", "0"),
        ("VEHICLES", "101"),
        ("VEHICLES", "1.5"),
        ("VEHICLES", "many"),
        ("SPEED", "-1"),
        ("SPEED", "nan"),
        ("EDGE_PORT", "0"),
        ("CLOUD_PORT", "65536"),
        ("PLAN", "/nowhere/plan.json"),
        ("WIND", "abc"),
        ("WIND", "31"),
        ("WIND", "nan"),
        ("GPS", "foo"),
        ("SEED", "-1"),
        ("TRUTH", "maybe"),
    ],
)
def test_a_setting_that_does_not_fit_is_named(name: str, value: str) -> None:
    with pytest.raises(SettingsError, match=name):
        from_environment({name: value})


def test_testers_are_numbered_behind_the_vehicles() -> None:
    settings = from_environment({"VEHICLES": "2", "TESTERS": "2"})
    assert list(settings.tester_ids) == [3, 4]
    assert list(settings.started_ids) == [1, 2]


def test_a_tester_with_a_script_is_started_like_a_vehicle(tmp_path: Path) -> None:
    script = tmp_path / "script"
    script.touch()
    given = {"VEHICLES": "0", "TESTERS": "1", "TESTER_SCRIPT": str(script)}
    assert list(from_environment(given).started_ids) == [1]


@pytest.mark.parametrize(
    "given",
    [
        {"VEHICLES": "0"},
        {"TESTERS": "-1"},
        {"TESTERS": "100"},
        {"TESTER_SCRIPT": "/nothing/here"},
    ],
)
def test_a_system_needs_a_vehicle_or_a_tester_that_can_be_had(given: dict[str, str]) -> None:
    with pytest.raises(SettingsError, match=next(iter(given))):
        from_environment(given)
