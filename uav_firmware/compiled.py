"""Loads the compiled flight stack instead of its source, where `make compile` has made one.

`deploy/compile.py` puts one extension per module into `uav_firmware/_compiled/`, with a manifest
that names the source of each, and the hash of every source that the build has read. The modules of
a build call each other without a look at `sys.modules`, so they are loaded all or none:

* `FARM_PURE=1` runs pure Python.
* A build that is older than a source, or made for another Python, is not loaded, and standard
  error says so.
* A process that has loaded one of the modules from source already continues in pure Python.

Packages are never compiled: their `__init__.py` stays what imports begin with.
"""

import hashlib
import json
import os
import sys
import sysconfig
from collections.abc import Iterable, Mapping, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ExtensionFileLoader, ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parent.parent
"""The folder that holds the packages."""
FOLDER: Final = Path(__file__).resolve().parent / "_compiled"
MANIFEST: Final = "manifest.json"
LIBRARY: Final = "flight_stack__mypyc"
"""The extension that holds the code of all modules; the others only point into it."""
SUFFIX: Final = ".so"

_SIMULATION: Final = (
    *("sim/config.py", "sim/fault_schedule.py", "sim/gnss_receivers.py", "sim/simulation.py"),
    *("sim/faults/*.py", "sim/physics/*.py", "sim/sensors/*.py"),
)
"""What the simulated vehicle runs in every step."""


class Manifest(NamedTuple):
    """What a build has been made of."""

    abi: str  # Of the interpreter
    modules: Sequence[str]  # Dotted names
    sources: Mapping[str, str]  # SHA-256 of each source that has been read, by path from the root


def abi() -> str:
    """Name of the interpreter's binary interface, such as `cpython-311-x86_64-linux-gnu`."""
    return str(sysconfig.get_config_var("SOABI"))


def sources(root: Path = ROOT) -> list[Path]:
    """Every source that a build depends on: the autopilot, and the physics that it flies in."""
    patterns = ("uav_firmware/**/*.py", *_SIMULATION)
    return sorted({path for pattern in patterns for path in root.glob(pattern)})


def hashes(root: Path = ROOT) -> dict[str, str]:
    """SHA-256 of each of the sources, by path from the root."""
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sources(root)
    }


def read_manifest(folder: Path = FOLDER) -> Manifest | None:
    """Read the manifest of a build; None where there is no build."""
    try:
        return Manifest(**json.loads((folder / MANIFEST).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def obstacle(manifest: Manifest, root: Path = ROOT) -> str | None:
    """Why a build must not be loaded; None if it may."""
    if manifest.abi != abi():
        return f"it was made for {manifest.abi}"
    present = hashes(root)
    changed = [
        name
        for name in sorted(present.keys() | manifest.sources.keys())
        if present.get(name) != manifest.sources.get(name)
    ]
    return f"{changed[0]} has changed since" if changed else None


class CompiledModules(MetaPathFinder):
    """Finds the modules of a build before their sources."""

    def __init__(self, modules: Iterable[str], folder: Path = FOLDER) -> None:
        self._paths = {name: str(folder / f"{name}{SUFFIX}") for name in (*modules, LIBRARY)}

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002 - of the package; a build has one folder
        target: ModuleType | None = None,  # noqa: ARG002 - only for a reload
    ) -> ModuleSpec | None:
        """Give the extension of a module, None for one that has not been compiled."""
        file = self._paths.get(fullname)
        if file is None:
            return None
        loader = ExtensionFileLoader(fullname, file)
        return spec_from_file_location(fullname, file, loader=loader)


def install() -> None:
    """Load the modules of the build from now on, if there is one and it may be loaded."""
    if os.environ.get("FARM_PURE", "0") not in {"", "0"} or is_installed():
        return
    manifest = read_manifest()
    if manifest is None or any(name in sys.modules for name in manifest.modules):
        return
    reason = obstacle(manifest)
    if reason is None:
        sys.meta_path.insert(0, CompiledModules(manifest.modules))
    else:
        text = f"the compiled flight stack is not used: {reason}; make compile builds it anew"
        print(text, file=sys.stderr, flush=True)  # noqa: T201 - before any log is open


def is_installed() -> bool:
    """Whether this process flies the compiled modules."""
    return any(isinstance(finder, CompiledModules) for finder in sys.meta_path)
