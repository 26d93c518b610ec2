"""What the active faults do to motors, wind and readings.

`FaultEffects.take` is told when the set of active faults changes; in between it works on
plain attributes, and a healthy vehicle does not call it at all.

A motor of efficiency e gives e times the thrust that its command would give: the command is
lowered accordingly, so that rotor speed, torque and current fall with it, as with a motor that
lost its grip. The thrust curve is that of the README's table, T/T_full = 0.76 u^2 + 0.24 u.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from sim.earth import degrees_per_metre, wrapped_longitude_deg
from sim.faults import Fault, Kind
from sim.sensors.gps import without_fix
from sim.sensors.readings import (
    BaroReading,
    EnvironmentReading,
    GpsReading,
    ImuReading,
    MagReading,
    Readings,
)
from sim.truth import Motors, Vector3

_SQUARE_SHARE: Final = 0.76
_ZERO: Final[Vector3] = (0.0, 0.0, 0.0)
_NOTHING: Final[Vector3] = (math.nan, math.nan, math.nan)
HEALTHY: Final[Motors] = (1.0, 1.0, 1.0, 1.0)
"""Efficiencies of motors without a fault."""


class _Frozen(NamedTuple):
    """Last readings before a fault; they are repeated."""

    gps: GpsReading | None
    baro: BaroReading | None


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
        self._disturbance_gauss: Vector3 = _ZERO
        self._gyro_bias: Vector3 = _ZERO
        self._accel_bias: Vector3 = _ZERO
        self._last = _Frozen(None, None)

    def take(self, active: Sequence[Fault]) -> None:
        """Work with these faults from now on."""
        by_kind = {fault.kind: fault for fault in active}
        self._kinds = frozenset(by_kind)
        self.link_lost = Kind.LINK_LOSS in by_kind
        self.camera_failed = Kind.CAMERA_FAILURE in by_kind
        self.efficiencies = _efficiencies(active)
        self.gust_ned = _gust_ned(by_kind.get(Kind.WIND_GUST))
        self._jump_neu_m = _vector(by_kind.get(Kind.GPS_JUMP))
        self._disturbance_gauss = _vector(by_kind.get(Kind.MAG_DISTURBANCE))
        self._accel_bias = _vector(by_kind.get(Kind.ACCEL_BIAS))
        x, y, z = _vector(by_kind.get(Kind.GYRO_BIAS))
        self._gyro_bias = (math.radians(x), math.radians(y), math.radians(z))
        self.touches_readings = not self._kinds.isdisjoint(_ON_READINGS)
        if Kind.GPS_FROZEN not in by_kind:
            self._last = self._last._replace(gps=None)
        if Kind.BARO_FROZEN not in by_kind:
            self._last = self._last._replace(baro=None)

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
        kinds = self._kinds
        return readings._replace(
            imu=self._imu(readings.imu),
            baro=self._baro(readings.baro),
            mag=None if Kind.MAG_LOSS in kinds else self._mag(readings.mag),
            gps=self._gps(readings.gps),
            environment=self._measured(readings.environment),
            range=None if Kind.RANGEFINDER_LOSS in kinds else readings.range,
        )

    def _imu(self, imu: ImuReading) -> ImuReading:
        kinds = self._kinds
        rate = _sum(imu.rate_frd, self._gyro_bias)
        force = _sum(imu.specific_force_frd, self._accel_bias)
        return ImuReading(
            imu.time_us,
            _NOTHING if Kind.GYRO_LOSS in kinds else rate,
            _NOTHING if Kind.ACCEL_LOSS in kinds else force,
        )

    def _baro(self, baro: BaroReading | None) -> BaroReading | None:
        if baro is None or Kind.BARO_LOSS in self._kinds:
            return None
        if Kind.BARO_FROZEN not in self._kinds:
            return baro
        if self._last.baro is None:
            self._last = self._last._replace(baro=baro)
        frozen = self._last.baro or baro
        return frozen._replace(time_us=baro.time_us)

    def _mag(self, mag: MagReading | None) -> MagReading | None:
        if mag is None:
            return None
        return MagReading(mag.time_us, _sum(mag.field_frd_gauss, self._disturbance_gauss))

    def _measured(self, sample: EnvironmentReading | None) -> EnvironmentReading | None:
        if sample is None:
            return None
        if Kind.HUMIDITY_FAILURE in self._kinds:
            return sample._replace(hygrometer_speaks=False)
        if Kind.HUMIDITY_INVALID in self._kinds:
            return sample._replace(relative_humidity_percent=math.nan)
        return sample

    def _gps(self, gps: GpsReading | None) -> GpsReading | None:
        if gps is None:
            return None
        if Kind.GPS_LOSS in self._kinds:
            return without_fix(gps.time_us)
        if Kind.GPS_FROZEN in self._kinds:
            if self._last.gps is None:
                self._last = self._last._replace(gps=gps)
            frozen = self._last.gps or gps
            return frozen._replace(time_us=gps.time_us, time_utc_us=gps.time_utc_us)
        return _moved(gps, self._jump_neu_m)


_ON_READINGS: Final = frozenset(
    {
        Kind.GPS_LOSS,
        Kind.GPS_FROZEN,
        Kind.GPS_JUMP,
        Kind.BARO_LOSS,
        Kind.BARO_FROZEN,
        Kind.MAG_LOSS,
        Kind.MAG_DISTURBANCE,
        Kind.GYRO_LOSS,
        Kind.GYRO_BIAS,
        Kind.ACCEL_LOSS,
        Kind.ACCEL_BIAS,
        Kind.RANGEFINDER_LOSS,
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


def _sum(a: Vector3, b: Vector3) -> Vector3:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])
