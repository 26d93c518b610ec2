"""What the active faults do to motors, wind and readings.

`FaultEffects.take` is called when the set of active faults changes; in between it works on
plain attributes, and a healthy vehicle does not call it at all.

A motor of efficiency e gives e times the thrust that its command would give: the command is
lowered accordingly, so that rotor speed, torque and current fall with it, as with a motor that
lost its grip. The thrust curve is T/T_full = 0.76 u^2 + 0.24 u, from the table in
docs/explanation/simulated-vehicle.md.
"""

import math
from collections.abc import Sequence
from typing import Final

from sim.fault_schedule import MOST_INSTANCES, Fault, Kind
from sim.faults.instruments import (
    BARO_KINDS,
    IMU_KINDS,
    MAG_KINDS,
    FaultyBaro,
    FaultyImu,
    FaultyMag,
)
from sim.physics.earth import degrees_per_metre, wrapped_longitude_deg
from sim.physics.truth import Motors, Vector3
from sim.sensors.gps import without_fix
from sim.sensors.readings import (
    BatteryReading,
    EnvironmentReading,
    GpsReading,
    RangeReading,
    Readings,
)

_SQUARE_SHARE: Final = 0.76
_ZERO: Final[Vector3] = (0.0, 0.0, 0.0)
HEALTHY: Final[Motors] = (1.0, 1.0, 1.0, 1.0)
"""Efficiencies of motors without a fault."""


class FaultEffects:
    """The active faults as numbers ready for use."""

    def __init__(self) -> None:
        self.link_lost = False
        self.camera_failed = False
        self.efficiencies: Motors = HEALTHY
        self.gust_ned: Vector3 = _ZERO  # [m/s] On top of the wind
        self.touches_readings = False
        self._kinds: frozenset[Kind] = frozenset()
        self._jump_neu_m: Vector3 = _ZERO
        self._imus = tuple(FaultyImu(instance) for instance in range(MOST_INSTANCES))
        self._baros = tuple(FaultyBaro(instance) for instance in range(MOST_INSTANCES))
        self._mags = tuple(FaultyMag(instance) for instance in range(MOST_INSTANCES))
        self._held_gps: GpsReading | None = None  # Repeated by a frozen receiver
        self._held_range: RangeReading | None = None  # Repeated by a frozen range finder
        self._blocked_m = math.nan  # [m] To what is before a blocked range finder

    def take(self, active: Sequence[Fault]) -> None:
        """Work with these faults from now on."""
        by_kind = {fault.kind: fault for fault in active}
        self._kinds = frozenset(by_kind)
        self.link_lost = Kind.LINK_LOSS in by_kind
        self.camera_failed = Kind.CAMERA_FAILURE in by_kind
        self.efficiencies = _efficiencies(active)
        self.gust_ned = _gust_ned(by_kind.get(Kind.WIND_GUST))
        self._jump_neu_m = _vector(by_kind.get(Kind.GPS_JUMP))
        for imu in self._imus:
            imu.take(active)
        for baro in self._baros:
            baro.take(active)
        for mag in self._mags:
            mag.take(active)
        self.touches_readings = not self._kinds.isdisjoint(_ON_READINGS)
        if Kind.GPS_FROZEN not in by_kind:
            self._held_gps = None
        if Kind.RANGEFINDER_FROZEN not in by_kind:
            self._held_range = None
        blocked = by_kind.get(Kind.RANGEFINDER_BLOCKED)
        self._blocked_m = math.nan if blocked is None else blocked.values["distance_m"]

    def motors(self, motors: Motors) -> Motors:
        """Commands that reach healthy motors as thrust, lowered for the others."""
        one, two, three, four = self.efficiencies
        return (
            weakened(motors[0], one),
            weakened(motors[1], two),
            weakened(motors[2], three),
            weakened(motors[3], four),
        )

    def readings(self, readings: Readings) -> Readings:
        """What the broken instruments say instead."""
        return Readings(
            imus=tuple(
                faulty.read(imu) if faulty.touched else imu
                for faulty, imu in zip(self._imus, readings.imus, strict=False)
            ),
            baros=tuple(
                None if baro is None else faulty.read(baro)
                for faulty, baro in zip(self._baros, readings.baros, strict=False)
            ),
            mags=tuple(
                None if mag is None else faulty.read(mag)
                for faulty, mag in zip(self._mags, readings.mags, strict=False)
            ),
            gps=self._gps(readings.gps),
            battery=self._battery(readings.battery),
            esc=readings.esc,
            range=self._range(readings.range),
            environment=self._measured(readings.environment),
            only_fast=readings.only_fast,
        )

    def _measured(self, sample: EnvironmentReading | None) -> EnvironmentReading | None:
        if sample is None:
            return None
        if Kind.HUMIDITY_FAILURE in self._kinds:
            return sample._replace(hygrometer_speaks=False)
        if Kind.HUMIDITY_INVALID in self._kinds:
            return sample._replace(relative_humidity_percent=math.nan)
        return sample

    def _battery(self, sample: BatteryReading | None) -> BatteryReading | None:
        if sample is None or Kind.BATTERY_MONITOR_LOSS not in self._kinds:
            return sample
        return sample._replace(voltage_v=math.nan, current_a=math.nan)

    def _range(self, sample: RangeReading | None) -> RangeReading | None:
        """What the range finder says: of what is before it, of former ground, or nothing."""
        if sample is None or Kind.RANGEFINDER_LOSS in self._kinds:
            return None
        if Kind.RANGEFINDER_BLOCKED in self._kinds:
            return sample._replace(distance_m=self._blocked_m)
        if Kind.RANGEFINDER_FROZEN in self._kinds:
            self._held_range = self._held_range or sample
            return self._held_range._replace(time_us=sample.time_us)
        return sample

    def _gps(self, gps: GpsReading | None) -> GpsReading | None:
        if gps is None:
            return None
        if Kind.GPS_LOSS in self._kinds:
            return without_fix(gps.time_us)
        if Kind.GPS_FROZEN in self._kinds:
            self._held_gps = self._held_gps or gps
            return self._held_gps._replace(time_us=gps.time_us, time_utc_us=gps.time_utc_us)
        return _moved(gps, self._jump_neu_m)


