"""Which build of the flight stack a process loads."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from uav_firmware import compiled
from uav_firmware.compiled import LIBRARY, CompiledModules, Manifest


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A checkout with a module of the autopilot and one of the simulated physics."""
    for name in ("uav_firmware/bus.py", "sim/simulation.py", "sim/physics/noise.py"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("A = 1\n", encoding="utf-8")
    return tmp_path


def build_of(root: Path, abi: str | None = None) -> Manifest:
    return Manifest(
        compiled.abi() if abi is None else abi, ["sim.simulation"], compiled.hashes(root)
    )


def run_pure(text: str) -> subprocess.CompletedProcess[str]:
    """Run a program that is asked for pure Python."""
    return subprocess.run(
        [sys.executable, "-c", text],
        env={**os.environ, "FARM_PURE": "1"},
        cwd=compiled.ROOT,
        capture_output=True,
        text=True,
        check=True,
    )


def test_a_build_of_these_sources_is_loaded(root: Path) -> None:
    assert compiled.obstacle(build_of(root), root) is None


@pytest.mark.parametrize("name", ["uav_firmware/bus.py", "sim/physics/noise.py"])
def test_a_build_that_is_older_than_a_source_is_not_loaded(root: Path, name: str) -> None:
    build = build_of(root)
    (root / name).write_text("A = 2\n", encoding="utf-8")
    assert compiled.obstacle(build, root) == f"{name} has changed since"


def test_a_build_is_not_loaded_when_a_source_has_come_or_gone(root: Path) -> None:
    build = build_of(root)
    (root / "uav_firmware/new.py").touch()
    assert compiled.obstacle(build, root) == "uav_firmware/new.py has changed since"
    (root / "uav_firmware/new.py").unlink()
    (root / "uav_firmware/bus.py").unlink()
    assert compiled.obstacle(build, root) == "uav_firmware/bus.py has changed since"


def test_a_build_for_another_interpreter_is_not_loaded(root: Path) -> None:
    assert compiled.obstacle(build_of(root, "cpython-399-riscv"), root) == (
        "it was made for cpython-399-riscv"
    )


def test_a_folder_without_a_whole_manifest_is_no_build(tmp_path: Path) -> None:
    assert compiled.read_manifest(tmp_path) is None
    (tmp_path / compiled.MANIFEST).write_text('{"abi": "cpy', encoding="utf-8")
    assert compiled.read_manifest(tmp_path) is None


def test_only_the_modules_of_the_build_are_found_in_it(tmp_path: Path) -> None:
    finder = CompiledModules(["uav_firmware.bus"], tmp_path)
    spec = finder.find_spec("uav_firmware.bus", None)
    assert spec is not None
    assert spec.origin == str(tmp_path / "uav_firmware.bus.so")
    assert finder.find_spec(LIBRARY, None) is not None
    assert finder.find_spec("uav_firmware.parameters", None) is None


def test_a_process_that_is_asked_for_pure_python_runs_pure_python() -> None:
    text = (
        "import uav_firmware.bus as bus, uav_firmware.compiled as compiled;"
        "print(compiled.is_installed(), bus.__file__)"
    )
    done = run_pure(text)
    assert done.stdout.split() == ["False", str(compiled.ROOT / "uav_firmware/bus.py")]
    assert done.stderr == ""


@pytest.mark.parametrize("program", ["uav_firmware.__main__", "dst.vehicles.flight_stack"])
def test_a_program_chooses_its_build_before_it_loads_the_first_module_of_one(program: str) -> None:
    text = f"import sys, {program}; print(*sys.modules, sep='\\n')"
    done = run_pure(text)
    of_a_build = {
        ".".join(path.relative_to(compiled.ROOT).with_suffix("").parts)
        for path in compiled.sources()
        if path.name not in {"__init__.py", "compiled.py"}
    }
    loaded = done.stdout.split()
    first = next(name for name in loaded if name in of_a_build)
    assert loaded.index("uav_firmware.compiled") < loaded.index(first)
