"""A recorded flight's sensors in one compressed file, and the conversion back to messages.

Inertial and magnetic samples are kept as the integers that such sensors deliver, at their own
resolution (2000 deg/s, 16 g and 4 gauss over 16 bits): what is replayed is bit for bit what was
recorded, and it is small. Times are microseconds since boot; `arrival_us` is when a message came.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from uav_firmware.msg.sensors import SensorBaro, SensorGps, SensorImu, SensorMag
from uav_firmware.msg.status import LandDetected, LandedState

GYRO_LSB: Final = math.radians(2000.0) / 32768.0  # [rad/s]
ACCEL_LSB: Final = 16.0 * 9.80665 / 32768.0  # [m/s^2]
MAG_LSB: Final = 4.0 / 32768.0  # [gauss]
PRESSURE_LSB: Final = 0.01  # [Pa]

Message = SensorImu | SensorBaro | SensorMag | SensorGps | LandDetected


class Arrival(NamedTuple):
    """A message and when it reached the estimator [us]."""

    time_us: int
    message: Message


def save(path: Path, arrivals: list[Arrival]) -> None:
    """Write a log; the same messages give the same bytes."""
    steps = [(us, m) for us, m in arrivals if isinstance(m, SensorImu)]
    imu = [
        _counts(m.rate_frd, GYRO_LSB) + _counts(m.specific_force_frd, ACCEL_LSB) for _, m in steps
    ]
    mag = [[us, *_counts(m.field_frd, MAG_LSB)] for us, m in arrivals if isinstance(m, SensorMag)]
    baro = [
        [us, round(m.pressure_pa / PRESSURE_LSB)] for us, m in arrivals if isinstance(m, SensorBaro)
    ]
    gps = [[us, *_flat(m)] for us, m in arrivals if isinstance(m, SensorGps)]
    land = [[us, *m[1:]] for us, m in arrivals if isinstance(m, LandDetected)]
    np.savez_compressed(
        path,
        imu_us=np.array([us for us, _ in steps[:2]], np.int64),
        imu=np.array(imu, np.int16),
        baro=np.array(baro, np.int32),
        mag=np.array(mag, np.int32),
        gps=np.array(gps, np.float64),
        land=np.array(land, np.int32),
    )


def load(path: Path) -> list[Arrival]:
    """All messages in the order in which they came; inertial samples first within a step."""
    with np.load(path) as log:
        arrivals = [
            *_imu(log["imu_us"].tolist(), log["imu"]),
            *(Arrival(us, _baro(us, counts)) for us, counts in log["baro"].tolist()),
            *(Arrival(us, _mag(us, *counts)) for us, *counts in log["mag"].tolist()),
            *(Arrival(round(us), _gps(values)) for us, *values in log["gps"].tolist()),
            *(Arrival(us, _land(us, *states)) for us, *states in log["land"].tolist()),
        ]
    return sorted(arrivals, key=lambda arrival: arrival.time_us)


def _imu(times_us: list[int], rows: NDArray[np.int16]) -> Iterator[Arrival]:
    first_us, second_us = times_us
    for index, (p, q, r, x, y, z) in enumerate(rows.tolist()):
        time_us = first_us + index * (second_us - first_us)
        rate = (p * GYRO_LSB, q * GYRO_LSB, r * GYRO_LSB)
        force = (x * ACCEL_LSB, y * ACCEL_LSB, z * ACCEL_LSB)
        yield Arrival(time_us, SensorImu(time_us, rate, force))


def _baro(time_us: int, counts: int) -> SensorBaro:
    return SensorBaro(time_us, counts * PRESSURE_LSB, 20.0)


def _mag(time_us: int, x: int, y: int, z: int) -> SensorMag:
    return SensorMag(time_us, (x * MAG_LSB, y * MAG_LSB, z * MAG_LSB))


def _land(time_us: int, landed: int, contact: int, state: int) -> LandDetected:
    return LandDetected(time_us, bool(landed), bool(contact), LandedState(state), bool(landed))


def _counts(vector: tuple[float, float, float], lsb: float) -> list[int]:
    return [round(component / lsb) for component in vector]


def _flat(gps: SensorGps) -> list[float]:
    return [*gps[:5], *gps.velocity_ned, *gps[6:13]]


def _gps(values: list[float]) -> SensorGps:
    time_us, utc_us, latitude, longitude, altitude, north, east, down, eph, epv, speed = values[:11]
    fix_type, satellites, hdop, vdop = values[11:]
    return SensorGps(
        time_us=round(time_us),
        time_utc_us=round(utc_us),
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=altitude,
        velocity_ned=(north, east, down),
        horizontal_accuracy_m=eph,
        vertical_accuracy_m=epv,
        speed_accuracy_m_s=speed,
        fix_type=round(fix_type),
        satellites_used=round(satellites),
        hdop=hdop,
        vdop=vdop,
    )
