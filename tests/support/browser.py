"""The console in a real Chromium: journeys of console/tests/browser, against a running system."""

import json
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest
import requests

from tests.support.system import ROOT, FarmSystem

CONSOLE: Final = ROOT / "console"
CHROMIUMS: Final = ("chromium", "chromium-browser", "google-chrome")
TIMEOUT_S: Final = 420.0
"""Of one journey: a browser without a graphics card is slow on a machine that others use."""
TEST_TIMEOUT_S: Final = 900
"""Of a test that takes journeys: above theirs, so that a failure still says at which step."""


def sign_in_link(farm: FarmSystem, role: str, name: str) -> str:
    """Make an account of a role; gives the address that signs it in once."""
    return link_at(farm.settings.edge_url, farm.headers("admin"), role, name)


def link_at(url: str, headers: dict[str, str], role: str, name: str) -> str:
    """Make an account at an edge server, with an administrator's headers."""
    account = {"name": name, "role": role}
    made = requests.post(f"{url}/users/", json=account, headers=headers, timeout=10)
    assert made.status_code == 201, made.text
    link = requests.post(f"{url}/users/{name}/link", headers=headers, timeout=10)
    assert link.ok, link.text
    return f"{url}{link.json()['path']}"


def browser_programs() -> tuple[str, str] | str:
    """Give the paths of Node and of Chromium, or what is missing to show the built console."""
    chromium = next(filter(None, map(shutil.which, CHROMIUMS)), None)
    search = f"{ROOT / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}"
    node = shutil.which("node", path=search)
    if chromium is None:
        return "there is no Chromium: apt-get install chromium"
    if node is None or not (CONSOLE / "node_modules" / "playwright-core").exists():
        return "the console's packages are not installed: make console-test"
    if not (CONSOLE / "dist" / "index.html").exists():
        return "the console is not built: make console"
    return node, chromium


@contextmanager
def console_journey(folder: Path) -> Iterator[Callable[..., None]]:
    """Give a function that runs a journey; skips where a browser, Node or the build is missing.

    A failed journey keeps its picture and its trace in the folder and prints where.
    """
    programs = browser_programs()
    if isinstance(programs, str):
        pytest.skip(programs)
    node, chromium = programs

    def take(name: str, *, plan: dict[str, Any] | None = None, **variables: str) -> None:
        if plan is not None:
            variables["PLAN"] = str(folder / "plan.json")
            (folder / "plan.json").write_text(json.dumps(plan))
        kept = folder / "kept"
        result = subprocess.run(
            [node, CONSOLE / "tests" / "browser" / f"{name}.mjs"],
            env={**os.environ, "CHROMIUM": chromium, "OUT": str(kept), **variables},
            timeout=TIMEOUT_S,
            check=False,
            capture_output=True,
            text=True,
        )
        output = f"{result.stdout}{result.stderr}\npicture and trace: {kept}"
        assert result.returncode == 0, output

    yield take
