"""Detects a failed motor by its speed: pure, one report of the speed controllers at a time.

A healthy rotor reaches the speed that belongs to its command within some tens of
milliseconds. The monitor follows a lower bound of that speed, which rises more slowly than any
healthy rotor and falls more quickly, so that no manoeuvre brings a healthy rotor below it. A
rotor that turns at less than a share of the bound for a while has failed. Speed by command,
measured on the F450's motors and usual for a motor under a propeller's load:
n / n_full = 1.23 u - 0.23 u^2.

Rotors also stand because the vehicle lies on them: those that slow down just after a blow count as
blocked first, and as failed only if the vehicle has not been found crashed meanwhile.

Several rotors that stand at once, while the vehicle is carried and does not turn, are a fault of
the telemetry: two rotors of four cannot do that. Nothing is concluded from it then until no rotor
is too slow any more; all together they count as weak.

At lower commands, above all while the motors idle before a take-off, a rotor is given longer and
has to reach a smaller share: what stands then has failed. Each moment that a rotor is too slow uses
up its share of the time that is allowed at that command.

A rotor that stands has to break loose before it follows: its bound waits for START_TIME_S. On three
rotors the one opposite to the lost one stands most of the time and starts several times a second.
"""

from typing import Final, NamedTuple

from uav_firmware.msg.vectors import Motors

_RISE_TIME_S: Final = 0.15
_FALL_TIME_S: Final = 0.02
_LINEAR: Final = 1.23
_SQUARE: Final = 0.23
_IDLE_COMMAND: Final = 0.03  # [-] Below it a motor may stand
_IDLE_SHARE: Final = 0.5  # [-] Of the speed expected
_IDLE_TIME_S: Final = 0.3
_USED_UP: Final = 1.0 - 1e-9  # [-] Three thirds of it are all of it
_STANDS_SHARE: Final = 0.04  # [-] Of full speed: a bound below it is that of a rotor at a stand
_BLOCKED_TIME_S: Final = 0.1  # A crash is found sooner, a rotor lost to a branch not much later
_CONTRADICTED_S: Final = 0.3  # Of flight with rotors that are said to stand

START_TIME_S: Final = 0.1
"""[s] From the command to a rotor at rest until its speed is checked."""


class MotorLimits(NamedTuple):
    """When a motor is too slow."""

    full_speed_rpm: float  # [1/min]
    least_command: float  # [-] Judged as an idling motor below
    least_share: float  # [-] Of the speed expected
    time_s: float  # [s] That it must last
    weak_share: float = 0.0  # [-] Of the speed expected, all motors together; 0 never
    weak_time_s: float = 1.0  # [s]


class MotorMonitor:
    """Four rotors; what has failed stays failed until `forgive`."""

    def __init__(self, limits: MotorLimits) -> None:
        self.limits = limits
        self.failed = 0  # [-] Bit 0 is motor 1
        self.blocked = 0  # [-] Bits too; slow since a blow
        self.weak = False  # All together turn slower than commanded
        self._bounds = [0.0, 0.0, 0.0, 0.0]
        self._slow = [0.0, 0.0, 0.0, 0.0]  # [-] Share of the time allowed that is used up
        self._start_s = [START_TIME_S] * 4  # [s] Left to a rotor that begins to turn
        self._weak_s = 0.0
        self._blocked_s = 0.0
        self._contradicted_s = 0.0  # Rotors were reported to stand, and the vehicle flew

    def forgive(self) -> None:
        """Forget which motors have failed."""
        self.failed = 0

    def rest(self) -> None:
        """The motors stand: forget their speeds, and that all were weak."""
        self.weak = False
        self._bounds = [0.0, 0.0, 0.0, 0.0]
        self._slow = [0.0, 0.0, 0.0, 0.0]
        self._start_s = [START_TIME_S] * 4
        self._weak_s = 0.0
        self.blocked, self._blocked_s = 0, 0.0
        self._contradicted_s = 0.0

    def update(
        self,
        command: Motors,
        speed_rpm: Motors,
        dt: float,
        *,
        struck: bool = False,
        is_carried: bool = False,
    ) -> int:
        """Motors that have failed, as bits, after `dt` seconds with these commands.

        `struck`: the vehicle has just received a blow. `is_carried`: it flies, and the inertial
        sensors show the lift of four rotors and no rotation.
        """
        bounds, start_s, slow = self._bounds, self._start_s, 0
        full_speed_rpm, least_command, least_share, time_allowed_s, _, _ = self.limits
        for motor, wanted in enumerate(command):
            bound = bounds[motor]
            steady = full_speed_rpm * wanted * (_LINEAR - _SQUARE * wanted)
            if wanted < _IDLE_COMMAND and bound < _STANDS_SHARE * full_speed_rpm:
                start_s[motor] = START_TIME_S
            else:
                start_s[motor] -= dt
            if steady < bound or start_s[motor] <= 0.0:
                time_s = _RISE_TIME_S if steady > bound else _FALL_TIME_S
                bound += (steady - bound) * dt / (dt + time_s)
                bounds[motor] = bound
            # A report of NaN compares false and has no effect
            driven = wanted >= least_command
            share, patience_s = (
                (least_share, time_allowed_s) if driven else (_IDLE_SHARE, _IDLE_TIME_S)
            )
            if speed_rpm[motor] < share * bound and wanted >= _IDLE_COMMAND:
                self._slow[motor] += dt / patience_s
                if self._slow[motor] >= _USED_UP:
                    slow |= 1 << motor
            else:
                self._slow[motor] = 0.0
        slow &= ~self.failed
        if not self._is_contradicted(slow, dt, is_carried=is_carried):
            self._judge_slow(slow, dt, struck=struck)
        self._judge_all(command, speed_rpm, dt)
        return self.failed

    def _is_contradicted(self, slow: int, dt: float, *, is_carried: bool) -> bool:
        """Whether the vehicle flies, or has flown, as it cannot with these rotors at a stand."""
        if not slow:
            self._contradicted_s = 0.0
            return False
        if is_carried and slow.bit_count() > 1:
            self._contradicted_s += dt
            return True
        return self._contradicted_s >= _CONTRADICTED_S

    def _judge_slow(self, slow: int, dt: float, *, struck: bool) -> None:
        """Which of those that are newly too slow have failed."""
        self.blocked = slow if struck or self.blocked else 0
        self._blocked_s = self._blocked_s + dt if self.blocked else 0.0
        if not self.blocked or self._blocked_s >= _BLOCKED_TIME_S:
            self.failed |= slow
            self.blocked, self._blocked_s = 0, 0.0

    def _judge_all(self, command: Motors, speed_rpm: Motors, dt: float) -> None:
        """Rotors that are all somewhat slow have lost their drive, not their grip."""
        limits = self.limits
        one, two, three, four = speed_rpm
        bound_1, bound_2, bound_3, bound_4 = self._bounds
        usual = bound_1 + bound_2 + bound_3 + bound_4
        slow = one + two + three + four < limits.weak_share * usual
        self._weak_s = self._weak_s + dt if slow and not self.failed else 0.0
        if self._weak_s >= limits.weak_time_s and min(command) >= limits.least_command:
            self.weak = True
