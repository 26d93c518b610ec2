"""Control law of three rotors: the direction of the thrust is controlled, the heading is not.

A quadrotor that has lost a rotor cannot balance the reaction torques any more. It spins, and
only the direction of its thrust is controlled: M. W. Mueller and R. D'Andrea, "Stability and
control of a quadrocopter despite the complete loss of one, two, or three propellers", ICRA
2014. Roll and pitch inertia are taken as equal, I, so that complex numbers with roll as the
real and pitch as the imaginary axis describe both at once. With

    y   error of the thrust's direction in the body frame [rad]: the turn still made too far
    w   p + i q, the rates across the thrust [rad/s]
    u   angular acceleration by the rotors [rad/s^2], v the one commanded
    r   yaw rate, h angular momentum of the rotors over I, k = (Iz/I - 1) r + h

the body's equations, for small y, are

    dy/dt = w - i r y        dw/dt = i k w + u        du/dt = (v - u) / T

and v = -(k1 y + k2 w + k3 u) puts the three poles where they are wanted. The tilt's pole is
moved from -i r straight to the left, which in the frame that does not spin is a tilt that
decays without turning; likewise the rates'. The gains follow r from step to step in closed form.

The rotor opposite the lost one can only push; the pair beside it turns the vehicle both ways
about the lost rotor's arm. What the one cannot do in this moment, the spin lets it do half a
turn later. Thrust that carries the weight comes first.
"""

import math
from typing import NamedTuple

from uav_firmware.lib.rotation import rotate_inverse
from uav_firmware.msg.vectors import Motors, Quaternion, Vector3

_OPPOSITE = (1, 0, 3, 2)
_LARGEST_TILT = 0.5  # [rad] Of the error that is acted on at once
_LEAST_WANTED_SINK_M_S = 0.1
_SINK_SHARE = 0.4  # Of the wanted sink speed
_SPIN_SHARE = 0.97  # Of its recent maximum
_SPIN_TIME_S = 10.0  # Time constant of that maximum; the ground may slow the spin gradually
_LEAST_SPIN_RAD_S = 3.0
_FALL_M_S = 1.0  # A tenth of a second of free fall
_TIME_S = 0.02


class VehicleDynamics(NamedTuple):
    """What the law uses of the vehicle."""

    acceleration: float  # [rad/s^2] By the full thrust of one rotor about the axis across its arm
    motor_time_s: float  # [s]
    inertia_ratio: float  # [-] Yaw over roll
    rotor_spin: float  # [rad/s] Angular momentum of a rotor at full speed over the roll inertia


class Poles(NamedTuple):
    """Wanted quickness."""

    tilt: float  # [1/s]
    rate: float  # [1/s]


class RotorArm(NamedTuple):
    """A rotor: the complex direction of the roll and pitch that it causes, and its handedness."""

    lever: complex  # [-] Of length 1
    spin: float  # [-] +1 where its angular momentum points down


class RotorLossController:
    """The law with its one state, the thrusts that the motors have reached."""

    def __init__(self, arms: tuple[RotorArm, RotorArm, RotorArm, RotorArm]) -> None:
        self.arms = arms
        self._reached = [0.0, 0.0, 0.0, 0.0]

    def start(self, thrust: Motors, lost: int) -> None:
        """Begin with the thrusts of this moment; the lost rotor has none."""
        self._reached = list(thrust)
        self._reached[lost] = 0.0

    def update(
        self,
        lost: int,
        tilt: complex,
        rate_frd: Vector3,
        collective: float,
        dynamics: VehicleDynamics,
        poles: Poles,
        dt: float,
    ) -> Motors:
        """Thrusts [0..1 of a rotor's own] for a tilt error [rad] and rates [rad/s]."""
        arms, reached = self.arms, self._reached
        spin = sum(
            arm.spin * math.sqrt(max(thrust, 0.0))
            for arm, thrust in zip(arms, reached, strict=True)
        )
        yaw_rate = rate_frd[2]
        precession = (dynamics.inertia_ratio - 1.0) * yaw_rate + dynamics.rotor_spin * spin
        gains = pole_placement(yaw_rate, precession, dynamics.motor_time_s, poles)
        produced = dynamics.acceleration * sum(
            arm.lever * thrust for arm, thrust in zip(arms, reached, strict=True)
        )
        rate = complex(rate_frd[0], rate_frd[1])
        wanted = -(gains[0] * tilt + gains[1] * rate + gains[2] * produced)
        thrust = share(wanted / dynamics.acceleration, 4.0 * collective, lost, arms)
        smoothing = dt / (dt + dynamics.motor_time_s)
        for motor in range(4):
            reached[motor] += smoothing * (thrust[motor] - reached[motor])
        return thrust


