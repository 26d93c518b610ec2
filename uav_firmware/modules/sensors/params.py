"""How far healthy instances of a sensor may be apart; PX4's EKF2_SEL_IMU_* where it has them.

PX4's defaults, 7 deg/s and 1 m/s^2, are for differences that add up over minutes between whole
estimators; here the calibrated differences are learnt and only what is left counts. Names that PX4
does not have: SENS_BARO_DIFF, SENS_MAG_DIFF.
"""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorsParams:
    """Limits of the vote."""

    rate_deg_s: float = param(
        "EKF2_SEL_IMU_RAT", 1.0, unit="deg/s", minimum=0.3, maximum=20.0,
        short="Rate by which a gyroscope may leave the others",
        locked_while_armed=True,
    )  # fmt: skip
    acceleration_m_s2: float = param(
        "EKF2_SEL_IMU_ACC", 0.4, unit="m/s^2", minimum=0.2, maximum=10.0,
        short="Acceleration by which an accelerometer may leave the others",
        locked_while_armed=True,
    )  # fmt: skip
    height_m: float = param(
        "SENS_BARO_DIFF", 1.0, unit="m", minimum=0.3, maximum=100.0,
        short="Height by which a barometer may leave the others",
    )  # fmt: skip
    field_gauss: float = param(
        "SENS_MAG_DIFF", 0.2, unit="gauss", minimum=0.02, maximum=1.0,
        short="Field by which a compass may leave the others",
    )  # fmt: skip
