"""Notation of faults: a TOML or JSON file, or one line per command.

A file holds a list of faults under `fault`:

    [[fault]]
    kind = "motor_loss"
    motor = 2
    start_s = 20.0     # simulated time; 0 when missing
    end_s = 25.0       # or duration_s; neither: it lasts to the end

A line says the same in one go, `motor_loss motor=2 duration_s=5`, and begins now unless it
has a `start_s`. `clear` ends every fault, `clear gps_loss` those of a kind,
`clear motor_loss motor=2` those of a motor, `clear gyro_bias instance=1` those of an instance. An
instance may be `all`.
"""

import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from sim.fault_schedule import ALL_INSTANCES, FIELDS, NEVER_US, Fault, FaultError, Kind

_CLEAR: Final = "clear"
_TIMES: Final = ("start_s", "end_s", "duration_s")
_ALL: Final = ("instance", "all")
_LARGEST_FILE: Final = 1_000_000  # [bytes]
_LONGEST_S: Final = 1e9


class Clear(NamedTuple):
    """Command to end faults; None means every one."""

    kind: Kind | None
    motor: int | None
    instance: int | None = None


def read_faults(path: Path) -> tuple[Fault, ...]:
    """Read a file: JSON if its name ends so, else TOML.

    Raises:
        FaultError: naming the file, the number of the fault and what is wrong with it.
        OSError: if the file cannot be read.
    """
    contents = path.read_bytes()
    if len(contents) > _LARGEST_FILE:
        raise FaultError(f"{path}: more than {_LARGEST_FILE} bytes")
    try:
        text = contents.decode()
        document = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise FaultError(f"{path}: {error}") from None
    return faults_of(document, str(path))


def faults_of(document: object, source: str) -> tuple[Fault, ...]:
    """Faults of a decoded file.

    Raises:
        FaultError: naming the source, the number of the fault and what is wrong with it.
    """
    entries = document.get("fault") if isinstance(document, Mapping) else None
    if not isinstance(entries, list) or not isinstance(document, Mapping) or len(document) != 1:
        raise FaultError(f"{source}: a file holds one list named fault, and nothing else")
    faults = []
    for number, entry in enumerate(entries, start=1):
        try:
            faults.append(_fault_of(entry))
        except FaultError as error:
            raise FaultError(f"{source}: fault {number}: {error}") from None
    return tuple(faults)


def read_order(line: str, now_us: int) -> Fault | Clear:
    """Read a command that acts on a vehicle now.

    Raises:
        FaultError: saying what is wrong with it.
    """
    fields = line.split()
    if not fields:
        raise FaultError("an empty line is no command")
    if fields[0] == _CLEAR:
        return _clear_of(fields[1:])
    entry: dict[str, Any] = {"kind": fields[0], **_assignments(fields[1:])}
    entry.setdefault("start_s", now_us * 1e-6)
    return _fault_of(entry)


def _clear_of(fields: list[str]) -> Clear:
    if not fields:
        return Clear(None, None)
    kind = _kind_of(fields[0])
    numbers = _assignments(fields[1:])
    part = "motor" if kind is Kind.MOTOR_LOSS else "instance"
    if set(numbers) - {part} or (numbers and part not in FIELDS[kind]):
        raise FaultError(f"clear {kind}: {' '.join(fields[1:])!r} is not understood")
    if not numbers:
        return Clear(kind, None)
    number = int(Fault(kind=kind, values=numbers).values[part])
    return Clear(kind, number) if part == "motor" else Clear(kind, None, number)


def _assignments(fields: list[str]) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for field in fields:
        name, equals, text = field.partition("=")
        if not equals or name in numbers:
            raise FaultError(f"{field!r} is no name=number, or stands twice")
        if (name, text) == _ALL:
            numbers[name] = ALL_INSTANCES
            continue
        try:
            numbers[name] = float(text)
        except ValueError:
            raise FaultError(f"{name}: {text!r} is no number") from None
    return numbers


def _kind_of(name: object) -> Kind:
    try:
        return Kind(name)  # type: ignore[arg-type]  # whatever it is, it is a kind or refused
    except ValueError:
        known = ", ".join(Kind)
        raise FaultError(f"there is no fault {name!r}; there are {known}") from None


def _fault_of(entry: object) -> Fault:
    if not isinstance(entry, Mapping):
        raise FaultError(f"{entry!r} is no table")
    kind = _kind_of(entry.get("kind"))
    times = {name: _time_s(kind, name, entry[name]) for name in _TIMES if name in entry}
    if "end_s" in times and "duration_s" in times:
        raise FaultError(f"{kind}: end_s and duration_s exclude each other")
    start_us = round(times.get("start_s", 0.0) * 1e6)
    end_us = NEVER_US
    if "end_s" in times:
        end_us = round(times["end_s"] * 1e6)
    elif "duration_s" in times:
        end_us = start_us + round(times["duration_s"] * 1e6)
    values = {name: value for name, value in entry.items() if name not in (*_TIMES, "kind")}
    if ("instance", values.get("instance")) == _ALL:
        values["instance"] = ALL_INSTANCES
    return Fault(kind=kind, start_us=start_us, end_us=end_us, values=values)


def _time_s(kind: Kind, name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise FaultError(f"{kind}: {name} must be a number of seconds, not {value!r}")
    if not math.isfinite(value) or not 0.0 <= value <= _LONGEST_S:
        raise FaultError(f"{kind}: {name} {value} is outside 0..{_LONGEST_S:g}")
    return float(value)
