"""The module of the votes, by its topics."""

import numpy as np
import pytest

from uav_firmware.bus import Queue, Topic
from uav_firmware.modules.sensors.module import SensorsModule
from uav_firmware.modules.sensors.triad_vote import WINDOW
from uav_firmware.msg.estimate import EstimatorStatus, VehicleAttitude, VehicleLocalPosition
from uav_firmware.msg.sensors import (
    ImuShift,
    SensorBaro,
    SensorImu,
    SensorMag,
    SensorsStatus,
)
from uav_firmware.msg.status import StatusText
from uav_firmware.parameters import Registry

STEP_US = 4000
ESTIMATE = EstimatorStatus(0, 831, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5, (0.0, 0.0, 0.0), aligned=True)


class Pair:
    """Two inertial units, of which the first may be off in both of its sensors."""

    def __init__(self) -> None:
        self.imus: Topic[tuple[SensorImu, ...]] = Topic()
        self.estimate: Topic[EstimatorStatus] = Topic()
        self.shift: Topic[ImuShift] = Topic()
        self.texts: Queue[StatusText] = Queue()
        self._random = np.random.default_rng(1)
        self._time_us = 0
        baros: Topic[tuple[SensorBaro | None, ...]] = Topic()
        mags: Topic[tuple[SensorMag | None, ...]] = Topic()
        attitude: Topic[VehicleAttitude] = Topic()
        position: Topic[VehicleLocalPosition] = Topic()
        imu: Topic[SensorImu] = Topic()
        baro: Topic[SensorBaro] = Topic()
        mag: Topic[SensorMag] = Topic()
        self.status: Topic[SensorsStatus] = Topic()
        self._module = SensorsModule(
            Registry(),
            imus=self.imus,
            baros=baros,
            mags=mags,
            attitude=attitude,
            local_position=position,
            estimator_status=self.estimate,
            imu=imu,
            baro=baro,
            mag=mag,
            imu_shift=self.shift,
            sensors_status=self.status,
            status_text=self.texts,
        )

    def run(self, windows: int, off: float, bias: float) -> None:
        """Fly with the first unit off along x, and this much of it in the estimator's bias."""
        rate, force = (0.3 * off, 0.0, 0.0), (3.0 * off, 0.0, 0.0)
        self.estimate.publish(
            ESTIMATE._replace(
                gyro_bias_frd=(0.3 * bias, 0.0, 0.0), accel_bias_frd=(3.0 * bias, 0.0, 0.0)
            )
        )
        for _ in range(2 * WINDOW * windows):
            self._time_us += STEP_US
            self.imus.publish((self._unit(rate, force), self._unit()))
            self._module.update()

    @property
    def agree(self) -> tuple[bool, bool]:
        """Whether the gyroscopes do, and the accelerometers."""
        assert self.status.value is not None
        return self.status.value.gyros_agree, self.status.value.accels_agree

    def _unit(
        self,
        rate: tuple[float, float, float] = (0.0, 0.0, 0.0),
        force: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> SensorImu:
        x, y, z = (0.01 * self._random.standard_normal(3) + rate).tolist()
        a, b, c = (0.1 * self._random.standard_normal(3) + force + (0.0, 0.0, -9.8)).tolist()
        return SensorImu(self._time_us, (x, y, z), (a, b, c))


def test_gyroscope_and_accelerometer_settled_in_one_window_shift_both_biases() -> None:
    pair = Pair()
    pair.run(25, 0.0, 0.0)
    assert pair.agree == (True, True)
    pair.run(10, 1.0, 0.0)
    assert pair.agree == (False, False)
    assert pair.shift.count == 0
    pair.run(1, 1.0, 0.5)
    assert [text.text for text in pair.texts.drain()] == [
        "Gyroscopes disagree",
        "Accelerometers disagree",
        "Gyroscope 1 failed (biased), 1 left",
        "Accelerometer 1 failed (biased), 1 left",
    ]
    assert pair.shift.count == 1
    assert pair.shift.value is not None
    assert pair.shift.value.gyro_bias_frd[0] == pytest.approx(-0.15)
    assert pair.shift.value.accel_bias_frd[0] == pytest.approx(-1.5)
