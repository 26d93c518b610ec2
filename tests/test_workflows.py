"""What runs the tests: the workflows of the hosted repository, and deliberate breaks of laws."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]  # it has no types

from tests.bench.mutations import BREAKS, Break
from tests.unit.deploy.dockerfile import TARGETS as TARGETS_OF_IMAGES

ROOT = Path(__file__).parent.parent
TARGETS = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))


def test_every_workflow_runs_targets_that_there_are() -> None:
    called: set[str] = set()
    for path in (ROOT / ".github/workflows").glob("*.yml"):
        for job in yaml.safe_load(path.read_text())["jobs"].values():
            commands = [step.get("run", "") for step in job["steps"]]
            called |= {name for text in commands for name in re.findall(r"\bmake ([a-z-]+)", text)}
    assert called <= TARGETS
    assert called >= {"check", "test", "dist", "docs"}


def workflow(name: str) -> Any:
    return yaml.safe_load((ROOT / f".github/workflows/{name}.yml").read_text())


def test_every_supported_python_is_tested_and_has_a_compiled_wheel_on_both_processors() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    prefix = "Programming Language :: Python :: 3."
    minors = [c.removeprefix(prefix) for c in project["classifiers"] if c.startswith(prefix)]
    tested = workflow("test")["jobs"]["test"]["strategy"]["matrix"]
    built = workflow("wheels")["jobs"]["compiled"]["strategy"]["matrix"]
    assert tested["python"] == [f"3.{minor}" for minor in minors]
    assert built["python"] == [f"cp3{minor}" for minor in minors]
    assert tested["machine"] == built["machine"] == ["ubuntu-24.04", "ubuntu-24.04-arm"]


def test_every_image_is_built_and_those_of_a_farm_on_both_processors() -> None:
    matrix = workflow("images")["jobs"]["build"]["strategy"]["matrix"]
    also = [entry["target"] for entry in matrix["include"]]
    assert set(matrix["target"]) | set(also) == set(TARGETS_OF_IMAGES)
    assert {"edge-server", "relay", "broker"} <= set(matrix["target"])
    assert matrix["machine"] == ["ubuntu-24.04", "ubuntu-24.04-arm"]


@pytest.mark.parametrize("one", BREAKS, ids=lambda one: one.law)
def test_a_break_of_a_law_finds_its_line_and_its_tests(one: Break) -> None:
    assert (ROOT / one.file).read_text(encoding="utf-8").count(one.line) == 1
    assert all((ROOT / test).exists() for test in one.tests.split())
