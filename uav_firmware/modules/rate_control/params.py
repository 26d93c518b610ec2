"""Gains of the rate loop, named as PX4 names them."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class RateControlParams:
    """Gains and limits of the rate controller."""

    roll_multiplier: float = param(
        "MC_ROLLRATE_K", 1.0, unit="1", minimum=0.5, maximum=3.0,
        short="Multiplier of MC_ROLLRATE_P, _I and _D",
    )  # fmt: skip
    roll_p: float = param(
        "MC_ROLLRATE_P", 0.08, unit="1/(rad/s)", minimum=0.04, maximum=0.5,
        short="Roll torque per rad/s of roll rate error",
    )  # fmt: skip
    roll_i: float = param(
        "MC_ROLLRATE_I", 0.15, unit="1/rad", minimum=0.0, maximum=2.0,
        short="Roll torque per rad of integrated roll rate error",
    )  # fmt: skip
    roll_d: float = param(
        "MC_ROLLRATE_D", 0.003, unit="1/(rad/s^2)", minimum=0.0, maximum=0.01,
        short="Roll torque per rad/s^2 of roll acceleration, opposing it",
    )  # fmt: skip
    roll_integral_limit: float = param(
        "MC_RR_INT_LIM", 0.3, unit="1", minimum=0.0, maximum=1.0,
        short="Largest roll torque that the integrator may hold",
    )  # fmt: skip
    pitch_multiplier: float = param(
        "MC_PITCHRATE_K", 1.0, unit="1", minimum=0.5, maximum=3.0,
        short="Multiplier of MC_PITCHRATE_P, _I and _D",
    )  # fmt: skip
    pitch_p: float = param(
        "MC_PITCHRATE_P", 0.08, unit="1/(rad/s)", minimum=0.04, maximum=0.6,
        short="Pitch torque per rad/s of pitch rate error",
    )  # fmt: skip
    pitch_i: float = param(
        "MC_PITCHRATE_I", 0.15, unit="1/rad", minimum=0.0, maximum=2.0,
        short="Pitch torque per rad of integrated pitch rate error",
    )  # fmt: skip
    pitch_d: float = param(
        "MC_PITCHRATE_D", 0.003, unit="1/(rad/s^2)", minimum=0.0, maximum=0.01,
        short="Pitch torque per rad/s^2 of pitch acceleration, opposing it",
    )  # fmt: skip
    pitch_integral_limit: float = param(
        "MC_PR_INT_LIM", 0.3, unit="1", minimum=0.0, maximum=1.0,
        short="Largest pitch torque that the integrator may hold",
    )  # fmt: skip
    yaw_multiplier: float = param(
        "MC_YAWRATE_K", 1.0, unit="1", minimum=0.5, maximum=3.0,
        short="Multiplier of MC_YAWRATE_P, _I and _D",
    )  # fmt: skip
    yaw_p: float = param(
        "MC_YAWRATE_P", 0.3, unit="1/(rad/s)", minimum=0.05, maximum=2.0,
        short="Yaw torque per rad/s of yaw rate error",
    )  # fmt: skip
    yaw_i: float = param(
        "MC_YAWRATE_I", 0.15, unit="1/rad", minimum=0.0, maximum=2.0,
        short="Yaw torque per rad of integrated yaw rate error",
    )  # fmt: skip
    yaw_d: float = param(
        "MC_YAWRATE_D", 0.0, unit="1/(rad/s^2)", minimum=0.0, maximum=0.05,
        short="Yaw torque per rad/s^2 of yaw acceleration, opposing it",
    )  # fmt: skip
    yaw_integral_limit: float = param(
        "MC_YR_INT_LIM", 0.3, unit="1", minimum=0.0, maximum=1.0,
        short="Largest yaw torque that the integrator may hold",
    )  # fmt: skip
    derivative_cutoff_hz: float = param(
        "IMU_DGYRO_CUTOFF", 30.0, unit="Hz", minimum=1.0, maximum=100.0,
        short="Cut-off of the low pass in front of the rate derivative",
    )  # fmt: skip
