"""Take-off, waypoint, landing and home as mission items: one pure function each.

A field that a family does not support is left out; a note says so and becomes the command's
`message`.

Speed items are placed in a segment so that the vehicle flies at the speed. ArduCopter starts each
leg after a take-off, a circle or a live command with its own speed (`mode_auto.cpp`, `wp_start`).
Until 4.5 this resets a speed that was set before. Of the commands between two legs it executes the
first before the next leg starts and all others after it, so that a speed that is set twice holds on
that leg in every version. A waypoint at the vehicle's own position ends before the second, so the
speed is set once more after the first waypoint.

PX4 and ArduCopter limit the horizontal and the vertical speed of a leg separately, and keep its
direction (`PositionSmoothing.cpp`, clampToXYNorm and clampToZNorm; `SCurve.cpp`, kinematic_limit).
So the vector of a leg that climbs at the angle g is at most the horizontal limit over cos(g), and a
leg that climbs or descends gets a horizontal limit of maximum_speed cos(g). A vertical leg is
flown at the vehicle's own climb speed: no horizontal limit bounds it.
"""

import math
from dataclasses import replace
from typing import Final

from afarcloud.commands import NavHome, NavLand, NavTakeoff, NavWaypoint
from afarcloud.enumerations import PrecisionLandMode
from afarcloud.geodesy import distance_m
from afarcloud.route import Spot
from mavlink_broker.autopilots.families import Family
from mavlink_broker.autopilots.parameter_settings import (
    COPTER_RADIUS_M,
    ParameterOverrides,
    copter_radius,
)
from mavlink_broker.mavlink import mission_item
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.planning.situation import Items, Situation

_LEVEL: Final = 0.97
"""Cosine of the steepest leg, 14 degrees, that is flown at the level speed: 3 % faster at most."""
_VERTICAL_M: Final = 0.5
"""Legs of a shorter horizontal distance are vertical."""
_LOWEST_M_S: Final = 0.2
"""ArduCopter ignores a lower one (WPNAV_WP_SPEED_MIN)."""
_LEGS: Final = frozenset({mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LAND})


def speed_items(speed_m_s: float, family: Family) -> tuple[MissionItem, ...]:
    """Give the items that set a speed before a leg."""
    return (mission_item.change_speed(speed_m_s),) * (2 if family.resets_speed_each_leg else 1)


def with_speed(part: Items, speed_m_s: float, family: Family) -> Items:
    """Set the speed of a segment in its first part that flies: before all, or before its leg."""
    speed = speed_items(speed_m_s, family)
    if not family.resets_speed_each_leg:
        return replace(part, items=(*speed, *part.items), done=part.done + len(speed))
    first, leg = _leg(part)
    is_waypoint = part.items[leg].command == mavlink.MAV_CMD_NAV_WAYPOINT
    again = speed[:1] if is_waypoint else ()
    before, behind = part.items[:first], part.items[leg + 1 :]
    items = (*before, *speed, *part.items[first : leg + 1], *again, *behind)
    done = part.done + len(speed) + (len(again) if part.done > leg else 0)
    return replace(part, items=items, done=done)


def _leg(part: Items) -> tuple[int, int]:
    """Find the first navigation item after a take-off, and the first item that belongs to it."""
    first = 0
    for number, item in enumerate(part.items):
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            first = number + 1
        elif item.command <= mavlink.MAV_CMD_NAV_LAST:
            return first, number
    return 0, 0


def horizontal_share(start: Spot, end: Spot) -> float:
    """Give the share of the speed along a leg that is horizontal; 1 for one that is nearly level.

    It is 1 for a vertical leg too, because a horizontal limit does not bound it.
    """
    across_m = distance_m(*start[:2], *end[:2])
    if across_m < _VERTICAL_M:
        return 1.0
    cosine = across_m / math.hypot(across_m, end.relative_altitude_m - start.relative_altitude_m)
    return 1.0 if cosine >= _LEVEL else cosine


def horizontal_speed_m_s(speed_m_s: float, share: float) -> float:
    """Give the horizontal limit of a leg that is flown at a speed."""
    return max(speed_m_s * share, min(speed_m_s, _LOWEST_M_S))


class LegSpeeds:
    """Sets the horizontal speed of each leg of one segment.

    Which items are inserted does not depend on the speed: it may be changed while they are flown.
    """

    def __init__(self) -> None:
        self._speed_m_s: float | None = None  # Along a leg; None: not set yet
        self._share = 1.0  # Of it, that is set

    def bound(self, part: Items, start: Spot | None) -> Items:
        """Insert the speeds of the legs of a part that begins at a position, None: unknown."""
        items: list[MissionItem] = []
        done = part.done
        for number, item in enumerate(part.items):
            if item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
                self._speed_m_s, self._share = item.parameters[1], 1.0
            elif item.command in _LEGS:
                end = Spot(item.latitude_deg, item.longitude_deg, item.altitude_m)
                is_level = start is None or item.command == mavlink.MAV_CMD_NAV_LAND
                share = 1.0 if is_level or start is None else horizontal_share(start, end)
                if self._speed_m_s is not None and share != self._share:
                    self._share = share
                    speed_m_s = horizontal_speed_m_s(self._speed_m_s, share)
                    items.append(mission_item.change_speed(speed_m_s))
                    done += number <= part.done
                start = end
            elif item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
                start = Spot(item.latitude_deg, item.longitude_deg, item.altitude_m)
            elif item.command <= mavlink.MAV_CMD_NAV_LAST:
                start = None
            items.append(item)
        return replace(part, items=tuple(items), done=done)


