"""The units start what the packages install, with settings that the programs know."""

import configparser
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from edge_server.__main__ import _parser
from tests.unit.deploy.dockerfile import ROOT
from tests.unit.deploy.settings import KNOWN

UNITS = sorted((ROOT / "deploy/systemd").iterdir())
SERVICES = [unit for unit in UNITS if unit.suffix == ".service"]
PROGRAMS = "/opt/farm/bin"
every_service = pytest.mark.parametrize("unit", SERVICES, ids=lambda unit: unit.stem)


def section(unit: Path, name: str) -> configparser.SectionProxy:
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment]  # names keep their case
    parser.read(unit)
    return parser[name]


def command(unit: Path) -> list[str]:
    return section(unit, "Service")["ExecStart"].split()


def test_systemd_takes_every_unit(tmp_path: Path) -> None:
    tool = shutil.which("systemd-analyze")
    if tool is None:
        pytest.skip("without systemd-analyze: apt-get install systemd")
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in {command(unit)[0].removeprefix(f"{PROGRAMS}/") for unit in SERVICES}:
        (programs / name).symlink_to("/bin/true")
    for unit in UNITS:
        (tmp_path / unit.name).write_text(unit.read_text().replace(PROGRAMS, str(programs)))
    checked = subprocess.run(
        [tool, "verify", *(str(tmp_path / unit.name) for unit in UNITS)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (checked.returncode, checked.stderr) == (0, "")


@every_service
def test_a_unit_starts_an_installed_program(unit: Path) -> None:
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    program, *_ = command(unit)
    assert program.removeprefix(f"{PROGRAMS}/") in scripts


def test_the_timer_starts_a_backup_that_the_edge_server_makes() -> None:
    _, *arguments = command(ROOT / "deploy/systemd/farm-backup.service")
    options = _parser().parse_args(arguments)
    assert (options.command, options.keep) == ("backup", 14)
    assert (ROOT / "deploy/systemd/farm-backup.timer").is_file()


@every_service
def test_every_variable_of_a_unit_is_a_setting(unit: Path) -> None:
    given = re.findall(r"^Environment=(\w+)=", unit.read_text(), re.MULTILINE)
    used = set(re.findall(r"\$\{(\w+)\}", unit.read_text()))
    assert set(given) - used <= KNOWN["edge-server"] | KNOWN["broker"]
    assert "EnvironmentFile=/etc/farm/farm.env" in unit.read_text()


@every_service
def test_a_unit_runs_without_root_and_writes_to_its_state_only(unit: Path) -> None:
    service = section(unit, "Service")
    assert service["User"] == "farm"
    assert service["NoNewPrivileges"] == "yes"
    assert service["CapabilityBoundingSet"] == ""
    assert service["ProtectSystem"] == "strict"


def test_a_program_ends_before_systemd_kills_it_and_starts_again() -> None:
    for name in ("farm-edge", "farm-broker"):
        service = section(ROOT / f"deploy/systemd/{name}.service", "Service")
        assert service["Restart"] == "always"
        assert int(service["TimeoutStopSec"]) >= 20
