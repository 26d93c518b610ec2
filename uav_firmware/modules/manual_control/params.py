"""Parameters of manual control, with PX4's names."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class ManualControlParams:
    """Dead zone, curves and full deflection of the sticks."""

    dead_zone: float = param(
        "MPC_HOLD_DZ", 0.1, unit="1", minimum=0.0, maximum=0.9,
        short="Deflection of a stick, of full deflection, below which it counts as centred",
    )  # fmt: skip
    horizontal_expo: float = param(
        "MPC_XY_MAN_EXPO", 0.6, unit="1", minimum=0.0, maximum=1.0,
        short="Curve of the sticks for horizontal velocity: 0 linear, 1 cubic",
    )  # fmt: skip
    vertical_expo: float = param(
        "MPC_Z_MAN_EXPO", 0.6, unit="1", minimum=0.0, maximum=1.0,
        short="Curve of the stick for climb speed: 0 linear, 1 cubic",
    )  # fmt: skip
    yaw_expo: float = param(
        "MPC_YAW_EXPO", 0.6, unit="1", minimum=0.0, maximum=1.0,
        short="Curve of the stick for yaw rate: 0 linear, 1 cubic",
    )  # fmt: skip
    speed_max: float = param(
        "MPC_VEL_MANUAL", 10.0, unit="m/s", minimum=0.5, maximum=20.0,
        short="Horizontal speed at full deflection in position mode",
    )  # fmt: skip
    jerk_max: float = param(
        "MPC_JERK_MAX", 8.0, unit="m/s^3", minimum=0.5, maximum=500.0,
        short="Largest change of acceleration by the sticks in position mode",
    )  # fmt: skip
    tilt_max_deg: float = param(
        "MPC_MAN_TILT_MAX", 35.0, unit="deg", minimum=1.0, maximum=60.0,
        short="Tilt at full deflection in stabilized and altitude mode",
    )  # fmt: skip
    yaw_rate_max_deg_s: float = param(
        "MPC_MAN_Y_MAX", 150.0, unit="deg/s", minimum=1.0, maximum=400.0,
        short="Yaw rate at full deflection",
    )  # fmt: skip
    thrust_min: float = param(
        "MPC_MANTHR_MIN", 0.08, unit="1", minimum=0.0, maximum=0.15,
        short="Thrust in the air with the throttle down in stabilized mode, full thrust being 1",
    )  # fmt: skip
    slow_from_height: float = param(
        "MPC_LAND_ALT1", 10.0, unit="m", minimum=1.0, maximum=50.0,
        short="Height above the ground below which a descent by stick slows down to MPC_LAND_SPEED",
    )  # fmt: skip
    acro_roll_rate_deg_s: float = param(
        "MC_ACRO_R_MAX", 100.0, unit="deg/s", minimum=1.0, maximum=1800.0,
        short="Roll rate at full deflection in acro mode",
    )  # fmt: skip
    acro_pitch_rate_deg_s: float = param(
        "MC_ACRO_P_MAX", 100.0, unit="deg/s", minimum=1.0, maximum=1800.0,
        short="Pitch rate at full deflection in acro mode",
    )  # fmt: skip
    acro_yaw_rate_deg_s: float = param(
        "MC_ACRO_Y_MAX", 100.0, unit="deg/s", minimum=1.0, maximum=1800.0,
        short="Yaw rate at full deflection in acro mode",
    )  # fmt: skip
    acro_expo: float = param(
        "MC_ACRO_EXPO", 0.0, unit="1", minimum=0.0, maximum=1.0,
        short="Curve of the roll and pitch sticks in acro mode: 0 linear, 1 cubic",
    )  # fmt: skip
    acro_yaw_expo: float = param(
        "MC_ACRO_EXPO_Y", 0.0, unit="1", minimum=0.0, maximum=1.0,
        short="Curve of the yaw stick in acro mode: 0 linear, 1 cubic",
    )  # fmt: skip
