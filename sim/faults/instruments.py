"""What faults do to the readings of one inertial sensor, barometer or compass of several.

Instances count from 0. Each object works on plain attributes that `take` sets when the active
faults change; a healthy instance is not asked. A fault whose `instance` is `ALL_INSTANCES` acts on
every one; of several of a kind the latest wins.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final

from sim.fault_schedule import ALL_INSTANCES, Fault, Kind
from sim.physics.truth import Vector3
from sim.sensors.readings import BaroReading, ImuReading, MagReading

_NOTHING: Final[Vector3] = (math.nan, math.nan, math.nan)
_ZERO: Final[Vector3] = (0.0, 0.0, 0.0)
_PA_PER_M: Final = 12.0  # [Pa/m] Of air near the ground; the exact figure is of no matter

IMU_KINDS: Final = frozenset(
    {
        Kind.GYRO_LOSS, Kind.GYRO_FROZEN, Kind.GYRO_BIAS,
        Kind.ACCEL_LOSS, Kind.ACCEL_FROZEN, Kind.ACCEL_BIAS,
    }
)  # fmt: skip
BARO_KINDS: Final = frozenset({Kind.BARO_LOSS, Kind.BARO_FROZEN, Kind.BARO_BIAS})
MAG_KINDS: Final = frozenset({Kind.MAG_LOSS, Kind.MAG_FROZEN, Kind.MAG_DISTURBANCE})


def faults_of_instance(active: Sequence[Fault], instance: int) -> Mapping[Kind, Fault]:
    """The latest fault of each kind that acts on an instance."""
    meant = (instance, ALL_INSTANCES)
    return {fault.kind: fault for fault in active if fault.values.get("instance") in meant}


class FaultyImu:
    """Gyroscope and accelerometer fail apart, as the two dies in one case do."""

    def __init__(self, instance: int) -> None:
        self.touched = False
        self._instance = instance
        self._kinds: frozenset[Kind] = frozenset()
        self._gyro_bias = self._accel_bias = _ZERO
        self._rate: Vector3 | None = None  # Held by a frozen gyroscope
        self._force: Vector3 | None = None

    def take(self, active: Sequence[Fault]) -> None:
        """Work with these faults from now on."""
        faults = faults_of_instance(active, self._instance)
        self._kinds = IMU_KINDS.intersection(faults)
        self.touched = bool(self._kinds)
        self._gyro_bias = _scaled(_xyz(faults.get(Kind.GYRO_BIAS)), math.pi / 180.0)
        self._accel_bias = _xyz(faults.get(Kind.ACCEL_BIAS))
        if Kind.GYRO_FROZEN not in faults:
            self._rate = None
        if Kind.ACCEL_FROZEN not in faults:
            self._force = None

    def read(self, imu: ImuReading) -> ImuReading:
        """What the instance reports instead."""
        kinds = self._kinds
        rate = _sum(imu.rate_frd, self._gyro_bias)
        force = _sum(imu.specific_force_frd, self._accel_bias)
        if Kind.GYRO_FROZEN in kinds:
            rate = self._rate = self._rate or rate
        if Kind.ACCEL_FROZEN in kinds:
            force = self._force = self._force or force
        return ImuReading(
            imu.time_us,
            _NOTHING if Kind.GYRO_LOSS in kinds else rate,
            _NOTHING if Kind.ACCEL_LOSS in kinds else force,
        )


class FaultyBaro:
    """A barometer that is silent, repeats itself or is off."""

    def __init__(self, instance: int) -> None:
        self.touched = False
        self._instance = instance
        self._kinds: frozenset[Kind] = frozenset()
        self._bias_pa = 0.0
        self._held: BaroReading | None = None

    def take(self, active: Sequence[Fault]) -> None:
        """Work with these faults from now on."""
        faults = faults_of_instance(active, self._instance)
        self._kinds = BARO_KINDS.intersection(faults)
        self.touched = bool(self._kinds)
        bias = faults.get(Kind.BARO_BIAS)
        self._bias_pa = 0.0 if bias is None else -_PA_PER_M * bias.values["up_m"]
        if Kind.BARO_FROZEN not in faults:
            self._held = None

    def read(self, baro: BaroReading) -> BaroReading | None:
        """What the instance reports instead, if anything."""
        if Kind.BARO_LOSS in self._kinds:
            return None
        baro = baro._replace(pressure_pa=baro.pressure_pa + self._bias_pa)
        if Kind.BARO_FROZEN not in self._kinds:
            return baro
        self._held = self._held or baro
        return self._held._replace(time_us=baro.time_us)


class FaultyMag:
    """A compass that is silent, repeats itself or has a magnet beside it."""

    def __init__(self, instance: int) -> None:
        self.touched = False
        self._instance = instance
        self._kinds: frozenset[Kind] = frozenset()
        self._disturbance_gauss = _ZERO
        self._held: MagReading | None = None

    def take(self, active: Sequence[Fault]) -> None:
        """Work with these faults from now on."""
        faults = faults_of_instance(active, self._instance)
        self._kinds = MAG_KINDS.intersection(faults)
        self.touched = bool(self._kinds)
        self._disturbance_gauss = _xyz(faults.get(Kind.MAG_DISTURBANCE))
        if Kind.MAG_FROZEN not in faults:
            self._held = None

    def read(self, mag: MagReading) -> MagReading | None:
        """What the instance reports instead, if anything."""
        if Kind.MAG_LOSS in self._kinds:
            return None
        mag = mag._replace(field_frd_gauss=_sum(mag.field_frd_gauss, self._disturbance_gauss))
        if Kind.MAG_FROZEN not in self._kinds:
            return mag
        self._held = self._held or mag
        return self._held._replace(time_us=mag.time_us)


def _xyz(fault: Fault | None) -> Vector3:
    """The vector of a fault, in the unit that its fields have."""
    if fault is None:
        return _ZERO
    x, y, z = (value for name, value in fault.values.items() if name != "instance")
    return (x, y, z)


def _scaled(a: Vector3, factor: float) -> Vector3:
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def _sum(a: Vector3, b: Vector3) -> Vector3:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])
