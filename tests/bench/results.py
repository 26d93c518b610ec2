"""What a measurement is, and how it is printed and kept."""

import json
import os
import platform
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

NO_BAR: Final = "-"


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """One figure with the bar it is held against."""

    name: str
    value: float
    unit: str
    bar: str  # "<= 50" or ">= 40"; "-": it is held against none
    holds: bool
    runs: int
    spread: str  # Smallest and largest of the runs
    machine: str


def machine() -> str:
    """Say on what the figures were measured."""
    return f"{os.cpu_count()} x {platform.machine()}, Python {platform.python_version()}"


def percentile(values: Sequence[float], percent: float) -> float:
    """Give a percentile by linear interpolation; one value is every percentile."""
    if len(values) == 1:
        return values[0]
    return statistics.quantiles(values, n=1000, method="inclusive")[round(percent * 10) - 1]


def at_most(name: str, value: float, unit: str, bar: float, values: Sequence[float]) -> Result:
    """Make a result whose bar is an upper one."""
    return _result(name, value, unit, f"<= {bar:g}", value <= bar, values)


def at_least(name: str, value: float, unit: str, bar: float, values: Sequence[float]) -> Result:
    """Make a result whose bar is a lower one."""
    return _result(name, value, unit, f">= {bar:g}", value >= bar, values)


def without_bar(name: str, value: float, unit: str, values: Sequence[float]) -> Result:
    """Make a result that explains others, and is held against no bar."""
    return _result(name, value, unit, NO_BAR, True, values)


def _result(
    name: str, value: float, unit: str, bar: str, holds: bool, values: Sequence[float]
) -> Result:
    return Result(
        name=name,
        value=round(value, 4),
        unit=unit,
        bar=bar,
        holds=holds,
        runs=len(values),
        spread=f"{min(values):.3g}..{max(values):.3g}",
        machine=machine(),
    )


def write(results: Sequence[Result], folder: Path) -> None:
    """Write results.json and a readable page beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = [asdict(result) for result in results]
    (folder / "results.json").write_text(json.dumps(rows, indent=1) + "\n")
    (folder / "results.md").write_text(page(results))


def page(results: Sequence[Result]) -> str:
    """Give the readable page."""
    lines = [
        f"Measured on {machine()}",
        "",
        "| what | value | bar | holds | runs | spread |",
        "|---|---|---|---|---|---|",
    ]
    return "\n".join([*lines, *map(row, results)]) + "\n"


def row(result: Result) -> str:
    """Give its line of the page."""
    verdict = "yes" if result.holds else "NO"
    return (
        f"| {result.name} | {result.value:g} {result.unit} | {result.bar} "
        f"| {NO_BAR if result.bar == NO_BAR else verdict} | {result.runs} | {result.spread} |"
    )
