"""A made-up flight with its own kinematics: sensors from formulas, none of the estimator's code.

The path is analytic; the attitude follows from the acceleration and the drag, as on a quadrotor;
body rates come from the matrix logarithm of attitudes one step apart; geodetic fixes come from
a spherical small-area formula with the ellipsoid's two radii.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from uav_firmware.bus import Topic
from uav_firmware.modules.estimator.module import EstimatorModule
from uav_firmware.modules.estimator.params import EstimatorParams
from uav_firmware.msg.estimate import (
    EstimatorStatus,
    VehicleAttitude,
    VehicleGlobalPosition,
    VehicleLocalPosition,
)
from uav_firmware.msg.sensors import SensorBaro, SensorGps, SensorImu, SensorMag, SensorsStatus
from uav_firmware.msg.status import LandDetected, LandedState
from uav_firmware.parameters import Registry

Array: TypeAlias = NDArray[np.float64]

STEP_US = 4000
DT = STEP_US * 1e-6
GRAVITY = 9.8
LONGEST_S = 120.0
"""More than any test flies."""
HOME = (40.4434, -3.7382, 650.0)
FIELD_NED = 0.45 * np.array([0.571, 0.0, 0.821])  # [gauss] Dips 55 degrees


@dataclass(frozen=True, kw_only=True)
class Errors:
    """One sigma of what is wrong with the sensors."""

    gyro: float = 0.01
    accel: float = 0.35
    gyro_bias: float = 0.003
    accel_bias: float = 0.04
    gps_position: float = 0.1
    gps_drift: float = 0.1
    gps_velocity: float = 0.05
    gps_delay_us: int = 120_000
    baro_pa: float = 1.2
    mag_gauss: float = 0.003
    declination_deg: float = 0.45


class Truth(NamedTuple):
    """Where the vehicle really is."""

    time_us: int
    position_ned: Array
    velocity_ned: Array
    rotation: Array  # Body to NED


class Readings(NamedTuple):
    """What arrives in one step, and the truth of that moment."""

    truth: Truth
    imu: SensorImu
    baro: SensorBaro | None
    mag: SensorMag | None
    gps: SensorGps | None
    landed: bool


def path(t: float, start: float, heading: float) -> tuple[Array, float]:
    """Position [m] and heading [rad]: at rest until `start`, then a climbing, turning figure."""
    s = max(0.0, t - start)
    ease = s**3 / (s**3 + 30.0)  # three times differentiable start from rest
    position = ease * np.array(
        [
            12.0 * math.sin(0.35 * s),
            9.0 * math.sin(0.5 * s + 0.4),
            -8.0 + 3.0 * math.cos(0.25 * s),
        ]
    )
    return position, heading + ease * 1.2 * math.sin(0.2 * s)


def cross(a: Array, b: Array) -> Array:
    """Cross product of two vectors: numpy's is made for arrays of them, and slow for one."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def attitude(acceleration: Array, yaw: float) -> Array:
    """Body to NED with thrust along the needed specific force."""
    down = -(acceleration - np.array([0.0, 0.0, GRAVITY]))
    down /= np.linalg.norm(down)
    right = cross(down, np.array([math.cos(yaw), math.sin(yaw), 0.0]))
    right /= np.linalg.norm(right)
    return np.column_stack([cross(right, down), right, down])


def logarithm(rotation: Array) -> Array:
    """Rotation vector of a small rotation matrix."""
    vector = np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    sine = 0.5 * float(np.linalg.norm(vector))
    return vector * 0.5 * (1.0 if sine < 1e-9 else math.asin(sine) / sine)


def truth_at(time_us: int, start: float, heading: float, drag_per_s: float = 0.0) -> Truth:
    """Truth by central differences of the path.

    Rotors of drag d feel -d v along body x and y and push along z: their axis lies along the
    specific force plus d v, so that force along x and y comes out as the drag.
    """
    t, h = time_us * 1e-6, 1e-3
    (before, _), (here, yaw), (after, _) = (path(t + k * h, start, heading) for k in (-1, 0, 1))
    acceleration = (after - 2.0 * here + before) / h**2
    velocity = (after - before) / (2.0 * h)
    return Truth(time_us, here, velocity, attitude(acceleration + drag_per_s * velocity, yaw))


