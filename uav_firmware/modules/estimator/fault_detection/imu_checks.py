"""Checks inertial samples: nothing absurd may reach the integration.

Gyroscope and accelerometer are checked apart. For a rate that is absurd the last good one is used;
longer than a moment nothing replaces a gyroscope, and the attitude is lost. For an absurd force is
used what the rotors of a multirotor give: no force along x and y, where there is only drag, and
along z what the commanded thrust has been found to give. GPS and barometer settle the rest: a
flight without an accelerometer is rough, and long enough to land (P. Martin and E. Salaun, ICRA
2010, describe the model).
"""

from typing import Final

from farm_flight_bridge.native import mypyc_attr
from uav_firmware.lib.geo import STANDARD_GRAVITY_M_S2
from uav_firmware.msg.sensors import SensorImu
from uav_firmware.msg.vectors import Vector3

_LARGEST_RATE_SQUARED: Final = 40.0**2  # [rad/s] 2300 deg/s, just beyond a 2000 deg/s gyroscope
_LARGEST_FORCE_SQUARED: Final = 320.0**2  # [m/s^2] Just beyond a 32 g accelerometer
_LONGEST_STEP_S: Final = 0.1
_BAD_FOR_S: Final = 0.1
_GLITCH_US: Final = 20_000
_MEAN_S: Final = 2.0  # Of thrust and force
_CARRYING_S: Final = 10.0  # Over which the mean thrust of a flight carries the weight
_LEAST_GIVEN: Final = 0.95  # [-] Of hover: what thrust does not carry for long, the ground does
_LEAST_THRUST: Final = 0.1  # [-] Less has not lifted the vehicle


@mypyc_attr(acyclic=True, free_list_len=1)
class Admitted:
    """What is integrated for a sample."""

    __slots__ = ("dt", "rate_frd", "specific_force_frd")

    def __init__(self, rate_frd: Vector3, specific_force_frd: Vector3, dt: float) -> None:
        self.rate_frd: Final = rate_frd  # [rad/s]
        self.specific_force_frd: Final = specific_force_frd  # [m/s^2]
        self.dt: Final = dt  # [s]


class ImuChecks:
    """Replaces absurd samples and watches over the order of time."""

    __slots__ = (
        "_carrying_thrust", "_force", "_force_bad_since_us", "_given_up", "_mean_thrust",
        "_mean_z", "_rate", "_rate_bad_since_us", "_thrust", "_time_us", "rejected",
    )  # fmt: skip

    def __init__(self) -> None:
        self.rejected = 0  # [-] Samples not used
        self._time_us: int | None = None
        self._rate: Vector3 = (0.0, 0.0, 0.0)
        self._force: Vector3 = (0.0, 0.0, 0.0)
        # [m/s^2] and [-]: means over the same time, whose ratio is what thrust gives
        self._mean_z = -STANDARD_GRAVITY_M_S2
        self._mean_thrust = 0.0
        self._thrust = self._carrying_thrust = 0.0
        self._given_up = False
        self._rate_bad_since_us: int | None = None
        self._force_bad_since_us: int | None = None

    def admit(self, imu: SensorImu) -> Admitted | None:
        """Rate, specific force and dt [s] to integrate; None for a sample out of order.

        A gap longer than 0.1 s counts as 0.1 s: what happened in it is not known, and a long
        step with one sample would be worse than none.
        """
        before_us, now_us = self._time_us, imu.time_us
        if before_us is not None and now_us <= before_us:
            self.rejected += 1
            return None
        dt = 0.0 if before_us is None else (now_us - before_us) * 1e-6
        dt = min(dt, _LONGEST_STEP_S)
        rate, force = imu.rate_frd, imu.specific_force_frd
        x, y, z = rate
        rate_is_sane = x * x + y * y + z * z < _LARGEST_RATE_SQUARED  # NaN compares false
        x, y, z = force
        force_is_sane = x * x + y * y + z * z < _LARGEST_FORCE_SQUARED and not self._given_up
        if rate_is_sane and force_is_sane:
            self._rate, self._force = rate, force
            share = dt / _MEAN_S  # Less than 1, since a step is short
            self._mean_z += share * (z - self._mean_z)
            self._mean_thrust += share * (self._thrust - self._mean_thrust)
            if self._thrust > _LEAST_THRUST:
                share = dt / _CARRYING_S if self._carrying_thrust else 1.0
                self._carrying_thrust += share * (self._thrust - self._carrying_thrust)
            self._rate_bad_since_us = self._force_bad_since_us = None
        else:
            self.rejected += 1
            self._substitute(imu, rate_is_sane=rate_is_sane, force_is_sane=force_is_sane)
            if before_us is None:
                return None
        self._time_us = now_us
        return Admitted(self._rate, self._force, dt)

    def _substitute(self, imu: SensorImu, *, rate_is_sane: bool, force_is_sane: bool) -> None:
        now_us = imu.time_us
        if rate_is_sane:
            self._rate_bad_since_us = None
        elif self._rate_bad_since_us is None:
            self._rate_bad_since_us = now_us
        if force_is_sane:
            self._force, self._force_bad_since_us = imu.specific_force_frd, None
            return
        if self._force_bad_since_us is None:
            self._force_bad_since_us = now_us
        if now_us - self._force_bad_since_us < _GLITCH_US:
            return  # A packet that is half absurd is not used in the other half either
        if rate_is_sane:
            self._rate = imu.rate_frd
        given = self._thrust / self._mean_thrust if self._mean_thrust > _LEAST_THRUST else 1.0
        self._force = (0.0, 0.0, max(given, _LEAST_GIVEN) * self._mean_z)

    def give_up_force(self) -> None:
        """Treat the accelerometer as lost: its values are plausible but wrong, for an unknown time.

        What thrust gives is then known by what has carried the weight, not by what was measured.
        """
        self._given_up = True
        self._mean_z = -STANDARD_GRAVITY_M_S2
        self._mean_thrust = self._carrying_thrust

    def use_force(self) -> None:
        """Use the accelerometer again, since another one delivers now."""
        self._given_up = False

    def expect_thrust(self, thrust: float) -> None:
        """Note the collective thrust that is commanded, 0 to 1 and in proportion to the force."""
        self._thrust = thrust

    @property
    def healthy(self) -> bool:
        """False once no gyroscope has delivered for a tenth of a second."""
        return not self._is_late(self._rate_bad_since_us, self._time_us)

    @property
    def force_lost(self) -> bool:
        """Whether the force is the model's, for want of an accelerometer."""
        return self._is_late(self._force_bad_since_us, self._time_us)

    @staticmethod
    def _is_late(since_us: int | None, now_us: int | None) -> bool:
        return (
            since_us is not None and now_us is not None and (now_us - since_us) * 1e-6 >= _BAD_FOR_S
        )
