"""The workflows of the hosted repository run what the Makefile offers."""

import re
from pathlib import Path

import yaml  # type: ignore[import-untyped]  # it has no types

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
