"""Entry points of the installed programs, as `pyproject.toml` declares them."""

import signal
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Final

EXTRAS: Final = {
    "edge_server": "edge",
    "mavlink_broker": "broker",
    "uav_firmware": "vehicle",
    "sim": "sim",
}
"""The extra of the distribution that installs what a program needs."""
OWN: Final = frozenset({*EXTRAS, "afarcloud", "farm_flight_bridge"})


def edge_server() -> int:
    """Run `farm-edge`; returns the exit code."""
    return _run("edge_server")


def mavlink_broker() -> int:
    """Run `farm-broker`; returns the exit code."""
    return _run("mavlink_broker")


def uav_firmware() -> int:
    """Run `farm-vehicle`; returns the exit code."""
    return _run("uav_firmware")


def sim() -> int:
    """Run `farm-sim`; returns the exit code."""
    return _run("sim")


def _run(package: str) -> int:
    """Load and run a program; Ctrl-C while it is loaded ends it without a traceback.

    An installation for another program lacks packages of this one: exit status 2.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        main: Callable[[], int] = import_module(f"{package}.__main__").main
    except ModuleNotFoundError as error:
        missing = error.name or str(error)
        if missing.partition(".")[0] in OWN:
            raise
        sys.stderr.write(
            f"the package {missing} is not installed: this program needs the extra "
            f"{EXTRAS[package]!r} of farm-flight-bridge, or its lock file\n"
        )
        return 2
    return main()
