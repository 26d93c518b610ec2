"""Entry points of the installed programs, as `pyproject.toml` declares them."""

import signal
from collections.abc import Callable
from importlib import import_module


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
    """Load and run a program; Ctrl-C while it is loaded ends it without a traceback."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    main: Callable[[], int] = import_module(f"{package}.__main__").main
    return main()
