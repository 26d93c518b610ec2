"""Parameters of the navigator: speeds and slopes of the trajectory, acceptance, return."""

from dataclasses import dataclass

from uav_firmware.lib.motion import MotionLimits
from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigatorParams:
    """How modes and missions are flown."""

    cruise_speed: float = param(
        "MPC_XY_CRUISE", 5.0, unit="m/s", minimum=0.5, maximum=20.0,
        short="Horizontal speed in missions and modes, unless a command changes it",
    )  # fmt: skip
    acceleration_horizontal: float = param(
        "MPC_ACC_HOR", 5.0, unit="m/s^2", minimum=0.5, maximum=8.0,
        short="Horizontal acceleration of the trajectory",
    )  # fmt: skip
    acceleration_up: float = param(
        "MPC_ACC_UP_MAX", 4.0, unit="m/s^2", minimum=0.5, maximum=8.0,
        short="Upward acceleration of the trajectory",
    )  # fmt: skip
    acceleration_down: float = param(
        "MPC_ACC_DOWN_MAX", 3.0, unit="m/s^2", minimum=0.5, maximum=8.0,
        short="Downward acceleration of the trajectory",
    )  # fmt: skip
    jerk: float = param(
        "MPC_JERK_AUTO", 25.0, unit="m/s^3", minimum=1.0, maximum=80.0,
        short="Jerk of the trajectory",
    )  # fmt: skip
    climb_speed: float = param(
        "MPC_Z_V_AUTO_UP", 2.5, unit="m/s", minimum=0.3, maximum=8.0,
        short="Climb speed in missions and modes",
    )  # fmt: skip
    descent_speed: float = param(
        "MPC_Z_V_AUTO_DN", 1.5, unit="m/s", minimum=0.3, maximum=4.0,
        short="Descent speed in missions and modes",
    )  # fmt: skip
    land_speed: float = param(
        "MPC_LAND_SPEED", 0.7, unit="m/s", minimum=0.2, maximum=2.0,
        short="Descent speed of a landing below MPC_LAND_ALT2",
    )  # fmt: skip
    land_slow_height: float = param(
        "MPC_LAND_ALT2", 5.0, unit="m", minimum=1.0, maximum=30.0,
        short="Height above the landing point where MPC_LAND_SPEED begins",
    )  # fmt: skip
    land_crawl_height: float = param(
        "MPC_LAND_ALT3", 1.2, unit="m", minimum=0.3, maximum=10.0,
        short="Height above the landing point where 0.6 times MPC_LAND_SPEED begins",
    )  # fmt: skip
    tracking_error_max: float = param(
        "MPC_XY_ERR_MAX", 2.0, unit="m", minimum=0.5, maximum=10.0,
        short="Distance behind the trajectory at which the trajectory waits; slows from half of it",
    )  # fmt: skip
    yaw_rate_max_deg: float = param(
        "MPC_YAWRAUTO_MAX", 45.0, unit="deg/s", minimum=5.0, maximum=360.0,
        short="Yaw rate in missions and modes",
    )  # fmt: skip
    yaw_acceleration_max_deg: float = param(
        "MPC_YAWRAUTO_ACC", 90.0, unit="deg/s^2", minimum=5.0, maximum=360.0,
        short="Yaw acceleration in missions and modes",
    )  # fmt: skip
    takeoff_height: float = param(
        "MIS_TAKEOFF_ALT", 2.5, unit="m", minimum=1.0, maximum=80.0,
        short="Height above home of a takeoff without altitude",
    )  # fmt: skip
    farthest_first_position: float = param(
        "MIS_DIST_1WP", 900.0, unit="m", minimum=-1.0, maximum=10000.0,
        short="Farthest that a mission's first position may lie from home; 0 or less for no limit",
    )  # fmt: skip
    longest_leg: float = param(
        "MIS_DIST_WPS", 900.0, unit="m", minimum=-1.0, maximum=10000.0,
        short="Longest distance from one mission position to the next; 0 or less for no limit",
    )  # fmt: skip
    acceptance_radius: float = param(
        "NAV_ACC_RAD", 2.0, unit="m", minimum=0.05, maximum=200.0,
        short="Acceptance radius of items that give none",
    )  # fmt: skip
    altitude_acceptance: float = param(
        "NAV_MC_ALT_RAD", 0.8, unit="m", minimum=0.05, maximum=200.0,
        short="Vertical acceptance of items",
    )  # fmt: skip
    return_height: float = param(
        "RTL_RETURN_ALT", 20.0, unit="m", minimum=2.0, maximum=150.0,
        short="Height above home to climb to before flying home from afar",
    )  # fmt: skip
    return_descend_height: float = param(
        "RTL_DESCEND_ALT", 10.0, unit="m", minimum=2.0, maximum=100.0,
        short="Height above home at which a return with RTL_LAND_DELAY waits",
    )  # fmt: skip
    return_land_delay: float = param(
        "RTL_LAND_DELAY", 0.0, unit="s", minimum=-1.0, maximum=300.0,
        short="Wait above home before landing; -1 to stay there",
    )  # fmt: skip
    return_close_radius: float = param(
        "RTL_MIN_DIST", 10.0, unit="m", minimum=0.5, maximum=100.0,
        short="Distance from home within which a return does not climb first",
    )  # fmt: skip

    orbit_radius: float = param(
        "NAV_LOITER_RAD", 10.0, unit="m", minimum=1.0, maximum=1000.0,
        short="Radius of a circle that is ordered without one",
    )  # fmt: skip

    fence_action: int = param(
        "GF_ACTION", 2, unit="1", minimum=0, maximum=5,
        short="At a fence breach",
        values={0: "nothing", 1: "warn", 2: "hold", 3: "return", 4: "terminate", 5: "land"},
    )  # fmt: skip
    fence_prediction: int = param(
        "GF_PREDICT", 1, unit="1", minimum=0, maximum=1,
        short="Act on a breach before it happens, where the vehicle could no longer stop",
    )  # fmt: skip
    fence_distance: float = param(
        "GF_MAX_HOR_DIST", 0.0, unit="m", minimum=0.0, maximum=100000.0,
        short="Farthest that the vehicle may be from home; 0 no limit",
    )  # fmt: skip
    fence_height: float = param(
        "GF_MAX_VER_DIST", 0.0, unit="m", minimum=0.0, maximum=100000.0,
        short="Highest that the vehicle may be above home; 0 no limit",
    )  # fmt: skip

    follow_distance: float = param(
        "FLW_TGT_DST", 8.0, unit="m", minimum=1.0, maximum=200.0,
        short="Horizontal distance from a target that is followed",
    )  # fmt: skip
    follow_height: float = param(
        "FLW_TGT_HT", 8.0, unit="m", minimum=1.0, maximum=200.0,
        short="Height above home, or with FLW_TGT_ALT_M 2 above the target, of a follower",
    )  # fmt: skip
    follow_lowest: float = param(
        "FLW_TGT_MIN_HT", 2.0, unit="m", minimum=0.5, maximum=200.0,
        short="Height above home below which a follower never goes",
    )  # fmt: skip
    follow_angle_deg: float = param(
        "FLW_TGT_FA", 180.0, unit="deg", minimum=-180.0, maximum=180.0,
        short="Place of a follower, clockwise from the target's course: 0 ahead, 180 behind",
    )  # fmt: skip
    follow_altitude_mode: int = param(
        "FLW_TGT_ALT_M", 0, unit="1", minimum=0, maximum=2,
        short="Height of a follower",
        values={0: "constant", 1: "constant (as 0)", 2: "with the target's own height"},
    )  # fmt: skip
    follow_speed: float = param(
        "FLW_TGT_MAX_VEL", 5.0, unit="m/s", minimum=0.5, maximum=20.0,
        short="Horizontal speed of a follower",
    )  # fmt: skip
    follow_responsiveness: float = param(
        "FLW_TGT_RS", 0.1, unit="1", minimum=0.0, maximum=1.0,
        short="How a follower takes up a target's changes: 0 at once, 1 smoothly",
    )  # fmt: skip

    def limits(self) -> MotionLimits:
        """Limits of the trajectory with nothing commanded."""
        return MotionLimits(
            self.cruise_speed,
            self.climb_speed,
            self.descent_speed,
            self.acceleration_horizontal,
            self.acceleration_up,
            self.acceleration_down,
            self.jerk,
        )