def geodetic(ned: Array) -> tuple[float, float, float]:
    """Latitude, longitude [deg], altitude [m]: right to a millimetre within 100 m of home."""
    lat = math.radians(HOME[0])
    w = math.sqrt(1.0 - 0.00669437999014 * math.sin(lat) ** 2)
    meridian = 6378137.0 * (1.0 - 0.00669437999014) / w**3 + HOME[2]
    normal = 6378137.0 / w + HOME[2]
    return (
        HOME[0] + math.degrees(ned[0] / meridian),
        HOME[1] + math.degrees(ned[1] / (normal * math.cos(lat))),
        HOME[2] - float(ned[2]),
    )


def vector(array: Array) -> tuple[float, float, float]:
    return (float(array[0]), float(array[1]), float(array[2]))


def pressure(altitude_m: float) -> float:
    ratio: float = (1.0 - altitude_m / 44330.77) ** 5.25588
    return 101325.0 * ratio


class Flight:
    """Sensors of one flight, step by step; the same seed gives the same readings."""

    def __init__(
        self,
        seed: int = 1,
        *,
        start_s: float = 12.0,
        heading: float = 0.7,
        errors: Errors | None = None,
        drag_per_s: float = 0.0,
    ) -> None:
        self._rng = np.random.default_rng(seed)
        self._errors = Errors() if errors is None else errors
        self._path = (start_s, heading, drag_per_s)
        self._gyro_bias = self._errors.gyro_bias * self._rng.standard_normal(3)
        self._accel_bias = self._errors.accel_bias * self._rng.standard_normal(3)
        self._drift = self._errors.gps_drift * self._rng.standard_normal(3)
        self._underway: list[SensorGps] = []

    def steps(self, duration_s: float) -> Iterator[Readings]:
        """Readings from power-up on."""
        before = truth_at(0, *self._path)
        for count in range(1, round(duration_s / DT) + 1):
            truth = truth_at(count * STEP_US, *self._path)
            yield Readings(
                truth,
                self._imu(before, truth),
                self._baro(truth) if count % 10 == 0 else None,
                self._mag(truth) if count % 10 == 5 else None,
                self._gps(truth, count),
                landed=truth.time_us < self._path[0] * 1e6,
            )
            before = truth

    def _imu(self, before: Truth, after: Truth) -> SensorImu:
        rate = logarithm(before.rotation.T @ after.rotation) / DT
        needed = (after.velocity_ned - before.velocity_ned) / DT - np.array([0.0, 0.0, GRAVITY])
        force = 0.5 * (before.rotation + after.rotation).T @ needed
        e, noise = self._errors, self._rng.standard_normal(6)
        return SensorImu(
            after.time_us,
            vector(rate + self._gyro_bias + e.gyro * noise[:3]),
            vector(force + self._accel_bias + e.accel * noise[3:]),
        )

    def _baro(self, truth: Truth) -> SensorBaro:
        exact = pressure(HOME[2] - float(truth.position_ned[2]))
        noise = self._errors.baro_pa * self._rng.standard_normal()
        return SensorBaro(truth.time_us, exact + noise, 25.0)

    def _mag(self, truth: Truth) -> SensorMag:
        angle = math.radians(self._errors.declination_deg)
        turn = np.array(
            [
                [math.cos(angle), -math.sin(angle), 0],
                [math.sin(angle), math.cos(angle), 0],
                [0, 0, 1],
            ]
        )
        noise = self._errors.mag_gauss * self._rng.standard_normal(3)
        return SensorMag(truth.time_us, vector(truth.rotation.T @ turn @ FIELD_NED + noise))

    def _gps(self, truth: Truth, count: int) -> SensorGps | None:
        e = self._errors
        if count % 25 == 0:
            self._drift += -self._drift * 0.1 / 60.0
            self._drift += e.gps_drift * math.sqrt(0.2 / 60.0) * self._rng.standard_normal(3)
            place = truth.position_ned + self._drift
            place = place + 0.3 * e.gps_position * self._rng.standard_normal(3)
            velocity = truth.velocity_ned + e.gps_velocity * self._rng.standard_normal(3)
            # A receiver that reports 0 does not know its accuracy
            accuracy = max(1e-3, math.hypot(e.gps_drift, 0.3 * e.gps_position))
            speed_accuracy = max(1e-3, 1.73 * e.gps_velocity)
            self._underway.append(
                SensorGps(
                    truth.time_us, 0, *geodetic(place), vector(velocity),
                    1.41 * accuracy, accuracy, speed_accuracy, 3, 14, 0.7, 1.1,
                )
            )  # fmt: skip
        if self._underway and self._underway[0].time_us + e.gps_delay_us <= truth.time_us:
            return self._underway.pop(0)
        return None


