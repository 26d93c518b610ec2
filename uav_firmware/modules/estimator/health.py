"""Which parts of the estimate may be used, and as MAVLink's flags."""

from enum import IntFlag
from typing import NamedTuple


class StatusFlag(IntFlag):
    """MAVLink's ESTIMATOR_STATUS_FLAGS."""

    ATTITUDE = 1
    VELOCITY_HORIZ = 2
    VELOCITY_VERT = 4
    POS_HORIZ_REL = 8
    POS_HORIZ_ABS = 16
    POS_VERT_ABS = 32
    POS_VERT_AGL = 64
    CONST_POS_MODE = 128
    PRED_POS_HORIZ_REL = 256
    PRED_POS_HORIZ_ABS = 512
    GPS_GLITCH = 1024
    ACCEL_ERROR = 2048


class Validity(NamedTuple):
    """True where the estimate may be used; all false before alignment."""

    attitude: bool = False
    heading: bool = False
    velocity: bool = False
    position: bool = False
    altitude: bool = False
    gps_rejected: bool = False
    accelerometer_bad: bool = False
    dead_reckoning: bool = False


def status_flags(validity: Validity) -> int:
    """The bits for ESTIMATOR_STATUS.

    Position is always about the origin that GPS gave, so relative and absolute go together, and
    what is valid now is what is predicted for flight. Nothing measures the height above ground.
    """
    flags = StatusFlag(0)
    if validity.attitude and validity.heading:
        flags |= StatusFlag.ATTITUDE
    if validity.velocity:
        flags |= StatusFlag.VELOCITY_HORIZ
    if validity.velocity or validity.altitude:
        flags |= StatusFlag.VELOCITY_VERT
    if validity.position:
        flags |= StatusFlag.POS_HORIZ_REL | StatusFlag.POS_HORIZ_ABS
        flags |= StatusFlag.PRED_POS_HORIZ_REL | StatusFlag.PRED_POS_HORIZ_ABS
    elif validity.attitude and not validity.velocity:
        flags |= StatusFlag.CONST_POS_MODE
    if validity.altitude:
        flags |= StatusFlag.POS_VERT_ABS
    if validity.gps_rejected:
        flags |= StatusFlag.GPS_GLITCH
    if validity.accelerometer_bad:
        flags |= StatusFlag.ACCEL_ERROR
    return int(flags)
