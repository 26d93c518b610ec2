"""Inertial measurement unit: a MEMS gyroscope and accelerometer of a small autopilot.

reading = (I + M) truth + turn-on bias + drifting bias + white noise + vibration, limited to the
full scale of +-2000 deg/s and +-16 g, which a hard landing exceeds. M holds the errors of scale
in its diagonal and those of alignment, cross-axis sensitivity, beside it.

Noise densities are those of the TDK InvenSense ICM-42688-P data sheet (DS-000347, tables 1
and 2): 0.0028 deg/s/sqrt(Hz) and 70 ug/sqrt(Hz). Turn-on biases are what a calibration
leaves of the sheet's +-0.5 deg/s and +-20 mg. Scale and alignment of the gyroscope are not
calibrated on the ground: a third of the sheet's +-0.5 % and +-1.25 % is one sigma, 0.17 % and
0.4 %. A calibration in six positions leaves 0.1 % of both with the accelerometer. Bias
instability, which the sheet does not give, is 3 deg/h and 0.03 mg with a correlation time of
300 s, usual for the class. Vibration grows with the square of the rotor speed; on the soft mount
of a quadrotor in hover it is some 0.4 m/s^2 and 0.01 rad/s, white at the sampling rate.
"""

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from sim.physics.noise import GaussMarkov, normal_vector, standard_normals, white_sigma
from sim.physics.truth import Truth, Vector3
from sim.sensors.readings import ImuReading

_STANDARD_GRAVITY_M_S2: Final = 9.80665
_BIAS_RATE_HZ: Final = 10  # Often enough for a bias that takes minutes to change
_VIBRATION_RPM: Final = 5000.0  # Rotor speed, about that of hover, of `vibration_at_hover`


class AxisNoise(NamedTuple):
    """Errors of a triad, in rad/s or m/s^2."""

    density: float  # [unit/sqrt(Hz)] White noise
    turn_on_sigma: float  # Bias constant for a flight
    instability_sigma: float  # Bias that drifts
    correlation_time_s: float  # [s] Of the drift
    vibration_at_hover: float  # White, in proportion to the square of the rotor speed
    full_scale: float  # Largest reading of an axis
    scale_sigma: float  # [-] Error of scale, constant for a vehicle
    cross_axis_sigma: float  # [-] Share of another axis that is read as this one's


GYROSCOPE: Final = AxisNoise(
    density=math.radians(0.0028),
    turn_on_sigma=math.radians(0.1),
    instability_sigma=math.radians(3.0 / 3600.0),
    correlation_time_s=300.0,
    vibration_at_hover=0.01,
    full_scale=math.radians(2000.0),
    scale_sigma=1.7e-3,
    cross_axis_sigma=4e-3,
)
ACCELEROMETER: Final = AxisNoise(
    density=70e-6 * _STANDARD_GRAVITY_M_S2,
    turn_on_sigma=4e-3 * _STANDARD_GRAVITY_M_S2,
    instability_sigma=0.03e-3 * _STANDARD_GRAVITY_M_S2,
    correlation_time_s=300.0,
    vibration_at_hover=0.4,
    full_scale=16.0 * _STANDARD_GRAVITY_M_S2,
    scale_sigma=1e-3,
    cross_axis_sigma=1e-3,
)


