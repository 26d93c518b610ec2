"""Polling for a condition of other threads and processes."""

import time
from collections.abc import Callable

PATIENCE_S = 120.0
"""Long enough for a slow machine; nothing is asserted about how much of it is used."""


def wait_until(
    condition: Callable[[], object], patience_s: float = PATIENCE_S, *, period_s: float = 0.01
) -> None:
    """Poll until a condition is true; fail when it is still false after `patience_s`."""
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, f"waited {patience_s:.0f} s"
        time.sleep(period_s)