_CLIMBS_UPRIGHT: Final = "minimum_pitch: a vehicle with rotors climbs upright"


def takeoff(command: NavTakeoff, situation: Situation) -> Items:
    """Climb, then fly to the position: a take-off climbs vertically.

    The waypoint exists even if the vehicle is at the position, so that the items do not depend on
    the vehicle's position: after a restart they must be the same.
    """
    p, family = command.parameters, situation.family
    place = {
        "latitude_deg": p.latitude,
        "longitude_deg": p.longitude,
        "relative_altitude_m": p.altitude,
    }
    yaw_deg = _item_yaw(p.yaw_angle, family)
    climb = mission_item.takeoff(**place, minimum_pitch_deg=p.minimum_pitch, yaw_deg=yaw_deg)
    go = mission_item.waypoint(**place, yaw_deg=yaw_deg)
    items = (climb, *_yaw_before(p.yaw_angle, family), go)
    spot = Spot(p.latitude, p.longitude, p.altitude)
    notes = (_CLIMBS_UPRIGHT,) if p.minimum_pitch != 0 else ()
    return Items(items, len(items) - 1, notes, spot, p.yaw_angle)


def waypoint(command: NavWaypoint, situation: Situation) -> Items:
    """Fly to the position, stay for the hold time."""
    p, family = command.parameters, situation.family
    notes = []
    if p.trajectory_control != 0:
        notes.append("trajectory_control is not supported and was left out")
    overrides, more = _radius(situation)
    notes += more
    if family.yaw_by_condition and p.hold_time % 1.0:
        notes.append(f"hold_time: {family.name} keeps whole seconds")
    go = mission_item.waypoint(
        latitude_deg=p.latitude,
        longitude_deg=p.longitude,
        relative_altitude_m=p.altitude,
        hold_s=p.hold_time,
        acceptance_radius_m=p.acceptance_radius if family.honours_acceptance_radius else 0.0,
        yaw_deg=_item_yaw(p.desired_yaw_angle, family),
    )
    items = (*_yaw_before(p.desired_yaw_angle, family), go)
    spot = Spot(p.latitude, p.longitude, p.altitude)
    return Items(
        items, len(items) - 1, tuple(notes), spot, p.desired_yaw_angle, overrides=overrides
    )


def land(command: NavLand, situation: Situation) -> Items:
    """Fly to the position and land there."""
    p, family = command.parameters, situation.family
    notes = []
    if p.minimum_target_altitude != 0 and not family.honours_abort_altitude:
        notes.append(f"minimum_target_altitude is not supported by {family.name} and was left out")
    precision = p.precision_land_mode
    if precision != PrecisionLandMode.DISABLED and not family.honours_precision_landing:
        notes.append(f"precision_land_mode is not supported by {family.name} and was left out")
        precision = PrecisionLandMode.DISABLED
    if p.landing_altitude != 0 and not family.honours_landing_altitude:
        notes.append(f"landing_altitude: {family.name} lands on the ground, however high it is")
    if p.minimum_target_altitude % 1.0 and family.honours_abort_altitude:
        notes.append(f"minimum_target_altitude: {family.name} keeps whole metres")
    down = mission_item.land(
        latitude_deg=p.latitude,
        longitude_deg=p.longitude,
        relative_altitude_m=p.landing_altitude,
        abort_altitude_m=p.minimum_target_altitude if family.honours_abort_altitude else 0.0,
        precision_mode=precision,
        yaw_deg=_item_yaw(p.desired_yaw_angle, family),
    )
    items = (*_yaw_before(p.desired_yaw_angle, family), down)
    return Items(items, len(items) - 1, tuple(notes), ends_on_ground=True)


def home(command: NavHome, situation: Situation) -> Items:
    """Return and land, or fly home at the mission's altitude; the mission ends in a hover."""
    if command.parameters.landing:
        return Items((mission_item.return_to_launch(),), 0, ends_on_ground=True)
    go = mission_item.waypoint(
        latitude_deg=situation.home.latitude_deg,
        longitude_deg=situation.home.longitude_deg,
        relative_altitude_m=situation.relative_altitude_m,
    )
    spot = Spot(go.latitude_deg, go.longitude_deg, go.altitude_m)
    return Items((replace(go, at_home=True),), 0, spot=spot, at_home=True)


def _radius(situation: Situation) -> tuple[ParameterOverrides, tuple[str, ...]]:
    """Override the acceptance radius where it is a parameter, if all waypoints have the same."""
    family, radius_m = situation.family, situation.common_radius_m
    if family.honours_acceptance_radius:
        return (), ()
    if radius_m is None:
        reason = "the mission's differ, and it has one for all"
        return (), (f"acceptance_radius: {family.name} uses its own: {reason}",)
    smallest, largest = COPTER_RADIUS_M
    if smallest <= radius_m <= largest:
        return copter_radius(radius_m), ()
    return copter_radius(radius_m), (f"acceptance_radius was limited to {largest:g} m",)


def _item_yaw(yaw_deg: float | None, family: Family) -> float | None:
    return None if family.yaw_by_condition else yaw_deg


def _yaw_before(yaw_deg: float | None, family: Family) -> tuple[MissionItem, ...]:
    if yaw_deg is None or not family.yaw_by_condition:
        return ()
    return (mission_item.condition_yaw(yaw_deg),)
