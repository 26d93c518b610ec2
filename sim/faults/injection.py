"""Faults as MAVLink names them: FAILURE_UNIT and FAILURE_TYPE of MAV_CMD_INJECT_FAILURE.

A table. Where MAVLink only says that a unit is wrong, the size of the error is chosen here.
"""

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType
from typing import Final, NamedTuple

from sim.fault_schedule import ALL_INSTANCES, FIELDS, MOST_INSTANCES, Fault, Kind

_MOTORS: Final = (1, 2, 3, 4)


class Unit(IntEnum):
    """MAVLink's FAILURE_UNIT, as far as the simulated vehicle has them."""

    GYRO = 0
    ACCEL = 1
    MAG = 2
    BARO = 3
    GPS = 4
    DISTANCE_SENSOR = 7
    BATTERY = 100
    MOTOR = 101
    MAVLINK_SIGNAL = 105
    CAMERA = 200  # MAVLink has no number for these three
    HYGROMETER = 201
    AIR = 202


class Failure(IntEnum):
    """MAVLink's FAILURE_TYPE, those that the simulated vehicle supports."""

    OK = 0
    OFF = 1
    STUCK = 2
    GARBAGE = 3
    WRONG = 4


class Effect(NamedTuple):
    """What a unit's failure is here."""

    kind: Kind
    values: Mapping[str, float]


_NOTHING: Final[Mapping[str, float]] = MappingProxyType({})

EFFECTS: Final[Mapping[tuple[Unit, Failure], Effect]] = MappingProxyType(
    {
        (Unit.GYRO, Failure.OFF): Effect(Kind.GYRO_LOSS, _NOTHING),
        (Unit.GYRO, Failure.STUCK): Effect(Kind.GYRO_FROZEN, _NOTHING),
        (Unit.GYRO, Failure.WRONG): Effect(Kind.GYRO_BIAS, {"x_deg_s": 3.0, "y_deg_s": 3.0}),
        (Unit.ACCEL, Failure.OFF): Effect(Kind.ACCEL_LOSS, _NOTHING),
        (Unit.ACCEL, Failure.STUCK): Effect(Kind.ACCEL_FROZEN, _NOTHING),
        (Unit.ACCEL, Failure.WRONG): Effect(Kind.ACCEL_BIAS, {"x_m_s2": 1.0, "y_m_s2": 1.0}),
        (Unit.MAG, Failure.OFF): Effect(Kind.MAG_LOSS, _NOTHING),
        (Unit.MAG, Failure.STUCK): Effect(Kind.MAG_FROZEN, _NOTHING),
        (Unit.MAG, Failure.WRONG): Effect(Kind.MAG_DISTURBANCE, {"x_gauss": 0.3, "y_gauss": 0.3}),
        (Unit.BARO, Failure.OFF): Effect(Kind.BARO_LOSS, _NOTHING),
        (Unit.BARO, Failure.STUCK): Effect(Kind.BARO_FROZEN, _NOTHING),
        (Unit.BARO, Failure.WRONG): Effect(Kind.BARO_BIAS, {"up_m": 5.0}),
        (Unit.GPS, Failure.OFF): Effect(Kind.GPS_LOSS, _NOTHING),
        (Unit.GPS, Failure.STUCK): Effect(Kind.GPS_FROZEN, _NOTHING),
        (Unit.GPS, Failure.WRONG): Effect(Kind.GPS_JUMP, {"north_m": 40.0, "east_m": 40.0}),
        (Unit.DISTANCE_SENSOR, Failure.OFF): Effect(Kind.RANGEFINDER_LOSS, _NOTHING),
        (Unit.DISTANCE_SENSOR, Failure.STUCK): Effect(Kind.RANGEFINDER_FROZEN, _NOTHING),
        (Unit.DISTANCE_SENSOR, Failure.WRONG): Effect(Kind.RANGEFINDER_BLOCKED, _NOTHING),
        (Unit.BATTERY, Failure.OFF): Effect(Kind.BATTERY_LOW, {"charge": 0.0}),
        (Unit.BATTERY, Failure.GARBAGE): Effect(Kind.BATTERY_MONITOR_LOSS, _NOTHING),
        (Unit.BATTERY, Failure.WRONG): Effect(Kind.BATTERY_CELL_FAILURE, _NOTHING),
        (Unit.MOTOR, Failure.OFF): Effect(Kind.MOTOR_LOSS, _NOTHING),
        (Unit.MOTOR, Failure.WRONG): Effect(Kind.MOTOR_LOSS, {"efficiency": 0.6}),
        (Unit.CAMERA, Failure.OFF): Effect(Kind.CAMERA_FAILURE, _NOTHING),
        (Unit.HYGROMETER, Failure.OFF): Effect(Kind.HUMIDITY_FAILURE, _NOTHING),
        (Unit.HYGROMETER, Failure.GARBAGE): Effect(Kind.HUMIDITY_INVALID, _NOTHING),
        (Unit.AIR, Failure.WRONG): Effect(Kind.WIND_GUST, {"speed_m_s": 18.0}),
        (Unit.MAVLINK_SIGNAL, Failure.OFF): Effect(Kind.LINK_LOSS, _NOTHING),
    }
)


def kinds_of(unit: int) -> frozenset[Kind]:
    """Every kind of fault that a unit can have; none for a unit that there is not."""
    return frozenset(effect.kind for (known, _), effect in EFFECTS.items() if known == unit)


def faults_of(unit: int, failure: int, instance: int, now_us: int) -> tuple[Fault, ...] | None:
    """Faults that a unit's failure means from now on; None where there is no such unit.

    `instance` counts from 1; 0 means all. The vehicle has one of everything but motors, inertial
    sensors, barometers and compasses.
    """
    effect = next((effect for known, effect in EFFECTS.items() if known == (unit, failure)), None)
    if effect is None:
        return None
    if "instance" in FIELDS[effect.kind]:
        if not 0 <= instance <= MOST_INSTANCES:
            return None
        numbered = {**effect.values, "instance": instance - 1 if instance else ALL_INSTANCES}
        return (Fault(kind=effect.kind, start_us=now_us, values=numbered),)
    if effect.kind is not Kind.MOTOR_LOSS:
        known = instance in (0, 1)
        return (Fault(kind=effect.kind, start_us=now_us, values=effect.values),) if known else None
    motors = tuple(motor for motor in _MOTORS if instance in (0, motor))
    if not motors:
        return None
    return tuple(
        Fault(kind=effect.kind, start_us=now_us, values={**effect.values, "motor": motor})
        for motor in motors
    )
