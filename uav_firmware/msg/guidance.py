"""Orders of the guided modes, and what they do: orbit, follow, region of interest, heading."""

from enum import IntEnum
from typing import NamedTuple

from uav_firmware.msg.status import NavigationState
from uav_firmware.msg.vectors import Vector3


class OrbitHeading(IntEnum):
    """Where the nose points on a circle: MAVLink's ORBIT_YAW_BEHAVIOUR, and two of our own."""

    TOWARDS_CENTRE = 0
    INITIAL = 1
    UNCONTROLLED = 2
    FORWARDS = 3  # Along the circle, in the direction of flight
    PILOT = 4
    UNCHANGED = 5
    BACKWARDS = 6  # Along the circle, against the direction of flight
    AWAY = 7  # From the centre


class FollowHeight(IntEnum):
    """How high a follower flies: MAVLink's altitude modes of DO_FOLLOW."""

    KEEP = 0  # As high as it is
    KEEP_DIFFERENCE = 1  # As far above the target as it is
    FIXED = 2  # A height above home
    PARAMETERS = 3  # As FLW_TGT_HT and FLW_TGT_ALT_M say


class OrbitTarget(NamedTuple):
    """A circle to fly. Written by commander just before it changes the mode.

    NaN means the present place or altitude, the default radius, the cruise speed.
    """

    time_us: int  # [us]
    navigation_state: NavigationState  # Mode that the target belongs to: ORBIT
    latitude_deg: float  # [deg] Of the centre
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    radius_m: float  # [m] Positive clockwise seen from above
    speed_m_s: float  # [m/s] Along the circle
    heading: OrbitHeading
    angle: float  # [rad] To fly; infinite for ever


class FollowOrder(NamedTuple):
    """Whom to follow, and how high. Written by commander just before it changes the mode."""

    time_us: int  # [us]
    navigation_state: NavigationState  # Mode that the order belongs to: AUTO_FOLLOW_TARGET
    system_id: int  # [-] Source of the reports; 0 the first one received
    height: FollowHeight
    height_m: float  # [m] Above home, with FollowHeight.FIXED


class RegionOfInterest(NamedTuple):
    """A place to point at until the next message. Written by commander and navigator."""

    time_us: int  # [us]
    latitude_deg: float  # [deg] NaN: none any more
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]


class HeadingRequest(NamedTuple):
    """Turn in place or on a leg. Written by commander."""

    time_us: int  # [us]
    angle_deg: float  # [deg] Heading, or the turn when relative
    rate_deg_s: float  # [deg/s] 0 or NaN: as the parameters allow
    direction: int  # [-] 1 clockwise, -1 counter-clockwise, 0 the shorter turn
    relative: bool


class FollowTarget(NamedTuple):
    """Position of a target as reported. Written by mavlink, read by navigator.

    NaN where the report holds no value.
    """

    time_us: int  # [us] Of arrival
    system_id: int  # [-] Of the sender
    latitude_deg: float  # [deg]
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    velocity_ned: Vector3  # [m/s]
    accuracy_m: float  # [m] One sigma, horizontal


class OrbitStatus(NamedTuple):
    """The circle being flown. Written by navigator, read by mavlink."""

    time_us: int  # [us]
    active: bool
    radius_m: float  # [m] Positive clockwise seen from above
    latitude_deg: float  # [deg] Of the centre
    longitude_deg: float  # [deg]
    altitude_amsl_m: float  # [m]
    speed_m_s: float  # [m/s] That is flown: the commanded speed within its limits
    turned: float  # [rad] On the circle so far
