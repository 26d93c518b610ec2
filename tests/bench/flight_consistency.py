"""Whether the estimator knows how wrong it is: errors and innovations in their own sigmas.

Ten times a second, from take-off on, each error against the truth is held against three times
the standard deviation that the estimator gives it, and each innovation against three times its
expected deviation. What counts is the share of the time within. Position is judged with the
accuracies that are published, since most of a receiver's error wanders over minutes and no
filter knows; velocity and attitude with the covariance alone. Of a group of innovations
(north, east and down of a fix) the worst component counts.
"""

import math

from tests.support.autopilot_tester import AutopilotTester
from tests.support.rotation_vectors import to_rotation_vector
from uav_firmware.lib.rotation import conjugate, multiply
from uav_firmware.modules.estimator.ekf_core import EkfCore
from uav_firmware.modules.estimator.kalman_filter.gate import Aid
from uav_firmware.modules.estimator.kalman_filter.state import ATTITUDE, VELOCITY

QUANTITIES = (
    "horizontal position error",
    "height error",
    "velocity error",
    "attitude error",
    "GPS position innovation",
    "GPS height innovation",
    "GPS velocity innovation",
    "barometer innovation",
    "compass innovation",
)
_EVERY_STEPS = 25
_SIGMAS = 3.0


class Consistency:
    """Watches a flight from its making on."""

    def __init__(self, tester: AutopilotTester) -> None:
        self._tester = tester
        self._estimator = tester.autopilot.estimator.estimator
        self._within = dict.fromkeys(QUANTITIES, 0)
        self._steps = 0
        self._count = 0
        tester.watch(self._note)

    def shares(self) -> dict[str, float]:
        """Share of the time [%] within three sigma, of each quantity."""
        return {name: 100.0 * within / self._count for name, within in self._within.items()}

    def _note(self) -> None:
        self._steps += 1
        core = self._estimator.core
        if self._steps % _EVERY_STEPS or core is None:
            return
        self._count += 1
        gps, baro, compass = self._estimator.gps, self._estimator.baro, self._estimator.compass
        sigmas = (
            *self._position_errors(core),
            self._velocity_error(core),
            self._attitude_error(core),
            *(
                _innovation(aid)
                for aid in (gps.horizontal, gps.vertical, gps.velocity, baro.height)
            ),
            _innovation(compass.heading),
        )
        for name, size in zip(QUANTITIES, sigmas, strict=True):
            self._within[name] += size <= _SIGMAS

    def _position_errors(self, core: EkfCore) -> tuple[float, float]:
        """Horizontal and vertical, in sigmas as published, against the geodetic truth."""
        assert core.origin is not None
        truth = self._tester.truth
        latitude, longitude, altitude = core.origin.to_geodetic(core.state.position_ned)
        north, east = self._tester.north_east_m(latitude, longitude)
        true_north, true_east, _ = self._tester.true_position()
        horizontal_sigma, vertical_sigma = self._estimator.accuracy_m()
        return (
            math.hypot(north - true_north, east - true_east) / horizontal_sigma,
            abs(altitude - truth.altitude_amsl_m) / vertical_sigma,
        )

    def _velocity_error(self, core: EkfCore) -> float:
        """Worst component, in sigmas."""
        pairs = zip(core.state.velocity_ned, self._tester.truth.velocity_ned, strict=True)
        return max(
            abs(estimated - true) / core.ekf.sigma(VELOCITY.start + axis)
            for axis, (estimated, true) in enumerate(pairs)
        )

    def _attitude_error(self, core: EkfCore) -> float:
        """Worst component about north, east and down, in sigmas."""
        error = to_rotation_vector(
            multiply(self._tester.truth.q_ned_frd, conjugate(core.state.q_ned_frd))
        )
        return max(
            abs(angle) / core.ekf.sigma(ATTITUDE.start + axis) for axis, angle in enumerate(error)
        )


def _innovation(aid: Aid) -> float:
    """The last innovation in expected deviations."""
    return aid.ratio * aid.gate
