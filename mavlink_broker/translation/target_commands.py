"""Following a target and tracking a subject: both live, both end after a while."""

from typing import Final

from afarcloud.commands import NavFollowTarget, NavTrackSubject
from afarcloud.enumerations import FollowHeading
from mavlink_broker.dialect import mavlink
from mavlink_broker.protocol.command import long_command
from mavlink_broker.protocol.command_sequence import Ways
from mavlink_broker.translation.borrowed import BEHIND_DEG
from mavlink_broker.translation.families import Following
from mavlink_broker.translation.live import Lasted, LiveAction, reposition
from mavlink_broker.translation.situation import Situation, Spot

FOLLOWED_FOR_S: Final = 60.0
"""AFarCloud gives no end; an event may end it earlier."""
TRACKED_FOR_S: Final = 60.0
SLACK_S: Final = 120.0
_FIXED_HEIGHT: Final = 2.0  # Altitude mode of DO_FOLLOW
_CAMERA: Final[int] = mavlink.MAV_COMP_ID_CAMERA


def follow(command: NavFollowTarget, situation: Situation) -> LiveAction:
    """Follow a target that is told to the vehicle; where that is not known, go to its place."""
    p, family = command.parameters, situation.family
    height_m = max(p.altitude, family.lowest_follow_m)
    spot = Spot(p.latitude, p.longitude, height_m)
    order = long_command(
        mavlink.MAV_CMD_DO_FOLLOW, situation.own_system, 0.0, 0.0, _FIXED_HEIGHT, p.altitude
    )
    by_command: Ways = ((order,),) if family.following is Following.BY_COMMAND else ()
    ways = (*by_command, *family.follow_modes)
    lost = ["" for _ in ways]
    notes = []
    if height_m > p.altitude:
        notes.append(f"altitude: {family.name} follows no lower than {height_m:g} m")
    if p.heading is not FollowHeading.TOWARD_FOLLOW_POSITION:
        notes.append("heading: nobody steers it by hand, the nose points to the target")
    return LiveAction(
        begin=(*ways, (reposition(spot, situation.home),)),
        way_notes=(*lost, "the vehicle follows nothing: it waits at the target's place"),
        follow=spot,
        loans=family.follow_loans(height_m, BEHIND_DEG, situation.own_system),
        end=Lasted(FOLLOWED_FOR_S),
        finish=family.holding,
        within_s=FOLLOWED_FOR_S + SLACK_S,
        notes=tuple(notes),
    )


def track(command: NavTrackSubject, _situation: Situation) -> LiveAction:
    """Have the camera keep to what is inside the rectangle; a point in its middle will do too."""
    (left, top), (right, bottom) = command.parameters.corners
    rectangle = long_command(
        mavlink.MAV_CMD_CAMERA_TRACK_RECTANGLE, left, top, right, bottom, component=_CAMERA
    )
    middle = ((left + right) / 2.0, (top + bottom) / 2.0)
    size = min(right - left, bottom - top) / 2.0
    point = long_command(mavlink.MAV_CMD_CAMERA_TRACK_POINT, *middle, size, component=_CAMERA)
    stop = long_command(mavlink.MAV_CMD_CAMERA_STOP_TRACKING, component=_CAMERA)
    return LiveAction(
        begin=((rectangle,), (point,)),
        way_notes=("", "the camera tracks a point instead of a rectangle"),
        end=Lasted(TRACKED_FOR_S),
        finish=((stop,),),
        within_s=TRACKED_FOR_S + SLACK_S,
        moves=False,
    )
