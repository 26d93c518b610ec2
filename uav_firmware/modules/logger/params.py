"""Parameters of the logger."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggerParams:
    """When and how much is logged; names and values are PX4's."""

    mode: int = param(
        "SDLOG_MODE",
        0,
        unit="1",
        minimum=-1,
        maximum=2,
        short="When to log",
        values={
            -1: "never",
            0: "from arming to disarming",
            1: "from boot to disarming",
            2: "from boot to shutdown",
        },
    )
    profile: int = param(
        "SDLOG_PROFILE",
        1,
        unit="1",
        minimum=1,
        maximum=17,
        short="What to log",
        values={1: "default set", 17: "also the attitude loops at control rate"},
    )
    size_max_mb: int = param(
        "SDLOG_MAX_SIZE",
        64,
        unit="MB",
        minimum=1,
        maximum=4095,
        short="Size at which a log continues in the next file",
    )
