"""Parameters of the failsafes, named as PX4 names them: what counts as lost, what happens then."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class FailsafeParams:
    """Thresholds, delays and actions."""

    battery_low: float = param(
        "BAT_LOW_THR", 0.15, unit="1", minimum=0.12, maximum=0.5,
        short="Remaining charge, of a full battery, below which the operator is warned",
    )  # fmt: skip
    battery_critical: float = param(
        "BAT_CRIT_THR", 0.07, unit="1", minimum=0.05, maximum=0.5,
        short="Remaining charge, of a full battery, below which the vehicle returns",
    )  # fmt: skip
    battery_emergency: float = param(
        "BAT_EMERGEN_THR", 0.05, unit="1", minimum=0.03, maximum=0.5,
        short="Remaining charge, of a full battery, below which the vehicle lands",
    )  # fmt: skip
    battery_action: int = param(
        "COM_LOW_BAT_ACT", 3, unit="1", minimum=0, maximum=3,
        short="A low battery",
        values={
            0: "warns only", 1: "warns only (as 0)", 2: "lands when critical",
            3: "returns when critical and lands in emergency",
        },
    )  # fmt: skip
    position_loss_s: float = param(
        "COM_POS_FS_DELAY", 1.0, unit="s", minimum=0.1, maximum=100.0,
        short="Time without a valid position until the vehicle lands where it is",
    )  # fmt: skip
    link_loss_action: int = param(
        "NAV_DLL_ACT", 0, unit="1", minimum=0, maximum=6,
        short="A lost ground station",
        values={0: "nothing", 1: "hold", 2: "return", 3: "land", 5: "terminate", 6: "disarm"},
    )  # fmt: skip
    link_loss_s: float = param(
        "COM_DL_LOSS_T", 10.0, unit="s", minimum=1.0, maximum=300.0,
        short="Time without a heartbeat of any ground station until the link counts as lost",
    )  # fmt: skip
    sticks_loss_action: int = param(
        "NAV_RCL_ACT", 2, unit="1", minimum=0, maximum=6,
        short="Lost sticks",
        values={0: "nothing", 1: "hold", 2: "return", 3: "land", 5: "terminate", 6: "disarm"},
    )  # fmt: skip
    sticks_loss_s: float = param(
        "COM_RC_LOSS_T", 0.5, unit="s", minimum=0.1, maximum=35.0,
        short="Time without MANUAL_CONTROL until the sticks count as lost",
    )  # fmt: skip
    sticks_excepted: int = param(
        "COM_RCL_EXCEPT", 7, unit="1", minimum=0, maximum=7,
        short="Modes that continue without sticks",
        bits={0: "mission", 1: "hold", 2: "offboard"},
    )  # fmt: skip
    offboard_loss_action: int = param(
        "COM_OBL_RC_ACT", 0, unit="1", minimum=0, maximum=7,
        short="Lost setpoints; hold instead of 0 to 2 without sticks",
        values={
            0: "position", 1: "altitude", 2: "stabilized", 3: "return", 4: "land", 5: "hold",
            6: "terminate", 7: "disarm",
        },
    )  # fmt: skip
    offboard_loss_s: float = param(
        "COM_OF_LOSS_T", 1.0, unit="s", minimum=0.5, maximum=60.0,
        short="Time without a setpoint in offboard mode until the stream counts as lost",
    )  # fmt: skip
    motor_failure_action: int = param(
        "COM_ACT_FAIL_ACT", 2, unit="1", minimum=0, maximum=4,
        short="A failed motor",
        values={0: "warns only", 1: "hold", 2: "land", 3: "return", 4: "terminate"},
    )  # fmt: skip
    lockdown_takeoff_s: float = param(
        "COM_LKDOWN_TKO", 3.0, unit="s", minimum=-1.0, maximum=5.0,
        short="Time from the takeoff in which a lost attitude disarms; negative never",
    )  # fmt: skip
    termination_breaker: int = param(
        "CBRK_FLIGHTTERM", 121212, unit="1", minimum=0, maximum=121212,
        short="121212: a lost attitude (FD_FAIL_R, FD_FAIL_P) does not terminate the flight",
    )  # fmt: skip
    wind_warning_m_s: float = param(
        "COM_WIND_WARN", 10.0, unit="m/s", minimum=-1.0, maximum=30.0,
        short="Wind above which the operator is warned; negative never",
    )  # fmt: skip
    wind_max_m_s: float = param(
        "COM_WIND_MAX", 14.0, unit="m/s", minimum=-1.0, maximum=30.0,
        short="Wind above which COM_WIND_MAX_ACT is taken; negative never",
    )  # fmt: skip
    wind_action: int = param(
        "COM_WIND_MAX_ACT", 3, unit="1", minimum=0, maximum=5,
        short="Too much wind",
        values={0: "nothing", 1: "warns only", 2: "hold", 3: "return", 4: "terminate", 5: "land"},
    )  # fmt: skip
    storage_check: int = param(
        "COM_ARM_SDCARD", 1, unit="1", minimum=0, maximum=2,
        short="A medium without room for a flight log",
        values={0: "not looked at", 1: "warns", 2: "denies arming"},
    )  # fmt: skip
    flight_time_max_s: int = param(
        "COM_FLT_TIME_MAX", -1, unit="s", minimum=-1, maximum=86400,
        short="Time in the air after which the vehicle returns; -1 no limit",
    )  # fmt: skip
    remaining_time_action: int = param(
        "COM_FLTT_LOW_ACT", 0, unit="1", minimum=0, maximum=3,
        short="A battery that lasts no longer than a return",
        values={0: "nothing", 1: "warns", 2: "warns (as 1)", 3: "returns"},
    )  # fmt: skip
    return_margin_s: float = param(
        "RTL_TIME_MARGIN", 100.0, unit="s", minimum=0.0, maximum=3600.0,
        short="Time that the battery shall last beyond the return, for COM_FLTT_LOW_ACT",
    )  # fmt: skip
    action_delay_s: float = param(
        "COM_FAIL_ACT_T", 5.0, unit="s", minimum=0.0, maximum=25.0,
        short="Time in hold before a failsafe returns or lands, for the operator to step in",
    )  # fmt: skip
