"""Gains and limits of the position loop, named as PX4 names them."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionControlParams:
    """Gains and limits of the position controller."""

    xy_p: float = param(
        "MPC_XY_P", 1.4, unit="1/s", minimum=0.2, maximum=2.5,
        short="Corrective velocity per metre of horizontal position error",
    )  # fmt: skip
    z_p: float = param(
        "MPC_Z_P", 1.3, unit="1/s", minimum=0.2, maximum=2.5,
        short="Corrective velocity per metre of vertical position error",
    )  # fmt: skip
    xy_velocity_p: float = param(
        "MPC_XY_VEL_P_ACC", 3.2, unit="1/s", minimum=1.2, maximum=6.0,
        short="Acceleration per m/s of horizontal velocity error",
    )  # fmt: skip
    xy_velocity_i: float = param(
        "MPC_XY_VEL_I_ACC", 1.0, unit="1/s^2", minimum=0.0, maximum=10.0,
        short="Acceleration per metre of integrated horizontal velocity error",
    )  # fmt: skip
    xy_velocity_d: float = param(
        "MPC_XY_VEL_D_ACC", 0.1, unit="1", minimum=0.0, maximum=2.0,
        short="Acceleration per m/s^2 of horizontal acceleration error",
    )  # fmt: skip
    z_velocity_p: float = param(
        "MPC_Z_VEL_P_ACC", 4.5, unit="1/s", minimum=2.0, maximum=15.0,
        short="Acceleration per m/s of vertical velocity error",
    )  # fmt: skip
    z_velocity_i: float = param(
        "MPC_Z_VEL_I_ACC", 2.0, unit="1/s^2", minimum=0.2, maximum=5.0,
        short="Acceleration per metre of integrated vertical velocity error",
    )  # fmt: skip
    z_velocity_d: float = param(
        "MPC_Z_VEL_D_ACC", 0.0, unit="1", minimum=0.0, maximum=2.0,
        short="Acceleration per m/s^2 of vertical acceleration error",
    )  # fmt: skip
    xy_velocity_max: float = param(
        "MPC_XY_VEL_MAX", 12.0, unit="m/s", minimum=0.5, maximum=20.0,
        short="Largest horizontal speed",
    )  # fmt: skip
    z_velocity_max_up: float = param(
        "MPC_Z_VEL_MAX_UP", 3.0, unit="m/s", minimum=0.5, maximum=8.0,
        short="Largest climb speed",
    )  # fmt: skip
    z_velocity_max_down: float = param(
        "MPC_Z_VEL_MAX_DN", 1.5, unit="m/s", minimum=0.5, maximum=4.0,
        short="Largest sink speed",
    )  # fmt: skip
    tilt_max_air_deg: float = param(
        "MPC_TILTMAX_AIR", 35.0, unit="deg", minimum=5.0, maximum=60.0,
        short="Largest tilt in the air",
    )  # fmt: skip
    tilt_max_ground_deg: float = param(
        "MPC_TILTMAX_LND", 12.0, unit="deg", minimum=5.0, maximum=45.0,
        short="Largest tilt during takeoff and touchdown",
    )  # fmt: skip
    thrust_min: float = param(
        "MPC_THR_MIN", 0.06, unit="1", minimum=0.02, maximum=0.15,
        short="Smallest collective thrust in the air, full thrust being 1",
    )  # fmt: skip
    thrust_max: float = param(
        "MPC_THR_MAX", 0.9, unit="1", minimum=0.3, maximum=1.0,
        short="Largest collective thrust, full thrust being 1",
    )  # fmt: skip
    thrust_hover: float = param(
        "MPC_THR_HOVER", 0.225, unit="1", minimum=0.1, maximum=0.8,
        short="Collective thrust that carries the weight, full thrust being 1",
    )  # fmt: skip
    thrust_xy_margin: float = param(
        "MPC_THR_XY_MARG", 0.15, unit="1", minimum=0.0, maximum=0.5,
        short="Thrust reserved for horizontal control at full climb, full thrust being 1",
    )  # fmt: skip
    takeoff_ramp_time_s: float = param(
        "MPC_TKO_RAMP_T", 1.0, unit="s", minimum=0.1, maximum=5.0,
        short="Time in which the thrust rises from idle to what the climb needs",
    )  # fmt: skip
    spool_up_time_s: float = param(
        "COM_SPOOLUP_TIME", 1.0, unit="s", minimum=0.0, maximum=5.0,
        short="Time that the motors idle after arming before the thrust rises",
    )  # fmt: skip
    estimates_hover_thrust: int = param(
        "MPC_USE_HTE", 1, unit="1", minimum=0, maximum=1,
        short="Hover thrust",
        values={0: "MPC_THR_HOVER", 1: "learnt in flight"},
    )  # fmt: skip
    hover_thrust_error: float = param(
        "HTE_HT_ERR_INIT", 0.05, unit="1", minimum=0.0, maximum=1.0,
        short="Error of MPC_THR_HOVER, one sigma",
    )  # fmt: skip
    hover_thrust_noise: float = param(
        "HTE_HT_NOISE", 0.0036, unit="1/sqrt(s)", minimum=0.0001, maximum=1.0,
        short="Random walk of the hover thrust",
    )  # fmt: skip
    hover_thrust_gate: float = param(
        "HTE_ACC_GATE", 3.0, unit="SD", minimum=1.0, maximum=10.0,
        short="Gate of the acceleration from which the hover thrust is learnt",
    )  # fmt: skip
