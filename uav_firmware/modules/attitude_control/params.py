"""Gains of the attitude loop, named as PX4 names them."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeControlParams:
    """Gains and limits of the attitude controller."""

    roll_p: float = param(
        "MC_ROLL_P", 6.5, unit="1/s", minimum=2.0, maximum=12.0,
        short="Roll rate per rad of roll error",
    )  # fmt: skip
    pitch_p: float = param(
        "MC_PITCH_P", 6.5, unit="1/s", minimum=2.0, maximum=12.0,
        short="Pitch rate per rad of pitch error",
    )  # fmt: skip
    yaw_p: float = param(
        "MC_YAW_P", 2.8, unit="1/s", minimum=0.2, maximum=5.0,
        short="Yaw rate per rad of yaw error",
    )  # fmt: skip
    yaw_weight: float = param(
        "MC_YAW_WEIGHT", 0.4, unit="1", minimum=0.1, maximum=1.0,
        short="Share of a yaw error that is corrected together with a tilt error",
    )  # fmt: skip
    roll_rate_max_deg_s: float = param(
        "MC_ROLLRATE_MAX", 220.0, unit="deg/s", minimum=10.0, maximum=1800.0,
        short="Largest commanded roll rate",
    )  # fmt: skip
    pitch_rate_max_deg_s: float = param(
        "MC_PITCHRATE_MAX", 220.0, unit="deg/s", minimum=10.0, maximum=1800.0,
        short="Largest commanded pitch rate",
    )  # fmt: skip
    yaw_rate_max_deg_s: float = param(
        "MC_YAWRATE_MAX", 120.0, unit="deg/s", minimum=10.0, maximum=1800.0,
        short="Largest commanded yaw rate",
    )  # fmt: skip
