"""Properties of the vehicle that the law of three rotors uses; names that PX4 does not have."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class RotorLossParams:
    """Dynamics of the vehicle and the wanted quickness."""

    enabled: int = param(
        "RL_EN", 1, unit="1", minimum=0, maximum=1,
        short="Fly on three rotors when one has failed: 1",
        locked_while_armed=True,
    )  # fmt: skip
    acceleration: float = param(
        "RL_ACC", 185.0, unit="rad/s^2", minimum=1.0, maximum=10000.0,
        short="Roll or pitch acceleration by the full thrust of one rotor",
        locked_while_armed=True,
    )  # fmt: skip
    motor_time_s: float = param(
        "RL_MOT_T", 0.056, unit="s", minimum=0.005, maximum=0.5,
        short="Time constant of the thrust of a motor",
        locked_while_armed=True,
    )  # fmt: skip
    inertia_ratio: float = param(
        "RL_INERTIA", 1.326, unit="1", minimum=0.5, maximum=3.0,
        short="Moment of inertia about the yaw axis over that about the roll axis",
        locked_while_armed=True,
    )  # fmt: skip
    rotor_spin: float = param(
        "RL_ROT_SPIN", 3.55, unit="rad/s", minimum=0.0, maximum=100.0,
        short="Angular momentum of a rotor at full speed over the roll inertia",
        locked_while_armed=True,
    )  # fmt: skip
    tilt_max_deg: float = param(
        "RL_TILT_MAX", 20.0, unit="deg", minimum=0.0, maximum=45.0,
        short="Largest commanded tilt of the thrust on three rotors",
        locked_while_armed=True,
    )  # fmt: skip
    tilt_pole: float = param(
        "RL_TILT_P", 8.0, unit="1/s", minimum=0.1, maximum=20.0,
        short="Quickness of the tilt",
        locked_while_armed=True,
    )  # fmt: skip
    rate_pole: float = param(
        "RL_RATE_P", 10.0, unit="1/s", minimum=0.1, maximum=50.0,
        short="Quickness of the rates across the thrust",
        locked_while_armed=True,
    )  # fmt: skip
