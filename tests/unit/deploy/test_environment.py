"""The environment that the Makefile works in: made again where it is half made, refused plainly."""

import os
import socket
import subprocess
import sys
import venv
from pathlib import Path

import pytest

from deploy import environment
from tests.unit.deploy.dockerfile import ROOT


def dry_run(target: str, folder: Path) -> list[str]:
    """The commands of a target in a machine without an environment, in order."""
    command = ["make", "--dry-run", "--no-print-directory", target, f"VENV={folder}"]
    variables = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    shown = subprocess.run(
        command, cwd=ROOT, env=variables, capture_output=True, text=True, check=True
    )
    return shown.stdout.splitlines()


@pytest.mark.thorough
def test_a_half_made_environment_is_made_again(tmp_path: Path) -> None:
    venv.create(tmp_path, with_pip=False)
    assert not (tmp_path / "bin/pip").exists()
    assert environment.main(["make", str(tmp_path)]) == 0
    assert (tmp_path / "bin/pip").exists()


def test_a_python_without_ensurepip_is_reported_with_the_package_that_brings_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(environment, "find_spec", lambda _name: None)
    folder = tmp_path / "environment"
    assert environment.main(["make", str(folder)]) == 1
    assert not folder.exists()
    assert "apt-get install python3-venv" in capsys.readouterr().err


@pytest.mark.parametrize("listens", [False, True])
def test_an_index_that_refuses_or_is_silent_is_reported(
    *, listens: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        if listens:
            silent.listen()
        address = f"http://127.0.0.1:{silent.getsockname()[1]}/simple"
        monkeypatch.setenv("PIP_INDEX_URL", address)
        monkeypatch.setenv("PIP_EXTRA_INDEX_URL", "")
        monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
        with pytest.raises(environment.EnvironmentMakingError, match="index cannot be reached"):
            environment.check_index(timeout_s=0.5)


@pytest.mark.parametrize("target", ["sim", "install"])
def test_the_index_is_checked_before_anything_is_installed(target: str, tmp_path: Path) -> None:
    commands = dry_run(target, tmp_path)
    made = next(i for i, line in enumerate(commands) if "deploy.environment make" in line)
    checked = next(i for i, line in enumerate(commands) if "deploy.environment index" in line)
    installed = next(i for i, line in enumerate(commands) if "pip install" in line)
    assert made < checked < installed


@pytest.mark.parametrize("target", ["test", "test-thorough"])
def test_what_the_tests_need_is_checked_before_the_environment_is_made(
    target: str, tmp_path: Path
) -> None:
    assert dry_run(target, tmp_path)[0] == ".ci/servers"


def test_the_module_needs_nothing_that_is_installed() -> None:
    isolated = [sys.executable, "-I", "-S", str(ROOT / "deploy/environment.py"), "--help"]
    assert subprocess.run(isolated, capture_output=True, check=False).returncode == 0
