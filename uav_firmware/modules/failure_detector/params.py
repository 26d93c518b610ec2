"""Thresholds of the failure detector: PX4's names where PX4 has them.

Names that PX4 does not have: FD_ACT_RPM_FULL, FD_ACT_RPM_SHR, FD_ACT_RPM_WEAK, FD_CRASH_EN.
"""

from dataclasses import dataclass

from uav_firmware.parameters import param

_LEAST_ANGLE_DEG = 30.0  # Below it a gust alone would stop the motors; PX4 documents 60 to 180


@dataclass(frozen=True, slots=True, kw_only=True)
class FailureDetectorParams:
    """When a motor counts as failed, and an attitude as lost."""

    motors_enabled: int = param(
        "FD_ACT_EN", 1, unit="1", minimum=0, maximum=1,
        short="Watch the motors by the telemetry of their speed controllers: 1",
        locked_while_armed=True,
    )  # fmt: skip
    least_command: float = param(
        "FD_ACT_MOT_THR", 0.2, unit="1", minimum=0.05, maximum=1.0,
        short="Motor command below which a motor counts as idle",
        locked_while_armed=True,
    )  # fmt: skip
    time_ms: float = param(
        "FD_ACT_MOT_TOUT", 24.0, unit="ms", minimum=8.0, maximum=10000.0,
        short="Time that a motor must be too slow to count as failed",
        locked_while_armed=True,
    )  # fmt: skip
    full_speed_rpm: float = param(
        "FD_ACT_RPM_FULL", 10650.0, unit="rpm", minimum=100.0, maximum=100000.0,
        short="Rotor speed at full command",
        locked_while_armed=True,
    )  # fmt: skip
    least_share: float = param(
        "FD_ACT_RPM_SHR", 0.7, unit="1", minimum=0.1, maximum=0.95,
        short="Share of the expected rotor speed below which a motor is too slow",
        locked_while_armed=True,
    )  # fmt: skip
    weak_share: float = param(
        "FD_ACT_RPM_WEAK", 0.9, unit="1", minimum=0.0, maximum=0.98,
        short="Share of the expected speed of all rotors, below it the propulsion is weak; 0 never",
        locked_while_armed=True,
    )  # fmt: skip
    crash_enabled: int = param(
        "FD_CRASH_EN", 1, unit="1", minimum=0, maximum=1,
        short="Detect a crash and stop the motors then: 1",
    )  # fmt: skip
    roll_deg: float = param(
        "FD_FAIL_R", 60.0, unit="deg", minimum=0.0, maximum=180.0,
        short="Roll angle beyond which the attitude counts as lost; 0 never, else 30 or more",
        locked_while_armed=True, least_if_on=_LEAST_ANGLE_DEG,
    )  # fmt: skip
    pitch_deg: float = param(
        "FD_FAIL_P", 60.0, unit="deg", minimum=0.0, maximum=180.0,
        short="Pitch angle beyond which the attitude counts as lost; 0 never, else 30 or more",
        locked_while_armed=True, least_if_on=_LEAST_ANGLE_DEG,
    )  # fmt: skip
    roll_time_s: float = param(
        "FD_FAIL_R_TTRI", 0.3, unit="s", minimum=0.02, maximum=5.0,
        short="Time that the roll angle must be exceeded",
        locked_while_armed=True,
    )  # fmt: skip
    pitch_time_s: float = param(
        "FD_FAIL_P_TTRI", 0.3, unit="s", minimum=0.02, maximum=5.0,
        short="Time that the pitch angle must be exceeded",
        locked_while_armed=True,
    )  # fmt: skip
