"""Votes over the instances of each sensor; the rest of the flight stack sees one of each.

PX4's `sensors` module with its `VotedSensorsUpdate` does the same. Inertial units pass in every
step; barometers and compasses when they have come. What has failed is published, sent as a text,
and stays so until a restart.
"""

import math
from operator import attrgetter
from typing import Final

from uav_firmware.bus import Queue, Topic
from uav_firmware.lib.atmosphere import altitude_from_pressure, pressure_from_altitude
from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.lib.rotation import rotate, rotate_inverse
from uav_firmware.modules.sensors.params import SensorsParams
from uav_firmware.modules.sensors.slow_vote import SlowVote
from uav_firmware.modules.sensors.triad_vote import (
    WINDOW,
    DisputeByBias,
    Limits,
    TriadVote,
)
from uav_firmware.msg.estimate import EstimatorStatus, VehicleAttitude, VehicleLocalPosition
from uav_firmware.msg.sensors import (
    ImuShift,
    SensorBaro,
    SensorImu,
    SensorMag,
    SensorsStatus,
)
from uav_firmware.msg.status import Severity, StatusText
from uav_firmware.msg.vectors import Vector3
from uav_firmware.parameters import Registry

_rate_of: Final = attrgetter("rate_frd")
_force_of: Final = attrgetter("specific_force_frd")

_REPEAT_US: Final = 1_000_000
_SCALE: Final = 0.02  # [-] Scale factor and misalignment of an inertial sensor, twice
_STANDING_RATE: Final = math.radians(0.5)  # [rad/s] Of a calibrated gyroscope
_STANDING_FORCE: Final = 0.15  # [m/s^2] Of a calibrated accelerometer
_FIELD_LEARNING: Final = 0.005  # [-] Share of a sample in the field that is expected


