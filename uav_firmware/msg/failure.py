"""What has broken on the vehicle, and what flies it then."""

from typing import NamedTuple

from uav_firmware.msg.vectors import Motors


class FailureDetectorStatus(NamedTuple):
    """Written by failure_detector on change and at 1 Hz; read by commander and control.

    Failed motors and a crash are latched until a restart or until the operator acknowledges them
    (`VehicleStatus.failures_cleared_us`), weak propulsion until the vehicle is disarmed.
    """

    time_us: int  # [us]
    roll_exceeded: bool  # Beyond FD_FAIL_R for FD_FAIL_R_TTRI
    pitch_exceeded: bool  # Beyond FD_FAIL_P for FD_FAIL_P_TTRI
    failed_motors: int  # [-] Bit 0 is motor 1
    propulsion_weak: bool = False  # All rotors together are slower than commanded
    crash: str = ""  # Why the vehicle counts as crashed; empty while it does not
    escs_silent: bool = False  # No telemetry of the speed controllers, or not of each


class RotorLossThrust(NamedTuple):
    """Thrusts that fly on three rotors. Written by rotor_loss_control while it flies."""

    time_us: int  # [us]
    lost: int  # [-] The motor that is to stand, 0 is motor 1
    thrust: Motors  # [-] Of each motor, 0 to 1 of its own full thrust