class Recording:
    """Readings of one flight, made once and only as far as a test has flown."""

    def __init__(self, flight: Flight) -> None:
        self._readings: list[Readings] = []
        self._source = flight.steps(LONGEST_S)

    def steps(self, duration_s: float) -> Iterator[Readings]:
        """Readings from power-up on, as `Flight.steps` gives them."""
        for index in range(round(duration_s / DT)):
            if index == len(self._readings):
                self._readings.append(next(self._source))
            yield self._readings[index]


@cache
def recorded(seed: int = 1, *, start_s: float = 12.0, drag_per_s: float = 0.0) -> Recording:
    """A flight that many tests fly, each with other faults."""
    return Recording(Flight(seed, start_s=start_s, drag_per_s=drag_per_s))


class Rig:
    """An estimator with its topics, fed step by step."""

    def __init__(self, **parameters: float) -> None:
        self.registry = Registry()
        self.registry.add(EstimatorParams)
        for name, value in parameters.items():
            self.registry.set(name, value)
        self.imu: Topic[SensorImu] = Topic()
        self.baro: Topic[SensorBaro] = Topic()
        self.mag: Topic[SensorMag] = Topic()
        self.gps: Topic[SensorGps] = Topic()
        self.landed: Topic[LandDetected] = Topic()
        self.sensors: Topic[SensorsStatus] = Topic()
        self.attitude: Topic[VehicleAttitude] = Topic()
        self.local: Topic[VehicleLocalPosition] = Topic()
        self.world: Topic[VehicleGlobalPosition] = Topic()
        self.status: Topic[EstimatorStatus] = Topic()
        self.module = EstimatorModule(
            imu=self.imu, baro=self.baro, mag=self.mag, gps=self.gps,
            attitude=self.attitude, local_position=self.local, global_position=self.world,
            estimator_status=self.status, registry=self.registry, landed=self.landed,
            imu_shift=Topic(), sensors_status=self.sensors, torque_thrust=Topic(),
        )  # fmt: skip

    def feed(self, readings: Readings) -> None:
        """One control step."""
        self.imu.publish(readings.imu)
        if readings.baro is not None:
            self.baro.publish(readings.baro)
        if readings.mag is not None:
            self.mag.publish(readings.mag)
        if readings.gps is not None:
            self.gps.publish(readings.gps)
        if self.landed.value is None or self.landed.value.landed != readings.landed:
            state = LandedState.ON_GROUND if readings.landed else LandedState.IN_AIR
            self.landed.publish(
                LandDetected(
                    readings.truth.time_us,
                    readings.landed,
                    readings.landed,
                    state,
                    has_low_throttle=readings.landed,
                )
            )
        self.module.update()

    @property
    def position(self) -> VehicleLocalPosition:
        assert self.local.value is not None
        return self.local.value

    def position_error(self, truth: Truth) -> Array:
        """Estimate minus truth [m, NED about HOME], origin error included."""
        here = self.position
        lat, lon, alt = geodetic(np.zeros(3))
        north_per_deg = 1.0 / (geodetic(np.array([1.0, 0, 0]))[0] - lat)
        east_per_deg = 1.0 / (geodetic(np.array([0, 1.0, 0]))[1] - lon)
        origin = np.array(
            [
                (here.origin_latitude_deg - lat) * north_per_deg,
                (here.origin_longitude_deg - lon) * east_per_deg,
                alt - here.origin_altitude_amsl_m,
            ]
        )
        error: Array = origin + np.array(here.position_ned) - truth.position_ned
        return error

    def velocity_error(self, truth: Truth) -> Array:
        error: Array = np.array(self.position.velocity_ned) - truth.velocity_ned
        return error

    def attitude_error(self, truth: Truth) -> Array:
        """Rotation vector [rad, NED] from truth to estimate."""
        assert self.attitude.value is not None
        w, x, y, z = self.attitude.value.q_ned_frd
        estimate = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        return logarithm(estimate @ truth.rotation.T)


PERFECT = replace(
    Errors(),
    gyro=0.0, accel=0.0, gyro_bias=0.0, accel_bias=0.0, gps_position=0.0, gps_drift=0.0,
    gps_velocity=0.0, baro_pa=0.0, mag_gauss=0.0,
)  # fmt: skip
