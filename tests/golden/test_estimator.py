"""A recorded flight through the estimator: what it makes of it once a second, on record.

`make golden` writes the record anew; the difference is then read in the version control. Six
decimals are compared to a few of the last one, so that another processor's rounding passes and a
change of the filter does not.
"""

import csv
import os
from itertools import groupby
from pathlib import Path

import pytest

from tests.golden.record_flight import LOG
from tests.golden.sensor_log import load
from uav_firmware.modules.estimator.module import EstimatorModule
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.msg.sensors import SensorBaro, SensorGps, SensorImu, SensorMag
from uav_firmware.msg.status import LandDetected
from uav_firmware.parameters import Registry
from uav_firmware.topics import Topics

RECORD = Path(__file__).parent / "estimator" / "estimates.csv"
PERIOD_US = 1_000_000
TOLERANCE = 3e-6
COLUMNS = (
    *("time_s", "q_w", "q_x", "q_y", "q_z"),
    *(f"velocity_{axis}_m_s" for axis in ("north", "east", "down")),
    *(f"position_{axis}_m" for axis in ("north", "east", "down")),
    *(f"accel_bias_{axis}_m_s2" for axis in "xyz"),
    *(f"gyro_bias_{axis}_rad_s" for axis in "xyz"),
    *("baro_bias_m", "compass_bias_rad", "horizontal_accuracy_m", "vertical_accuracy_m"),
)


def replay() -> list[list[float]]:
    topics, registry = Topics(), Registry()
    registry.add(EstimatorParams)
    estimator = EstimatorModule(
        imu=topics.sensor_imu,
        baro=topics.sensor_baro,
        mag=topics.sensor_mag,
        gps=topics.sensor_gps,
        attitude=topics.vehicle_attitude,
        local_position=topics.vehicle_local_position,
        global_position=topics.vehicle_global_position,
        estimator_status=topics.estimator_status,
        landed=topics.land_detected,
        imu_shift=topics.imu_shift,
        sensors_status=topics.sensors_status,
        torque_thrust=topics.vehicle_torque_thrust_setpoint,
        registry=registry,
    )
    rows = []
    for time_us, arrivals in groupby(load(LOG), key=lambda arrival: arrival.time_us):
        for arrival in arrivals:
            publish(topics, arrival.message)
        estimator.update()
        if time_us % PERIOD_US == 0 and estimator.estimator.core is not None:
            rows.append(row(estimator))
    return rows


def publish(topics: Topics, message: object) -> None:
    match message:
        case SensorImu():
            topics.sensor_imu.publish(message)
        case SensorBaro():
            topics.sensor_baro.publish(message)
        case SensorMag():
            topics.sensor_mag.publish(message)
        case SensorGps():
            topics.sensor_gps.publish(message)
        case LandDetected():
            topics.land_detected.publish(message)


def row(estimator: EstimatorModule) -> list[float]:
    navigation = estimator.estimator
    assert navigation.core is not None
    state = navigation.core.state
    return [
        navigation.core.time_us * 1e-6,
        *state.q_ned_frd,
        *state.velocity_ned,
        *state.position_ned,
        *state.accel_bias_frd,
        *state.gyro_bias_frd,
        state.baro_bias_m,
        state.heading_bias,
        *navigation.accuracy_m(),
    ]


def test_the_recorded_flight_gives_the_estimates_on_record() -> None:
    rows = replay()
    assert len(rows) >= 58
    if os.environ.get("GOLDEN") == "rewrite":
        with RECORD.open("w", newline="", encoding="ascii") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(COLUMNS)
            writer.writerows([f"{number:.6f}" for number in numbers] for numbers in rows)
    with RECORD.open(newline="", encoding="ascii") as file:
        record = list(csv.DictReader(file))
    assert len(record) == len(rows)
    for numbers, expected in zip(rows, record, strict=True):
        assert tuple(expected) == COLUMNS
        for name, number in zip(COLUMNS, numbers, strict=True):
            where = f"{name} at {expected['time_s']} s"
            on_record = float(expected[name])
            assert number == pytest.approx(on_record, abs=TOLERANCE, nan_ok=True), where