_ON_READINGS: Final = (
    IMU_KINDS
    | BARO_KINDS
    | MAG_KINDS
    | {
        Kind.GPS_LOSS,
        Kind.GPS_FROZEN,
        Kind.GPS_JUMP,
        Kind.BATTERY_MONITOR_LOSS,
        Kind.RANGEFINDER_LOSS,
        Kind.RANGEFINDER_FROZEN,
        Kind.RANGEFINDER_BLOCKED,
        Kind.HUMIDITY_FAILURE,
        Kind.HUMIDITY_INVALID,
    }
)


def weakened(command: float, efficiency: float) -> float:
    """Command that gives `efficiency` times the thrust of `command`, both 0 to 1."""
    if efficiency >= 1.0:
        return command
    if efficiency <= 0.0:
        return 0.0
    command = min(max(command, 0.0), 1.0)
    linear = 1.0 - _SQUARE_SHARE
    thrust = efficiency * command * (_SQUARE_SHARE * command + linear)
    root = math.sqrt(linear * linear + 4.0 * _SQUARE_SHARE * thrust)
    return (root - linear) / (2.0 * _SQUARE_SHARE)


def _efficiencies(active: Sequence[Fault]) -> Motors:
    shares = list(HEALTHY)
    for fault in active:
        if fault.kind is Kind.MOTOR_LOSS:
            shares[round(fault.values["motor"]) - 1] = fault.values["efficiency"]
    return (shares[0], shares[1], shares[2], shares[3])


def _gust_ned(fault: Fault | None) -> Vector3:
    if fault is None:
        return _ZERO
    speed, direction = fault.values["speed_m_s"], math.radians(fault.values["from_deg"])
    return (-speed * math.cos(direction), -speed * math.sin(direction), -fault.values["up_m_s"])


def _vector(fault: Fault | None) -> Vector3:
    """The three numbers of a fault in the order of its fields."""
    if fault is None:
        return _ZERO
    x, y, z = fault.values.values()
    return (x, y, z)


def _moved(gps: GpsReading, jump_neu_m: Vector3) -> GpsReading:
    if jump_neu_m == _ZERO or gps.fix_type < 2:
        return gps
    north, east, up = jump_neu_m
    metre = degrees_per_metre(gps.latitude_deg, gps.altitude_amsl_m)
    return gps._replace(
        latitude_deg=gps.latitude_deg + north * metre.north,
        longitude_deg=wrapped_longitude_deg(gps.longitude_deg + east * metre.east),
        altitude_amsl_m=gps.altitude_amsl_m + up,
    )
