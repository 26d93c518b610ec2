"""What can break on a simulated vehicle, and when: a pure schedule of faults.

A fault has a kind, a beginning, an end (or none) and the numbers that its kind takes. A
schedule says which faults are active at an instant and when that next changes; it neither
touches the vehicle nor reads a clock. What each kind does is in `sim/faults/effects.py`, how
faults are written down in `sim/faults/notation.py`.

Errors:
    FaultError(ValueError): a fault cannot be used; the message names kind, field and reason.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Final, NamedTuple

NEVER_US: Final = 2**63 - 1
"""[us] End of a fault that stays."""

ALL_INSTANCES: Final = -1
"""Number of an `instance` that means every one of its kind."""

MOST_INSTANCES: Final = 3
"""Of an instrument on one vehicle."""

_LATEST_US: Final = 10**15  # Thirty years: a later beginning is a slip of the pen


class FaultError(ValueError):
    """A fault cannot be used; the message names the kind, the field and the reason."""


class Kind(StrEnum):
    """What can break."""

    GPS_LOSS = "gps_loss"
    GPS_FROZEN = "gps_frozen"
    GPS_JUMP = "gps_jump"
    BARO_LOSS = "baro_loss"
    BARO_FROZEN = "baro_frozen"
    BARO_BIAS = "baro_bias"
    MAG_LOSS = "mag_loss"
    MAG_FROZEN = "mag_frozen"
    MAG_DISTURBANCE = "mag_disturbance"
    GYRO_LOSS = "gyro_loss"
    GYRO_FROZEN = "gyro_frozen"
    GYRO_BIAS = "gyro_bias"
    ACCEL_LOSS = "accel_loss"
    ACCEL_FROZEN = "accel_frozen"
    ACCEL_BIAS = "accel_bias"
    RANGEFINDER_LOSS = "rangefinder_loss"
    RANGEFINDER_FROZEN = "rangefinder_frozen"
    RANGEFINDER_BLOCKED = "rangefinder_blocked"
    MOTOR_LOSS = "motor_loss"
    BATTERY_CELL_FAILURE = "battery_cell_failure"
    BATTERY_LOW = "battery_low"
    BATTERY_MONITOR_LOSS = "battery_monitor_loss"
    WIND_GUST = "wind_gust"
    LINK_LOSS = "link_loss"
    CAMERA_FAILURE = "camera_failure"
    HUMIDITY_FAILURE = "humidity_failure"
    HUMIDITY_INVALID = "humidity_invalid"


class Field(NamedTuple):
    """A number that a kind takes."""

    default: float | None  # None: it has to be given
    minimum: float
    maximum: float
    whole: bool = False


_COMPONENT_M: Final = Field(0.0, -100_000.0, 100_000.0)
_COMPONENT_GAUSS: Final = Field(0.0, -10.0, 10.0)
_COMPONENT_DEG_S: Final = Field(0.0, -2000.0, 2000.0)
_COMPONENT_M_S2: Final = Field(0.0, -160.0, 160.0)
_INSTANCE: Final = Field(0, ALL_INSTANCES, MOST_INSTANCES - 1, whole=True)

FIELDS: Final[Mapping[Kind, Mapping[str, Field]]] = MappingProxyType(
    {
        Kind.GPS_LOSS: {},
        Kind.GPS_FROZEN: {},
        Kind.GPS_JUMP: {"north_m": _COMPONENT_M, "east_m": _COMPONENT_M, "up_m": _COMPONENT_M},
        Kind.BARO_LOSS: {"instance": _INSTANCE},
        Kind.BARO_FROZEN: {"instance": _INSTANCE},
        Kind.BARO_BIAS: {"up_m": _COMPONENT_M, "instance": _INSTANCE},
        Kind.MAG_LOSS: {"instance": _INSTANCE},
        Kind.MAG_FROZEN: {"instance": _INSTANCE},
        Kind.MAG_DISTURBANCE: {
            "x_gauss": _COMPONENT_GAUSS,
            "y_gauss": _COMPONENT_GAUSS,
            "z_gauss": _COMPONENT_GAUSS,
            "instance": _INSTANCE,
        },
        Kind.GYRO_LOSS: {"instance": _INSTANCE},
        Kind.GYRO_FROZEN: {"instance": _INSTANCE},
        Kind.GYRO_BIAS: {
            "x_deg_s": _COMPONENT_DEG_S,
            "y_deg_s": _COMPONENT_DEG_S,
            "z_deg_s": _COMPONENT_DEG_S,
            "instance": _INSTANCE,
        },
        Kind.ACCEL_LOSS: {"instance": _INSTANCE},
        Kind.ACCEL_FROZEN: {"instance": _INSTANCE},
        Kind.ACCEL_BIAS: {
            "x_m_s2": _COMPONENT_M_S2,
            "y_m_s2": _COMPONENT_M_S2,
            "z_m_s2": _COMPONENT_M_S2,
            "instance": _INSTANCE,
        },
        Kind.RANGEFINDER_LOSS: {},
        Kind.RANGEFINDER_FROZEN: {},
        Kind.RANGEFINDER_BLOCKED: {"distance_m": Field(0.3, 0.0, 1000.0)},
        Kind.MOTOR_LOSS: {
            "motor": Field(None, 1, 4, whole=True),
            "efficiency": Field(0.0, 0.0, 1.0),
        },
        Kind.BATTERY_CELL_FAILURE: {
            "cells": Field(1, 1, 4, whole=True),
            "charge_lost": Field(0.25, 0.0, 1.0),
        },
        Kind.BATTERY_MONITOR_LOSS: {},
        Kind.BATTERY_LOW: {"charge": Field(None, 0.0, 1.0)},
        Kind.WIND_GUST: {
            "speed_m_s": Field(None, 0.0, 30.0),
            "from_deg": Field(270.0, -360.0, 360.0),
            "up_m_s": Field(0.0, -10.0, 10.0),
        },
        Kind.LINK_LOSS: {},
        Kind.CAMERA_FAILURE: {},
        Kind.HUMIDITY_FAILURE: {},
        Kind.HUMIDITY_INVALID: {},
    }
)
"""The numbers of each kind, with defaults and limits; effects: docs/reference/faults.md."""

LASTING: Final = frozenset({Kind.BATTERY_LOW, Kind.BATTERY_CELL_FAILURE})
"""Kinds that act at their beginning and cannot be taken back."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault. `values` holds every number of its kind, given or by default.

    Raises:
        FaultError: on a time or a number that cannot be used.
    """

    kind: Kind
    start_us: int = 0  # [us] Simulated time from which on it acts
    end_us: int = NEVER_US  # [us] Simulated time from which on it does not
    values: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0 <= self.start_us <= _LATEST_US:
            raise FaultError(f"{self.kind}: start {self.start_us} us is outside 0..{_LATEST_US}")
        if self.end_us <= self.start_us:
            raise FaultError(
                f"{self.kind}: end {self.end_us} us is not after start {self.start_us} us"
            )
        object.__setattr__(self, "values", _complete(self.kind, self.values))


def _complete(kind: Kind, given: Mapping[str, float]) -> Mapping[str, float]:
    """Check the numbers of a fault and add the defaults of those not given."""
    known = FIELDS[kind]
    for name in given:
        if name not in known:
            takes = ", ".join(known) or "no numbers"
            raise FaultError(f"{kind}: there is no {name!r}; it takes {takes}")
    return MappingProxyType(
        {name: _checked(kind, name, limits, given.get(name)) for name, limits in known.items()}
    )


def _checked(kind: Kind, name: str, limits: Field, given: float | None) -> float:
    value = limits.default if given is None else given
    if value is None:
        raise FaultError(f"{kind}: {name} is missing")
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise FaultError(f"{kind}: {name} must be a finite number, not {value!r}")
    if not limits.minimum <= value <= limits.maximum:
        raise FaultError(
            f"{kind}: {name} {value:g} is outside {limits.minimum:g}..{limits.maximum:g}"
        )
    if limits.whole and value != round(value):
        raise FaultError(f"{kind}: {name} {value:g} is no whole number")
    return value


def _is_of(instance: int | None, fault: Fault) -> bool:
    """Whether a fault is of an instance; of any one when none, or all, are named."""
    own = fault.values.get("instance")
    return instance in (None, own) or (instance == ALL_INSTANCES and own is not None)


def _by_instance(faults: Iterable[Fault], cleared: int) -> Iterator[Fault]:
    """The same faults, those of all instances one by one, unless all are to be cleared."""
    for fault in faults:
        if cleared == ALL_INSTANCES or fault.values.get("instance") != ALL_INSTANCES:
            yield fault
            continue
        for instance in range(MOST_INSTANCES):
            yield replace(fault, values={**fault.values, "instance": instance})


class FaultSchedule:
    """Faults in the order in which they were added; a later one of a kind wins."""

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self._faults = tuple(faults)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """All of them, past and future ones too."""
        return self._faults

    def add(self, fault: Fault) -> None:
        """Add one."""
        self._faults = (*self._faults, fault)

    def clear(
        self,
        now_us: int,
        kind: Kind | None = None,
        motor: int | None = None,
        instance: int | None = None,
    ) -> None:
        """End at `now_us` what is active and drop what is to come: of a kind, a part, or all.

        Of a fault of all instances one can be cleared: the others keep it.
        """
        kept = []
        for fault in self._faults if instance is None else _by_instance(self._faults, instance):
            meant = (
                kind in (None, fault.kind)
                and motor in (None, fault.values.get("motor"))
                and _is_of(instance, fault)
            )
            if not meant or fault.end_us <= now_us:
                kept.append(fault)
            elif fault.start_us < now_us:
                kept.append(replace(fault, end_us=now_us))
        self._faults = tuple(kept)

    def active(self, time_us: int) -> tuple[Fault, ...]:
        """Those that act at an instant."""
        return tuple(fault for fault in self._faults if fault.start_us <= time_us < fault.end_us)

    def next_change_us(self, time_us: int) -> int:
        """First instant after `time_us` at which a fault begins or ends; `NEVER_US` if none."""
        times = (time for fault in self._faults for time in (fault.start_us, fault.end_us))
        return min((time for time in times if time > time_us), default=NEVER_US)