def tilt_error(q_ned_frd: Quaternion, wanted_down_ned: Vector3) -> complex:
    """Turn [rad, roll + i pitch] by which the body has gone beyond the wanted direction.

    `wanted_down_ned` is where the body's down axis should point, of length 1.
    """
    x, y, z = rotate_inverse(q_ned_frd, wanted_down_ned)
    sine = math.hypot(x, y)
    angle = math.atan2(sine, z)
    if sine < 1e-9:
        return 0j if z > 0.0 else complex(math.pi, 0.0)
    # The body's down axis lies off by -(x, y): a roll to the right moves it to the left
    scale = min(angle, _LARGEST_TILT) / sine
    return complex(y * scale, -x * scale)


def limit_tilt(down_ned: Vector3, largest: float) -> Vector3:
    """The same direction, but no further than `largest` [rad] from the vertical."""
    north, east, down = down_ned
    sine = math.hypot(north, east)
    if math.atan2(sine, down) <= largest:
        return down_ned
    scale = math.sin(largest) / sine if sine > 1e-9 else 0.0
    return (north * scale, east * scale, math.cos(largest) if sine > 1e-9 else 1.0)


def pole_placement(
    yaw_rate: float, precession: float, motor_time_s: float, poles: Poles
) -> tuple[complex, complex, complex]:
    """Gains k1, k2, k3 of tilt, rate and produced acceleration."""
    s0, s1 = complex(0.0, -yaw_rate), complex(0.0, precession)
    wanted = (s0 - poles.tilt, s1 - poles.rate, complex(-1.0 / motor_time_s, 0.0))
    a2 = -(wanted[0] + wanted[1] + wanted[2])
    a1 = wanted[0] * wanted[1] + wanted[1] * wanted[2] + wanted[2] * wanted[0]
    a0 = -wanted[0] * wanted[1] * wanted[2]
    # Newton's form of the characteristic polynomial about the open poles s0 and s1
    q1 = a2 + s0
    q0 = a1 + s0 * q1
    return (
        motor_time_s * (a0 + s0 * q0),
        motor_time_s * (q0 + s1 * (q1 + s1)),
        motor_time_s * (a2 + s0 + s1) - 1.0,
    )


def share(
    wanted: complex, total: float, lost: int, arms: tuple[RotorArm, RotorArm, RotorArm, RotorArm]
) -> Motors:
    """Share a turning demand [in thrusts of one rotor] and the total among three rotors."""
    opposite = _OPPOSITE[lost]
    one, two = (motor for motor in range(4) if motor not in (lost, opposite))
    lever = arms[opposite].lever
    push = (wanted * lever.conjugate()).real
    push = min(max(push, 0.0), 0.5 * total, 1.0)
    pair = 0.5 * min(total - push, 2.0)
    lever = arms[one].lever
    half = 0.5 * (wanted * lever.conjugate()).real
    room = min(pair, 1.0 - pair)
    half = min(max(half, -room), room)
    thrust = [0.0, 0.0, 0.0, 0.0]
    thrust[opposite] = push
    thrust[one] = pair + half
    thrust[two] = pair - half
    return (thrust[0], thrust[1], thrust[2], thrust[3])


class TouchdownDetector:
    """Detects the touchdown of a spinning vehicle: it sinks no more, and its spin slows down.

    A vehicle that spins under power on the ground moves until it tips over, so the thrust has to
    end within tenths of a second, long before the land detector reacts. Neither condition is
    enough alone: a gust stops the sinking for a moment, and the spin changes with the thrust, but
    over seconds. The result is not latched: should it be wrong in the air, the vehicle falls, the
    conditions end and the thrust returns.
    """

    def __init__(self) -> None:
        self._spin = 0.0  # [rad/s] Recent maximum
        self._held_s = 0.0

    def update(self, wanted_sink: float, sink: float, yaw_rate: float, dt: float) -> bool:
        """Whether it has touched down, for speeds [m/s, down] and the yaw rate [rad/s]."""
        spin = abs(yaw_rate)
        self._spin = max(spin, self._spin * (1.0 - dt / (dt + _SPIN_TIME_S)))
        if self._held_s >= _TIME_S:
            # Legs that settle jerk; only a fall, or a command to rise, ends the contact
            stays = wanted_sink > _LEAST_WANTED_SINK_M_S and sink < _FALL_M_S
        else:
            braked = self._spin > _LEAST_SPIN_RAD_S and spin < _SPIN_SHARE * self._spin
            stopped = abs(sink) < _SINK_SHARE * wanted_sink
            stays = braked and stopped and wanted_sink > _LEAST_WANTED_SINK_M_S
        self._held_s = self._held_s + dt if stays else 0.0
        return self._held_s >= _TIME_S