class Triad:
    """Errors of three like axes."""

    def __init__(
        self, normals: Iterator[float], noise: AxisNoise, *, rate_hz: int, factor: float
    ) -> None:
        self._triples = zip(normals, normals, normals, strict=True)  # One call for three numbers
        self._turn_on = normal_vector(normals, noise.turn_on_sigma * factor)
        self._drifts = tuple(
            GaussMarkov(
                normals,
                sigma=noise.instability_sigma * factor,
                correlation_time_s=noise.correlation_time_s,
                step_s=1.0 / _BIAS_RATE_HZ,
            )
            for _ in range(3)
        )
        self._variance = (white_sigma(noise.density, rate_hz) * factor) ** 2
        self._vibration = noise.vibration_at_hover * factor
        self._full_scale = noise.full_scale
        self._rows = tuple(_sensitivity(normals, noise, axis, factor) for axis in range(3))
        self.bias: Vector3 = self._turn_on
        self.step_bias()

    def step_bias(self) -> None:
        """Let the biases drift for a tenth of a second."""
        x, y, z = self._turn_on
        drift_x, drift_y, drift_z = self._drifts
        self.bias = (x + drift_x.step(), y + drift_y.step(), z + drift_z.step())
        # One flat row per axis with its bias: taken apart at once, 1500 times a second.
        row_x, row_y, row_z = self._rows
        self._terms = (*row_x, self.bias[0], *row_y, self.bias[1], *row_z, self.bias[2])

    def sigma(self, rotor_load: float) -> float:
        """Of the white noise; `rotor_load` is the rotor speed over hover's, squared."""
        vibration = self._vibration * rotor_load
        return math.sqrt(self._variance + vibration * vibration)

    def read(self, true_value: Vector3, sigma: float) -> Vector3:
        """Measured components with white noise of `sigma`."""
        limit = self._full_scale
        noise_x, noise_y, noise_z = next(self._triples)
        true_x, true_y, true_z = true_value
        xx, xy, xz, bias_x, yx, yy, yz, bias_y, zx, zy, zz, bias_z = self._terms
        x = xx * true_x + xy * true_y + xz * true_z + bias_x + sigma * noise_x
        y = yx * true_x + yy * true_y + yz * true_z + bias_y + sigma * noise_y
        z = zx * true_x + zy * true_y + zz * true_z + bias_z + sigma * noise_z
        if -limit <= x <= limit and -limit <= y <= limit and -limit <= z <= limit:
            return x, y, z
        return (
            min(max(x, -limit), limit),
            min(max(y, -limit), limit),
            min(max(z, -limit), limit),
        )


def _sensitivity(normals: Iterator[float], noise: AxisNoise, axis: int, factor: float) -> Vector3:
    """What an axis reads per unit along each of the three: a row of I + M."""
    row = list(normal_vector(normals, noise.cross_axis_sigma * factor))
    row[axis] = 1.0 + noise.scale_sigma * factor * next(normals)
    return (row[0], row[1], row[2])


class Imu:
    """Sampled in every control step; `factor` scales every error alike."""

    def __init__(self, generator: np.random.Generator, *, rate_hz: int, factor: float) -> None:
        normals = standard_normals(generator)
        self.gyroscope = Triad(normals, GYROSCOPE, rate_hz=rate_hz, factor=factor)
        self.accelerometer = Triad(normals, ACCELEROMETER, rate_hz=rate_hz, factor=factor)
        self._steps_per_bias = max(1, rate_hz // _BIAS_RATE_HZ)
        self._steps_to_bias = self._steps_per_bias

    def read(self, truth: Truth) -> ImuReading:
        """One sample."""
        return self.sample(truth, *self.sigmas(truth))

    def sigmas(self, truth: Truth) -> tuple[float, float]:
        """White noise of gyroscope and accelerometer; the same for all units of a vehicle."""
        load = rotor_load(truth)
        return self.gyroscope.sigma(load), self.accelerometer.sigma(load)

    def sample(self, truth: Truth, rate_sigma: float, force_sigma: float) -> ImuReading:
        """One sample with this white noise."""
        self._steps_to_bias -= 1
        if self._steps_to_bias == 0:
            self._steps_to_bias = self._steps_per_bias
            self.gyroscope.step_bias()
            self.accelerometer.step_bias()
        return ImuReading(
            truth.time_us,
            self.gyroscope.read(truth.inertial_rate_frd, rate_sigma),
            self.accelerometer.read(truth.specific_force_frd, force_sigma),
        )


def rotor_load(truth: Truth) -> float:
    """Mean rotor speed over about that of hover, squared: what vibration grows with."""
    one, two, three, four = truth.rotor_rpm
    mean_rpm = 0.25 * (one + two + three + four)
    return (mean_rpm / _VIBRATION_RPM) ** 2
