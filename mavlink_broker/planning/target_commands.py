"""Following a target and tracking a subject: both are live and have a fixed duration."""

from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias

from afarcloud.commands import NavFollowTarget, NavTrackSubject
from afarcloud.enumerations import FollowHeading, TrackMode
from afarcloud.route import Spot
from mavlink_broker.autopilots.families import Family
from mavlink_broker.autopilots.parameter_settings import (
    BEHIND_DEG,
    BESIDE_DEG,
    Following,
    ParameterOverrides,
)
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.command import CommandAlternatives, CommandLong, long_command
from mavlink_broker.planning.situation import Lasted, LiveAction, Situation, Tracked, reposition

FOLLOWED_FOR_S: Final = 60.0
"""AFarCloud defines no end; an event may end it earlier."""
TRACKED_FOR_S: Final = 60.0
SLACK_S: Final = 120.0
_ANGLES_DEG: Final = {TrackMode.TRACE: BEHIND_DEG, TrackMode.PROFILE: BESIDE_DEG}
_FIXED_HEIGHT: Final = 2.0  # Altitude mode of DO_FOLLOW
Vector: TypeAlias = tuple[float, float, float]
STANDING: Final[Vector] = (0.0, 0.0, 0.0)


class TargetState(NamedTuple):
    """Position and velocity of a target."""

    latitude_deg: float
    longitude_deg: float
    velocity_ned_m_s: Vector = STANDING


TargetSource: TypeAlias = Callable[[float, float], TargetState | None]
"""A target that moves: its state by the time since the follow began and the broker's clock [s].

None while it is not known.
"""


def follow(command: NavFollowTarget, situation: Situation) -> LiveAction:
    """Follow a target that the broker sends; a vehicle that cannot flies to its position."""
    p, family = command.parameters, situation.family
    height_m = max(p.altitude, family.lowest_follow_m)
    spot = Spot(p.latitude, p.longitude, height_m)
    alternatives = _following(situation, height_m)
    lost = ["" for _ in alternatives]
    notes = []
    if height_m > p.altitude:
        notes.append(f"altitude: {family.name} follows no lower than {height_m:g} m")
    if situation.maximum_speed_m_s < family.slowest_follow_m_s:
        slowest = f"{family.slowest_follow_m_s:g} m/s"
        notes.append(f"maximum_speed: {family.name} follows no slower than {slowest}")
    if p.heading is not FollowHeading.TOWARD_FOLLOW_POSITION:
        notes.append("heading: nobody steers it by hand, the nose points to the target")
    return LiveAction(
        begin=(*alternatives, (reposition(spot, situation.home),)),
        alternative_notes=(*lost, "the vehicle follows nothing: it waits at the target's place"),
        follow=spot,
        overrides=_follow_overrides(situation, height_m, BEHIND_DEG),
        end=Lasted(FOLLOWED_FOR_S),
        finish=family.holding,
        within_s=FOLLOWED_FOR_S + SLACK_S,
        notes=tuple(notes),
    )


def _following(situation: Situation, height_m: float) -> CommandAlternatives:
    """Give the commands that make a vehicle follow the broker's target at a height above home."""
    family = situation.family
    if not family.follows_by_command:
        return family.follow_modes
    order = long_command(
        mavlink.MAV_CMD_DO_FOLLOW, situation.own_system, 0.0, 0.0, _FIXED_HEIGHT, height_m
    )
    return ((order,), *family.follow_modes)


def track(command: NavTrackSubject, situation: Situation) -> LiveAction:
    """Have the camera track the rectangle, or a point in its centre.

    The mode defines the motion of the vehicle: trace follows behind the subject, profile beside it,
    spotlight turns the nose to it, spotlight pro moves the gimbal only, and a quick shot flies one
    turn round it.
    """
    mode, family = command.parameters.track_mode, situation.family
    height_m = max(situation.relative_altitude_m, family.lowest_follow_m)
    moves = mode is not TrackMode.SPOTLIGHT_PRO
    camera = camera_of(family)
    (left, top), (right, bottom) = command.parameters.corners
    rectangle = long_command(
        mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE, left, top, right, bottom, component=camera
    )
    middle = ((left + right) / 2.0, (top + bottom) / 2.0)
    size = min(right - left, bottom - top) / 2.0
    point = long_command(mavlink.MAV_CMD_CAMERA_TRACK_POINT, *middle, size, component=camera)
    stop = stop_tracking(family)
    return LiveAction(
        begin=((rectangle,), (point,)),
        alternative_notes=("", "the camera tracks a point instead of a rectangle"),
        overrides=_borrowed(mode, situation, height_m),
        end=Tracked(
            mode=mode,
            duration_s=TRACKED_FOR_S,
            height_m=height_m,
            follow=_following(situation, height_m),
            maximum_speed_m_s=situation.maximum_speed_m_s,
        ),
        finish=(*((*hold, stop) for hold in family.holding), *family.holding)
        if moves
        else ((stop,),),
        within_s=TRACKED_FOR_S + SLACK_S,
        moves=moves,
        wants_camera=True,
    )


def stop_tracking(family: Family) -> CommandLong:
    """Have the camera track nothing."""
    return long_command(mavlink.MAV_CMD_CAMERA_STOP_TRACKING, component=camera_of(family))


def camera_of(family: Family) -> int | None:
    """Give the component that tracks; None: the autopilot."""
    return None if family.camera_is_autopilot else mavlink.MAV_COMP_ID_CAMERA


def _borrowed(mode: TrackMode, situation: Situation, height_m: float) -> ParameterOverrides:
    angle_deg = _ANGLES_DEG.get(mode)
    return () if angle_deg is None else _follow_overrides(situation, height_m, angle_deg)


def _follow_overrides(
    situation: Situation, height_m: float, angle_deg: float
) -> ParameterOverrides:
    """Give what a vehicle borrows to follow, also its speed, which no command limits then."""
    speed_m_s = situation.maximum_speed_m_s or None
    following = Following(height_m, angle_deg, situation.own_system, speed_m_s)
    return situation.family.follow_overrides(following)
