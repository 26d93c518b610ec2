"""Parameters of the commander: battery thresholds, disarming, what a lost link does."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class CommanderParams:
    """When to warn, when to come home, when to switch the motors off."""

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
    disarm_landed_s: float = param(
        "COM_DISARM_LAND", 2.0, unit="s", minimum=-1.0, maximum=20.0,
        short="Time from landing to disarming; negative never",
    )  # fmt: skip
    disarm_preflight_s: float = param(
        "COM_DISARM_PRFLT", 10.0, unit="s", minimum=-1.0, maximum=600.0,
        short="Time from arming to disarming when the vehicle does not take off; negative never",
    )  # fmt: skip
    arm_battery_min: float = param(
        "COM_ARM_BAT_MIN", 0.15, unit="1", minimum=0.0, maximum=0.9,
        short="Remaining charge, of a full battery, needed to arm",
    )  # fmt: skip
    position_loss_s: float = param(
        "COM_POS_FS_DELAY", 1.0, unit="s", minimum=0.1, maximum=100.0,
        short="Time without a valid position until the vehicle lands where it is",
    )  # fmt: skip
    link_loss_action: int = param(
        "NAV_DLL_ACT", 0, unit="1", minimum=0, maximum=3,
        short="What a lost ground-station link does: 0 nothing, 1 hold, 2 return, 3 land",
    )  # fmt: skip
    link_loss_s: float = param(
        "COM_DL_LOSS_T", 10.0, unit="s", minimum=1.0, maximum=300.0,
        short="Time without a heartbeat of any ground station until the link counts as lost",
    )  # fmt: skip
    orbit_radius_max: float = param(
        "MC_ORBIT_RAD_MAX", 1000.0, unit="m", minimum=1.0, maximum=10000.0,
        short="Largest radius of an orbit",
    )  # fmt: skip
