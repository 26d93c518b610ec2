"""Events of the log by time: arming, modes, landed states, mission, status texts."""

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

import numpy as np

from sim.report.arrays import Array
from sim.report.flight_log import FlightLog

MODES: Final[Mapping[int, str]] = {
    0: "MANUAL",
    1: "ALTITUDE",
    2: "POSITION",
    3: "MISSION",
    4: "HOLD",
    5: "RETURN",
    10: "ACRO",
    13: "TERMINATION",
    14: "OFFBOARD",
    15: "STABILIZED",
    17: "TAKEOFF",
    18: "LAND",
    19: "FOLLOW",
    20: "PRECISION LAND",
    21: "ORBIT",
}
"""PX4's navigation states as ground stations call them."""

_LANDED_STATES: Final[Mapping[int, str]] = {
    1: "on the ground",
    2: "in the air",
    3: "taking off",
    4: "landing",
}
_ARMED: Final = 2
_WARNING: Final = 4


class Event(NamedTuple):
    """One thing that happened."""

    time_s: float  # since boot
    kind: str  # mode, arming, landed, mission, failsafe, text or warning
    text: str


class Span(NamedTuple):
    """A time in one mode."""

    start_s: float
    end_s: float
    mode: str


def events(log: FlightLog) -> list[Event]:
    """All events in order of time."""
    found = [*_status_events(log), *_landed_events(log), *_mission_events(log)]
    found += [
        Event(entry.time_s, "warning" if entry.severity <= _WARNING else "text", entry.text)
        for entry in log.texts
    ]
    return sorted(found, key=lambda event: event.time_s)


def mode_spans(log: FlightLog) -> list[Span]:
    """Modes of the flight, each from its first to its last moment."""
    time_s, state = log.time_s("vehicle_status"), log.column("vehicle_status", "nav_state")
    starts = [0, *_changes(state)]
    ends = [*(time_s[row] for row in starts[1:]), time_s[-1]]
    return [
        Span(float(time_s[row]), float(end), _mode(state[row]))
        for row, end in zip(starts, ends, strict=True)
    ]


def armed_times(log: FlightLog) -> list[tuple[float, float]]:
    """Times from arming to disarming; a log that ends armed ends the last."""
    time_s = log.time_s("vehicle_status")
    armed = log.column("vehicle_status", "arming_state") == _ARMED
    edges = np.diff(np.concatenate(([0], armed.astype(int), [0])))
    starts, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    return [
        (float(time_s[start]), float(time_s[min(int(end), len(time_s) - 1)]))
        for start, end in zip(starts, ends, strict=True)
    ]


def _status_events(log: FlightLog) -> Iterator[Event]:
    time_s = log.time_s("vehicle_status")
    armed = log.column("vehicle_status", "arming_state") == _ARMED
    mode = log.column("vehicle_status", "nav_state")
    failsafe = log.column("vehicle_status", "failsafe")
    yield Event(float(time_s[0]), "mode", f"mode {_mode(mode[0])}")
    for row in _changes(mode):
        yield Event(float(time_s[row]), "mode", f"mode {_mode(mode[row])}")
    for row in _changes(armed.astype(np.float64)):
        yield Event(float(time_s[row]), "arming", "armed" if armed[row] else "disarmed")
    for row in _changes(failsafe):
        text = "failsafe begins" if failsafe[row] else "failsafe ends"
        yield Event(float(time_s[row]), "failsafe", text)


def _landed_events(log: FlightLog) -> Iterator[Event]:
    if "vehicle_land_detected" not in log.topics:
        return
    time_s = log.time_s("vehicle_land_detected")
    state = log.column("vehicle_land_detected", "landed_state")
    for row in _changes(state):
        text = _LANDED_STATES.get(int(state[row]), f"landed state {state[row]:.0f}")
        yield Event(float(time_s[row]), "landed", text)


def _mission_events(log: FlightLog) -> Iterator[Event]:
    if "mission_result" not in log.topics:
        return
    time_s = log.time_s("mission_result")
    reached = log.column("mission_result", "seq_reached")
    finished = log.column("mission_result", "finished")
    for row in _changes(reached):
        if reached[row] >= 0:
            yield Event(float(time_s[row]), "mission", f"item {reached[row]:.0f} reached")
    for row in _changes(finished):
        if finished[row]:
            yield Event(float(time_s[row]), "mission", "mission complete")


def _changes(values: Array) -> list[int]:
    """Rows whose value differs from the one before."""
    return [int(row) + 1 for row in np.flatnonzero(np.diff(values) != 0.0)]


def _mode(number: float) -> str:
    return MODES.get(int(number), f"mode {number:.0f}")
