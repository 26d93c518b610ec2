"""Parameters of the commander: arming, disarming, stick override."""

from dataclasses import dataclass

from uav_firmware.lib.drag import DragModel
from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class CommanderParams:
    """Limits of arming, times of disarming, stick override."""

    disarm_landed_s: float = param(
        "COM_DISARM_LAND", 2.0, unit="s", minimum=-1.0, maximum=20.0,
        short="Time from landing to disarming; negative never",
    )  # fmt: skip
    disarm_preflight_s: float = param(
        "COM_DISARM_PRFLT", 10.0, unit="s", minimum=-1.0, maximum=600.0,
        short="Time from arming to disarming when the vehicle does not take off; negative never",
    )  # fmt: skip
    disarm_mission_s: float = param(
        "COM_DISARM_MIS", 60.0, unit="s", minimum=-1.0, maximum=3600.0,
        short="Time to disarming in a mission that does not take off; negative never",
    )  # fmt: skip
    arm_battery_min: float = param(
        "COM_ARM_BAT_MIN", 0.15, unit="1", minimum=0.0, maximum=0.9,
        short="Remaining charge, of a full battery, needed to arm",
    )  # fmt: skip
    orbit_radius_max: float = param(
        "MC_ORBIT_RAD_MAX", 1000.0, unit="m", minimum=1.0, maximum=10000.0,
        short="Largest radius of an orbit",
    )  # fmt: skip
    position_accuracy_max: float = param(
        "COM_POS_FS_EPH", 5.0, unit="m", minimum=0.5, maximum=400.0,
        short="Horizontal accuracy of the position, one sigma, needed to arm",
    )  # fmt: skip
    failure_injection: int = param(
        "SYS_FAILURE_EN", 0, unit="1", minimum=0, maximum=1,
        short="1 lets INJECT_FAILURE break parts of the vehicle, for tests",
    )  # fmt: skip
    acknowledge_failures: int = param(
        "COM_FAIL_ACK", 0, unit="1", minimum=0, maximum=1,
        short="1 acknowledges the failures of former flights, and becomes 0 again",
        volatile=True, locked_while_armed=True,
    )  # fmt: skip
    check_escs: int = param(
        "COM_ARM_CHK_ESCS", 1, unit="1", minimum=0, maximum=1,
        short="1 denies arming without the telemetry of all speed controllers",
    )  # fmt: skip
    stick_override: int = param(
        "COM_RC_OVERRIDE", 1, unit="1", minimum=0, maximum=3,
        short="Moving a stick changes to position mode",
        bits={0: "in automatic modes", 1: "in offboard"},
    )  # fmt: skip
    stick_override_percent: float = param(
        "COM_RC_STICK_OV", 30.0, unit="%", minimum=5.0, maximum=80.0,
        short="Deflection of roll, pitch or yaw stick that takes over, of full deflection",
    )  # fmt: skip
    ballistic_coefficient_x: float = param(
        "EKF2_BCOEF_X", 87.0, unit="kg/m^2", minimum=1.0, maximum=200.0,
        short="Ballistic coefficient of the body along x, which relates tilt to wind",
    )  # fmt: skip
    ballistic_coefficient_y: float = param(
        "EKF2_BCOEF_Y", 87.0, unit="kg/m^2", minimum=1.0, maximum=200.0,
        short="Ballistic coefficient of the body along y",
    )  # fmt: skip
    momentum_drag: float = param(
        "EKF2_MCOEF", 0.295, unit="1/s", minimum=0.0, maximum=1.0,
        short="Momentum drag of the rotors per airspeed, at sea level; 0: no wind is estimated",
    )  # fmt: skip

    @property
    def drag(self) -> DragModel:
        """Drag of the airframe by its airspeed."""
        return DragModel(
            self.ballistic_coefficient_x, self.ballistic_coefficient_y, self.momentum_drag
        )