class SensorsModule:
    """Shell of the votes; declares `SensorsParams`."""

    def __init__(
        self,
        registry: Registry,
        *,
        imus: Topic[tuple[SensorImu, ...]],
        baros: Topic[tuple[SensorBaro | None, ...]],
        mags: Topic[tuple[SensorMag | None, ...]],
        attitude: Topic[VehicleAttitude],
        local_position: Topic[VehicleLocalPosition],
        estimator_status: Topic[EstimatorStatus],
        imu: Topic[SensorImu],
        baro: Topic[SensorBaro],
        mag: Topic[SensorMag],
        imu_shift: Topic[ImuShift],
        sensors_status: Topic[SensorsStatus],
        status_text: Queue[StatusText],
    ) -> None:
        registry.add(SensorsParams)
        self._registry = registry
        self._seen_version = -1
        self._imus, self._baros, self._mags = imus, baros, mags
        self._attitude = attitude
        self._local_position = local_position
        self._estimator_status = estimator_status
        self._imu, self._baro, self._mag = imu, baro, mag
        self._imu_shift = imu_shift
        self._status = sensors_status
        self._status_text = status_text
        self._counts = (0, 0, 0)
        self._window: list[tuple[SensorImu, ...]] = []
        self._gyros: TriadVote | None = None
        self._accels: TriadVote | None = None
        self._baro_vote: SlowVote | None = None
        self._mag_vote: SlowVote | None = None
        self._gyro_dispute, self._accel_dispute = DisputeByBias(), DisputeByBias()
        self._field_ned: Vector3 | None = None
        self._status_us = -_REPEAT_US
        self._disputed = 0

    def update(self) -> None:
        """Vote over what is new."""
        imus = self._imus.value
        counts = (self._imus.count, self._baros.count, self._mags.count)
        if imus is None or counts == self._counts:
            return
        before, self._counts = self._counts, counts
        if self._seen_version != self._registry.version:
            self._configure()
        if counts[0] != before[0]:
            self._vote_imus(imus)
        if counts[1] != before[1]:
            self._vote_baros(imus[0].time_us)
        if counts[2] != before[2]:
            self._vote_mags(imus[0].time_us)

    def _configure(self) -> None:
        self._seen_version = self._registry.version
        params = self._registry.read(SensorsParams)
        self._rate_limits = Limits(math.radians(params.rate_deg_s), _SCALE, 0.0, _STANDING_RATE)
        self._force_limits = Limits(
            params.acceleration_m_s2, _SCALE, STANDARD_GRAVITY_M_S2, _STANDING_FORCE
        )
        self._height_m, self._field_gauss = params.height_m, params.field_gauss
        if self._gyros is not None and self._accels is not None:
            self._gyros.limits, self._accels.limits = self._rate_limits, self._force_limits
        if self._baro_vote is not None:
            self._baro_vote.limit = self._height_m
        if self._mag_vote is not None:
            self._mag_vote.limit = self._field_gauss

    def _vote_imus(self, imus: tuple[SensorImu, ...]) -> None:
        gyros, accels = self._gyros, self._accels
        if gyros is None or accels is None:
            gyros = self._gyros = TriadVote(len(imus), self._rate_limits)
            accels = self._accels = TriadVote(len(imus), self._force_limits)
        if len(imus) == 1 and gyros.good and accels.good:
            self._imu.publish(imus[0])
        elif len(imus) == 3 and gyros.failed == 0 and accels.failed == 0:
            one, two, three = imus
            self._imu.publish(
                SensorImu(
                    one.time_us,
                    gyros.select_of_three(one.rate_frd, two.rate_frd, three.rate_frd),
                    accels.select_of_three(
                        one.specific_force_frd, two.specific_force_frd, three.specific_force_frd
                    ),
                )
            )
        else:
            self._imu.publish(
                SensorImu(
                    imus[0].time_us,
                    gyros.select(tuple(map(_rate_of, imus))),
                    accels.select(tuple(map(_force_of, imus))),
                )
            )
        if self._imus.count % 2:  # Every other sample says as much of what has failed
            return
        self._window.append(imus)
        if len(self._window) >= WINDOW:
            self._judge_imus(gyros, accels, imus[0].time_us)
            self._window = []

    def _judge_imus(self, gyros: TriadVote, accels: TriadVote, now_us: int) -> None:
        rates = [[imu.rate_frd for imu in imus] for imus in self._window]
        forces = [[imu.specific_force_frd for imu in imus] for imus in self._window]
        for failed in gyros.judge(rates, forces):
            self._report(now_us, "Gyroscope", failed.instance, failed.reason, len(gyros.good))
        for failed in accels.judge(forces, rates):
            self._report(now_us, "Accelerometer", failed.instance, failed.reason, len(accels.good))
        estimate = self._estimator_status.value
        if estimate is not None:
            gyro = self._settle(
                gyros, self._gyro_dispute, estimate.gyro_bias_frd, now_us, "Gyroscope"
            )
            accel = self._settle(
                accels, self._accel_dispute, estimate.accel_bias_frd, now_us, "Accelerometer"
            )
            if gyro is not None or accel is not None:  # In one message: a topic holds the newest
                zero = (0.0, 0.0, 0.0)
                self._imu_shift.publish(ImuShift(now_us, gyro or zero, accel or zero))
        self._publish(now_us)

    def _settle(
        self, vote: TriadVote, dispute: DisputeByBias, bias_frd: Vector3, now_us: int, name: str
    ) -> Vector3 | None:
        """Exclude the one of two disputed units that the estimate contradicts.

        Returns the change of the bias of what is published, None while neither has failed.
        """
        failed = dispute.update(vote.dispute, bias_frd, now_us)
        if failed is None:
            return None
        wrong = vote.good[failed.which]
        vote.give_up(wrong)
        self._report(now_us, name, wrong, "biased", len(vote.good))
        return failed.shift_frd

    def _vote_baros(self, now_us: int) -> None:
        baros = self._baros.value
        if baros is None:
            return
        vote = self._baro_vote
        if vote is None:
            vote = self._baro_vote = SlowVote(len(baros), self._height_m)
        heights = [None if baro is None else _height(baro) for baro in baros]
        estimate, reference = self._local_position.value, None
        if estimate is not None and estimate.altitude_valid:
            reference = (-estimate.position_ned[2],)
        for failed in vote.update(now_us, heights, reference):
            self._report(now_us, "Barometer", failed.instance, failed.reason, len(vote.good))
        baro, height = baros[vote.selected], vote.use(heights)
        if baro is None:
            return
        if vote.selected == 0 or height is None:
            self._baro.publish(baro)
        else:
            self._baro.publish(baro._replace(pressure_pa=pressure_from_altitude(height[0])))

    def _vote_mags(self, now_us: int) -> None:
        mags = self._mags.value
        if mags is None:
            return
        vote = self._mag_vote
        if vote is None:
            vote = self._mag_vote = SlowVote(len(mags), self._field_gauss)
        fields = [None if mag is None else mag.field_frd for mag in mags]
        attitude, reference = self._attitude.value, None
        if attitude is not None and self._field_ned is not None:
            reference = rotate_inverse(attitude.q_ned_frd, self._field_ned)
        for failed in vote.update(now_us, fields, reference):
            self._report(now_us, "Compass", failed.instance, failed.reason, len(vote.good))
        mag, field = mags[vote.selected], vote.use(fields)
        if mag is None or field is None:
            return
        x, y, z = field
        self._mag.publish(mag if vote.selected == 0 else mag._replace(field_frd=(x, y, z)))
        if attitude is not None and not vote.disputed and math.isfinite(x + y + z):
            self._learn_field(rotate(attitude.q_ned_frd, (x, y, z)))

    def _learn_field(self, field_ned: Vector3) -> None:
        """Follow the field of the place, as the compass in use sees it."""
        if self._field_ned is None:
            self._field_ned = field_ned
            return
        north, east, down = self._field_ned
        x, y, z = field_ned
        share = _FIELD_LEARNING
        self._field_ned = (
            north + share * (x - north),
            east + share * (y - east),
            down + share * (z - down),
        )

    def _report(self, now_us: int, name: str, instance: int, reason: str, left: int) -> None:
        rest = f"{left} left" if left else "none left"
        self._publish_text(
            now_us, Severity.CRITICAL, f"{name} {instance + 1} failed ({reason}), {rest}"
        )
        self._status_us = now_us - _REPEAT_US

    def _publish(self, now_us: int) -> None:
        gyros, accels = self._gyros, self._accels
        if gyros is None or accels is None:
            return
        baros, mags = self._baro_vote, self._mag_vote
        disputed = (
            (gyros.dispute is not None)
            | (accels.dispute is not None) << 1
            | (baros is not None and baros.disputed) << 2
            | (mags is not None and mags.disputed) << 3
        )
        if disputed != self._disputed:
            self._report_disputed(now_us, disputed & ~self._disputed)
            self._disputed = disputed
        elif now_us - self._status_us < _REPEAT_US:
            return
        self._status_us = now_us
        self._status.publish(
            SensorsStatus(
                now_us,
                gyros.failed,
                accels.failed,
                0 if baros is None else baros.failed,
                0 if mags is None else mags.failed,
                not gyros.good,
                not accels.good,
                disputed,
                gyros.agree,
                accels.agree,
            )
        )

    def _report_disputed(self, now_us: int, new: int) -> None:
        for bit, name in enumerate(("Gyroscopes", "Accelerometers", "Barometers", "Compasses")):
            if new >> bit & 1:
                self._publish_text(now_us, Severity.WARNING, f"{name} disagree")

    def _publish_text(self, now_us: int, severity: Severity, text: str) -> None:
        self._status_text.publish(StatusText(now_us, severity, text))


def _height(baro: SensorBaro) -> tuple[float]:
    pressure = baro.pressure_pa
    return (altitude_from_pressure(pressure) if pressure > 0.0 else math.nan,)
