"""Parameters of the estimator: PX4's EKF2_* names where the meaning is the same.

Defaults are PX4's where the quantity is the same; the exceptions and their reasons are in
docs/reference/estimator-parameters.md. Names that PX4 does not have: EKF2_BARO_WALK,
EKF2_GPS_ALT_T, EKF2_HDG_B_INIT, EKF2_HDG_B_WALK, EKF2_WIND_Z0.
"""

from dataclasses import dataclass
from enum import IntEnum, IntFlag

from uav_firmware.parameters import param


class HeightReference(IntEnum):
    """Values of EKF2_HGT_REF that this vehicle has sensors for; PX4 has 2 and 3 as well."""

    BAROMETER = 0
    GPS = 1


class GpsMode(IntEnum):
    """Values of EKF2_GPS_MODE."""

    AUTOMATIC = 0  # Reset when no other source of position is left
    DEAD_RECKONING = 1  # Reset when no source of velocity is left either


class GpsCheck(IntFlag):
    """Bits of EKF2_GPS_CHECK that this vehicle has checks for; the numbers are PX4's."""

    SATELLITES = 1
    HORIZONTAL_ACCURACY = 4
    VERTICAL_ACCURACY = 8
    SPEED_ACCURACY = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorParams:
    """Noise, gates, requirements and times of the estimator."""

    accel_noise: float = param(
        "EKF2_ACC_NOISE", 0.35, unit="m/s^2", minimum=0.001, maximum=1.0,
        short="White noise of one accelerometer sample, vibration included",
        locked_while_armed=True,
    )  # fmt: skip
    gyro_noise: float = param(
        "EKF2_GYR_NOISE", 0.015, unit="rad/s", minimum=0.0001, maximum=0.1,
        short="White noise of one gyroscope sample, vibration included",
        locked_while_armed=True,
    )  # fmt: skip
    accel_bias_walk: float = param(
        "EKF2_ACC_B_NOISE", 0.002, unit="m/s^2/sqrt(s)", minimum=0.0, maximum=0.1,
        short="Random walk of the accelerometer bias",
        locked_while_armed=True,
    )  # fmt: skip
    gyro_bias_walk: float = param(
        "EKF2_GYR_B_NOISE", 0.0001, unit="rad/s/sqrt(s)", minimum=0.0, maximum=0.01,
        short="Random walk of the gyroscope bias",
        locked_while_armed=True,
    )  # fmt: skip
    accel_bias_limit: float = param(
        "EKF2_ABL_LIM", 0.4, unit="m/s^2", minimum=0.0, maximum=2.0,
        short="Largest accelerometer bias estimated",
        locked_while_armed=True,
    )  # fmt: skip
    gyro_bias_limit: float = param(
        "EKF2_GYR_B_LIM", 0.15, unit="rad/s", minimum=0.0, maximum=0.4,
        short="Largest gyroscope bias of a healthy sensor; one twice as large is followed to land",
        locked_while_armed=True,
    )  # fmt: skip
    accel_bias_sigma: float = param(
        "EKF2_ABIAS_INIT", 0.05, unit="m/s^2", minimum=0.0, maximum=0.5,
        short="Accelerometer bias at switch-on, one sigma",
        locked_while_armed=True,
    )  # fmt: skip
    angle_sigma: float = param(
        "EKF2_ANGERR_INIT", 0.02, unit="rad", minimum=0.001, maximum=0.5,
        short="Tilt error after alignment, one sigma",
        locked_while_armed=True,
    )  # fmt: skip
    gps_position_noise: float = param(
        "EKF2_GPS_P_NOISE", 0.05, unit="m", minimum=0.01, maximum=10.0,
        short="Least noise of a GPS position; what the receiver reports counts if larger",
        locked_while_armed=True,
    )  # fmt: skip
    gps_velocity_noise: float = param(
        "EKF2_GPS_V_NOISE", 0.02, unit="m/s", minimum=0.01, maximum=5.0,
        short="Least noise of a GPS velocity; what the receiver reports counts if larger",
        locked_while_armed=True,
    )  # fmt: skip
    gps_position_gate: float = param(
        "EKF2_GPS_P_GATE", 5.0, unit="SD", minimum=1.0, maximum=100.0,
        short="Gate of GPS position",
        locked_while_armed=True,
    )  # fmt: skip
    gps_velocity_gate: float = param(
        "EKF2_GPS_V_GATE", 5.0, unit="SD", minimum=1.0, maximum=100.0,
        short="Gate of GPS velocity",
        locked_while_armed=True,
    )  # fmt: skip
    height_reference: int = param(
        "EKF2_HGT_REF", HeightReference.GPS, unit="1", minimum=0, maximum=1,
        short="Source whose height does not wander",
        values={0: "barometer", 1: "GPS"},
        locked_while_armed=True,
    )  # fmt: skip
    gps_height_time: float = param(
        "EKF2_GPS_ALT_T", 60.0, unit="s", minimum=1.0, maximum=3600.0,
        short="Correlation time of the slow error of GPS height",
        locked_while_armed=True,
    )  # fmt: skip
    baro_noise: float = param(
        "EKF2_BARO_NOISE", 0.4, unit="m", minimum=0.01, maximum=15.0,
        short="Noise of the barometric height",
        locked_while_armed=True,
    )  # fmt: skip
    baro_walk: float = param(
        "EKF2_BARO_WALK", 0.015, unit="m/sqrt(s)", minimum=0.0, maximum=1.0,
        short="Random walk of the barometer bias",
        locked_while_armed=True,
    )  # fmt: skip
    baro_gate: float = param(
        "EKF2_BARO_GATE", 5.0, unit="SD", minimum=1.0, maximum=100.0,
        short="Gate of the barometric height",
        locked_while_armed=True,
    )  # fmt: skip
    heading_noise: float = param(
        "EKF2_HEAD_NOISE", 0.05, unit="rad", minimum=0.01, maximum=1.0,
        short="Noise of the compass heading",
        locked_while_armed=True,
    )  # fmt: skip
    heading_gate: float = param(
        "EKF2_HDG_GATE", 4.0, unit="SD", minimum=1.0, maximum=100.0,
        short="Gate of the compass heading",
        locked_while_armed=True,
    )  # fmt: skip
    heading_bias_sigma: float = param(
        "EKF2_HDG_B_INIT", 0.035, unit="rad", minimum=0.0, maximum=0.5,
        short="Standing compass error, declination included, one sigma",
        locked_while_armed=True,
    )  # fmt: skip
    heading_bias_walk: float = param(
        "EKF2_HDG_B_WALK", 0.003, unit="rad/sqrt(s)", minimum=0.0, maximum=0.1,
        short="Random walk of the compass error",
        locked_while_armed=True,
    )  # fmt: skip
    declination_source: int = param(
        "EKF2_DECL_TYPE", 1, unit="1", minimum=0, maximum=1,
        short="Declination",
        values={0: "EKF2_MAG_DECL", 1: "looked up for the place of the first fix"},
    )  # fmt: skip
    # World Magnetic Model 2025 at 40.4434 N, 3.7382 W, 650 m, mid 2026: 0.45 degrees east.
    declination_deg: float = param(
        "EKF2_MAG_DECL", 0.45, unit="deg", minimum=-180.0, maximum=180.0,
        short="Magnetic declination while the place is unknown, east positive",
        volatile=True,  # As in PX4, whose metadata a ground station may use instead of ours
    )  # fmt: skip
    required_horizontal_accuracy: float = param(
        "EKF2_REQ_EPH", 3.0, unit="m", minimum=0.5, maximum=100.0,
        short="Horizontal accuracy that a fix must have",
        locked_while_armed=True,
    )  # fmt: skip
    required_vertical_accuracy: float = param(
        "EKF2_REQ_EPV", 5.0, unit="m", minimum=0.5, maximum=100.0,
        short="Vertical accuracy that a fix must have",
        locked_while_armed=True,
    )  # fmt: skip
    required_speed_accuracy: float = param(
        "EKF2_REQ_SACC", 0.5, unit="m/s", minimum=0.05, maximum=5.0,
        short="Speed accuracy that a fix must have",
        locked_while_armed=True,
    )  # fmt: skip
    required_satellites: int = param(
        "EKF2_REQ_NSATS", 6, unit="-", minimum=4, maximum=12,
        short="Satellites that a fix must use",
        locked_while_armed=True,
    )  # fmt: skip
    gps_checks: int = param(
        "EKF2_GPS_CHECK", 29, unit="1", minimum=0, maximum=29,
        short="Checks of a fix",
        bits={0: "EKF2_REQ_NSATS", 2: "EKF2_REQ_EPH", 3: "EKF2_REQ_EPV", 4: "EKF2_REQ_SACC"},
        locked_while_armed=True,
    )  # fmt: skip
    gps_mode: int = param(
        "EKF2_GPS_MODE", GpsMode.DEAD_RECKONING, unit="1", minimum=0, maximum=1,
        short="A GPS position off for 5 s in flight",
        values={0: "reset to it", 1: "only without its velocity"},
        locked_while_armed=True,
    )  # fmt: skip
    origin_time: float = param(
        "EKF2_REQ_GPS_H", 3.0, unit="s", minimum=0.1, maximum=60.0,
        short="Time at rest over which good fixes are averaged into the origin",
        locked_while_armed=True,
    )  # fmt: skip
    drag_control: int = param(
        "EKF2_DRAG_CTRL", 1, unit="1", minimum=0, maximum=1,
        short="Estimate the wind by the drag, and without GPS the velocity by both: 1",
        locked_while_armed=True,
    )  # fmt: skip
    drag_noise: float = param(
        "EKF2_DRAG_NOISE", 2.5, unit="(m/s^2)^2", minimum=0.01, maximum=10.0,
        short="Variance of the drag that is measured",
        locked_while_armed=True,
    )  # fmt: skip
    wind_walk: float = param(
        "EKF2_WIND_NSD", 0.05, unit="m/s/sqrt(s)", minimum=0.0, maximum=1.0,
        short="Random walk of the wind",
        locked_while_armed=True,
    )  # fmt: skip
    wind_roughness_m: float = param(
        "EKF2_WIND_Z0", 0.05, unit="m", minimum=0.0, maximum=0.1,
        short="Roughness of the ground: the wind held without GPS dies towards it; 0 it does not",
        locked_while_armed=True,
    )  # fmt: skip
    no_aid_noise: float = param(
        "EKF2_NOAID_NOISE", 10.0, unit="m", minimum=0.5, maximum=50.0,
        short="Noise of the position held while nothing aids the horizontal estimate",
        locked_while_armed=True,
    )  # fmt: skip
    no_aid_timeout_us: int = param(
        "EKF2_NOAID_TOUT", 12_000_000, unit="us", minimum=500_000, maximum=30_000_000,
        short="Time without aiding after which an estimate counts as invalid",
        locked_while_armed=True,
    )  # fmt: skip
