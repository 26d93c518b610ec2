"""`make fuzz`: a mission under `FRAMES` (1,000,000) hostile frames, on a signed and an open link.

Ends with 0 only if both flights were, bit for bit, the flights in peace. The open link's enemy
sends no valid commands, the signed link's every command there is, without the key.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from tests.support.hostile_flight import Outcome, fly

DEFAULT_FRAMES: Final = 1_000_000
HOLD_S: Final = 20.0
"""Long enough that a million come no faster than a step can look at."""


def under_fire(frames: int, *, is_signed: bool) -> bool:
    """Fly with and without hostile frames, print both; return whether the flights were the same."""
    with tempfile.TemporaryDirectory() as folder:
        calm = fly(Path(folder), 0, is_signed=is_signed, hold_s=HOLD_S)
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        outcome = fly(Path(folder), frames, is_signed=is_signed, calls=calm.calls, hold_s=HOLD_S)
    is_same = outcome.track == calm.track and outcome.items_reached == calm.items_reached
    verdict = "the flight is that in peace, bit for bit" if is_same else "THE FLIGHT IS ANOTHER"
    page = _page("signed" if is_signed else "open", calm, outcome, time.monotonic() - began)
    sys.stdout.write(f"{page}\n  {verdict}\n")
    return is_same


def _page(link: str, calm: Outcome, outcome: Outcome, wall_s: float) -> str:
    kinds = ", ".join(f"{kind} {count}" for kind, count in sorted(outcome.sent.items()))
    cost_us = (outcome.cpu_s - calm.cpu_s) / max(outcome.sent.total(), 1) * 1e6
    growth = f"{outcome.growth_mb:.1f} MB (in peace {calm.growth_mb:.1f} MB)"
    slowest = f"{outcome.slowest_step_s * 1e3:.1f} ms (in peace {calm.slowest_step_s * 1e3:.1f} ms)"
    rows = {
        "hostile datagrams": f"{outcome.sent.total()} in a flight of {len(outcome.track)} s",
        "kinds": kinds,
        "refused": str(outcome.refused),
        "items reached": str(outcome.items_reached),
        "processor time": f"{outcome.cpu_s:.1f} s (in peace {calm.cpu_s:.1f} s)",
        "a datagram": f"{cost_us:.0f} us of processor time, its making included",
        "wall clock": f"{wall_s:.0f} s",
        "slowest step": slowest,
        "memory growth": growth,
        "sent to others": f"{outcome.answered_bytes / 1e6:.1f} MB",
    }
    return "\n".join([f"{link} link", *(f"  {name}: {text}" for name, text in rows.items())])


def main() -> int:
    """Fly both; 0 if nothing has moved that was not commanded, 2 for a wrong FRAMES."""
    argparse.ArgumentParser(
        prog="FRAMES=NUMBER make fuzz", description="Fly a mission under hostile frames."
    ).parse_args()
    text = os.environ.get("FRAMES") or str(DEFAULT_FRAMES)
    if not text.isdecimal() or int(text) < 1:
        sys.stderr.write(f"FRAMES: {text!r} is no number above 0\n")
        return 2
    outcomes = [under_fire(int(text), is_signed=is_signed) for is_signed in (True, False)]
    return 0 if all(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
