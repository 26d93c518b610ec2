"""The distribution: versions, extras, lock files; the wheel installed afresh, as by `make dist`."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from deploy.check_distribution import LOCKS, PROGRAMS, SIMULATOR
from farm_flight_bridge import VERSION
from tests.support.system import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
ARM = ("manylinux_2_28_aarch64", "manylinux_2_17_aarch64", "manylinux2014_aarch64")


def locked(lock: str) -> set[str]:
    return set(re.findall(r"^([a-z0-9-]+)==", (ROOT / lock).read_text(), re.MULTILINE))


def declared(extra: str) -> set[str]:
    requirements = PROJECT["optional-dependencies"][extra] + PROJECT["dependencies"]
    return {re.split(r"[\[>]", requirement)[0] for requirement in requirements}


@pytest.mark.parametrize("extra", ["edge", "broker"])
def test_a_program_of_the_farm_is_locked_without_the_simulator(extra: str) -> None:
    assert declared(extra) <= locked(LOCKS[extra]) < locked("requirements.lock")
    assert not locked(LOCKS[extra]) & set(SIMULATOR)


def test_lock_files_agree_on_versions_and_name_no_address() -> None:
    pinned = {
        lock.name: set(re.findall(r"^[a-z0-9-]+==\S+", lock.read_text(), re.MULTILINE))
        for lock in ROOT.glob("requirements*.lock")
    }
    del pinned["requirements-console.lock"]  # Node, where the machine has none
    longest = pinned.pop("requirements-dev.lock")
    assert {name: found - longest for name, found in pinned.items() if not found <= longest} == {}
    assert not [lock.name for lock in ROOT.glob("*.lock") if "://" in lock.read_text()]


@pytest.mark.parametrize("module", ["edge_server", "mavlink_broker", "uav_firmware", "sim"])
def test_every_program_prints_its_version(module: str) -> None:
    shown = subprocess.run(
        [sys.executable, "-m", module, "--version"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    assert shown.split()[-1] == VERSION


def test_every_program_that_is_checked_is_declared() -> None:
    assert set(PROJECT["scripts"]) == {name for names in PROGRAMS.values() for name in names}


@pytest.mark.thorough
@pytest.mark.timeout(600)
@pytest.mark.parametrize("extra", ["edge", "broker"])
def test_a_program_of_the_farm_installs_on_arm_from_wheels(extra: str, tmp_path: Path) -> None:
    platforms = [part for name in ARM for part in ("--platform", name)]
    result = subprocess.run(
        [
            *(sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--require-hashes"),
            *("--only-binary=:all:", "--python-version", "3.11", *platforms),
            *("--dest", str(tmp_path), "--requirement", str(ROOT / LOCKS[extra])),
        ],
        check=False,
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    assert len(list(tmp_path.glob("*.whl"))) >= len(declared(extra))


@pytest.mark.thorough
@pytest.mark.timeout(1200)
def test_the_wheel_flies_the_demo_outside_the_checkout(tmp_path: Path) -> None:
    uv = Path(sys.executable).parent / "uv"
    subprocess.run([uv, "build", "--quiet", "--out-dir", tmp_path, ROOT], check=True)
    subprocess.run(
        [sys.executable, "-m", "deploy.check_distribution", str(tmp_path)], cwd=ROOT, check=True
    )
