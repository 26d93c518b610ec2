"""When a multicopter counts as landed, named as PX4 names it."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class LandDetectorParams:
    """Thresholds of the land detector."""

    vertical_speed_max: float = param(
        "LNDMC_Z_VEL_MAX", 0.25, unit="m/s", minimum=0.05, maximum=1.0,
        short="Largest vertical speed of a vehicle on the ground",
        locked_while_armed=True,
    )  # fmt: skip
    horizontal_speed_max: float = param(
        "LNDMC_XY_VEL_MAX", 1.5, unit="m/s", minimum=0.1, maximum=5.0,
        short="Largest horizontal speed of a vehicle on the ground",
        locked_while_armed=True,
    )  # fmt: skip
    rotation_max_deg_s: float = param(
        "LNDMC_ROT_MAX", 20.0, unit="deg/s", minimum=1.0, maximum=90.0,
        short="Largest roll or pitch rate of a vehicle on the ground",
        locked_while_armed=True,
    )  # fmt: skip
    low_thrust: float = param(
        "LNDMC_LOW_T_THR", 0.4, unit="1", minimum=0.1, maximum=0.9,
        short="Thrust that counts as low, from MPC_THR_MIN (0) to the hover thrust (1)",
        locked_while_armed=True,
    )  # fmt: skip
    trigger_time_s: float = param(
        "LNDMC_TRIG_TIME", 0.8, unit="s", minimum=0.1, maximum=5.0,
        short="Time that all signs of a landing must hold; ground contact takes half of it",
        locked_while_armed=True,
    )  # fmt: skip
