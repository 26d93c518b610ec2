"""The compiled flight stack does what its source does, to the last byte."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.compile import BUILD
from tests.golden.recorded_flight import STATE
from uav_firmware.compiled import ROOT


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A copy of this checkout with a compiled flight stack; it shares the objects of GCC."""
    root = tmp_path_factory.mktemp("checkout")
    left_out = shutil.ignore_patterns("_compiled", "__pycache__")
    for package in (path.parent for path in ROOT.glob("*/__init__.py")):
        shutil.copytree(package, root / package.name, ignore=left_out)
    shutil.copy(ROOT / "pyproject.toml", root)
    BUILD.mkdir(parents=True, exist_ok=True)
    (root / "build").symlink_to(BUILD.parent)
    run(root, "deploy.compile")
    yield root
    shutil.rmtree(root)


def run(root: Path, *arguments: str, pure: str = "0") -> None:
    subprocess.run(
        [sys.executable, "-m", *arguments],
        cwd=root,
        env={**os.environ, "FARM_PURE": pure},
        check=True,
    )


def flight(root: Path, folder: Path, *, pure: str) -> dict[str, bytes]:
    """Everything that one flight leaves, by path."""
    folder.mkdir()
    run(root, "tests.golden.recorded_flight", str(folder), pure=pure)
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.thorough
@pytest.mark.timeout(3600)  # GCC takes minutes, twice as many on a busy machine
def test_a_compiled_flight_leaves_the_same_bytes(checkout: Path, tmp_path: Path) -> None:
    pure = flight(checkout, tmp_path / "pure", pure="1")
    compiled = flight(checkout, tmp_path / "compiled", pure="0")
    assert (pure.pop(STATE), compiled.pop(STATE)) == (b"False", b"True")
    assert {"telemetry.bin", "truth.csv", "lines.txt"} <= pure.keys()
    assert [name for name in pure.keys() | compiled.keys() if pure[name] != compiled[name]] == []


@pytest.mark.thorough
@pytest.mark.timeout(3600)  # as above
def test_the_golden_records_are_those_of_the_compiled_stack(checkout: Path) -> None:
    run(checkout, "pytest", "-q", "tests/golden/test_estimator.py", "tests/golden/test_firmware.py")
