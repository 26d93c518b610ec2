"""Checks a wheel as its users meet it: `python -m deploy.check_distribution FOLDER` (`make dist`).

In fresh environments, outside the checkout, with nothing but the wheel and what a lock file names:

    edge, broker   the program starts, and neither simulator nor numpy is installed
    vehicle        the program starts
    edge           the console is there if the checkout has built it
    sim            every program starts, and the demo is flown to its end
"""

import argparse
import os
import subprocess
import sys
import tempfile
import venv
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from farm_flight_bridge import VERSION

ROOT: Final = Path(__file__).parent.parent
PROGRAMS: Final = {
    "edge": ("farm-edge",),
    "broker": ("farm-broker",),
    "vehicle": ("farm-vehicle",),
    "sim": ("farm-edge", "farm-broker", "farm-vehicle", "farm-sim"),
}
LOCKS: Final = {
    "edge": "requirements-edge.lock",
    "broker": "requirements-broker.lock",
    "vehicle": "requirements-vehicle.lock",
    "sim": "requirements.lock",
}
SIMULATOR: Final = ("jsbsim", "numpy")
"""Packages that edge server and broker do without."""
SHOW_CONSOLE: Final = "from edge_server.config import Config; print(Config().console_dir)"
DEMO_TIMEOUT_S: Final = 600.0
PORTS: Final = {
    "EDGE_PORT": "18000",
    "CLOUD_PORT": "18100",
    "MAVLINK_PORT": "24540",
    "GCS_PORT": "24550",
    "VEHICLE_PORT_BASE": "24580",
}


class DistributionError(Exception):
    """The wheel does not do what a user expects of it; the message says what."""


def _install(folder: Path, wheel: Path, extra: str) -> Path:
    """Make an environment with the wheel and the locked packages of an extra; gives its bin."""
    venv.create(folder, with_pip=True)
    programs = folder / "bin"
    pip = [str(programs / "python"), "-m", "pip", "--quiet", "--disable-pip-version-check"]
    lock = ["install", "--no-deps", "--require-hashes", "-r", str(ROOT / LOCKS[extra])]
    _run([*pip, *lock], folder)
    _run([*pip, "install", "--no-index", "--no-deps", str(wheel)], folder)
    _run([*pip, "check"], folder)
    return programs


def _run(command: Sequence[str], folder: Path, **more: str) -> str:
    """Run a command in a folder; gives its output.

    Raises:
        DistributionError: if its status is not 0.
    """
    environment = {"PATH": os.environ["PATH"], "HOME": str(folder), **more}
    result = subprocess.run(  # noqa: S603  # programs of the wheel under test
        command,
        cwd=folder,
        env=environment,
        timeout=DEMO_TIMEOUT_S,
        check=False,
        capture_output=True,
        text=True,
    )
    if result.returncode:
        output = "\n".join((result.stdout + result.stderr).splitlines()[-20:])
        raise DistributionError(f"{' '.join(command)} ended with {result.returncode}:\n{output}")
    return result.stdout


def check(wheel: Path, extra: str) -> None:
    """Install an extra and try its programs.

    Raises:
        DistributionError: naming what does not work.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        programs = _install(folder / "environment", wheel, extra)
        for program in PROGRAMS[extra]:
            shown = _run([str(programs / program), "--version"], folder).strip()
            if not shown.endswith(f" {VERSION}"):
                raise DistributionError(f"{program} --version prints {shown!r}, not {VERSION}")
            shown = _run([str(programs / program), "--help"], folder)
            if not shown.startswith(f"usage: {program} "):
                raise DistributionError(f"{program} --help begins with {shown[:40]!r}")
            completion = programs.parent / "share/bash-completion/completions" / program
            if not completion.is_file():
                raise DistributionError(f"there is no completion {completion}")
        if extra == "sim":
            _run([str(programs / "farm-sim"), "demo"], folder, SPEED="5", **PORTS)
            return
        if extra == "edge" and (ROOT / "console" / "dist" / "index.html").exists():
            console = _run([str(programs / "python"), "-c", SHOW_CONSOLE], folder).strip()
            if not (Path(console) / "index.html").is_file():
                raise DistributionError(f"the wheel has no console in {console}")
        if extra == "vehicle":
            return
        listed = _run([str(programs / "python"), "-m", "pip", "list", "--format=freeze"], folder)
        found = [package for package in SIMULATOR if f"\n{package}==" in f"\n{listed}"]
        if found:
            raise DistributionError(f"the extra {extra} installs {', '.join(found)}")


def main() -> int:
    """Check every extra of the wheel in a folder; 1 if one fails."""
    parser = argparse.ArgumentParser(
        prog="deploy.check_distribution", description="Check a wheel as its users install it."
    )
    parser.add_argument("folder", type=Path, help="folder with one wheel")
    wheels = sorted(parser.parse_args().folder.glob("*.whl"))
    if len(wheels) != 1:
        parser.error(f"expected one wheel, found {len(wheels)}")
    for extra in PROGRAMS:
        try:
            check(wheels[0].resolve(), extra)
        except (DistributionError, subprocess.TimeoutExpired) as error:
            print(f"{extra}: {error}", file=sys.stderr)
            return 1
        print(f"{extra}: {', '.join(PROGRAMS[extra])} of {wheels[0].name} work")
    return 0


if __name__ == "__main__":
    sys.exit(main())
