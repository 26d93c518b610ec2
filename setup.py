"""What pyproject.toml cannot say: what goes along with the programs as their data.

The example plans go with the simulator; the console goes with the edge server once `make console`
has built it.

`FARM_COMPILED=1` takes along what `make compile` has made: the wheel is then of one platform and
one Python, and its vehicles fly compiled.
"""

import os
from pathlib import Path

from setuptools import Distribution, find_packages, setup

COMPILED = os.environ.get("FARM_COMPILED", "0") == "1"

CONSOLE = Path("console/dist")
CONSOLE_PACKAGE = "edge_server.console_dist"
COMPLETIONS = Path("deploy/completion")
HAS_CONSOLE = (CONSOLE / "index.html").exists()

PROGRAMS = (
    "afarcloud",
    "edge_server",
    "farm_flight_bridge",
    "mavlink_broker",
    "sim",
    "uav_firmware",
)

if COMPILED and not Path("uav_firmware/_compiled/manifest.json").exists():
    raise SystemExit("FARM_COMPILED=1: nothing has been compiled; run make compile first")


class ProgramsDistribution(Distribution):
    """The programs, for every platform or, compiled, for this one."""

    def has_ext_modules(self) -> bool:
        """Whether the wheel is of one platform."""
        return COMPILED


setup(
    data_files=[("share/bash-completion/completions", sorted(map(str, COMPLETIONS.iterdir())))],
    distclass=ProgramsDistribution,
    packages=[
        *find_packages(include=[pattern for name in PROGRAMS for pattern in (name, f"{name}.*")]),
        "sim.examples",
        *([CONSOLE_PACKAGE] if HAS_CONSOLE else []),
    ],
    package_dir={"sim.examples": "examples/plans", CONSOLE_PACKAGE: str(CONSOLE)},
    package_data={
        **{name: ["py.typed"] for name in PROGRAMS},
        "uav_firmware": ["py.typed", *(["_compiled/*"] if COMPILED else [])],
        "edge_server.api.routes": ["*.js"],
        "edge_server.store.migrations": ["script.py.mako"],
        "sim.examples": ["*.json"],
        CONSOLE_PACKAGE: ["*", "assets/*"],
    },
)
