"""Take-off, waypoint, landing and home as mission items: one pure function each.

A field that a family does not support is left out; a note says so and becomes the command's
`message`.
"""

from dataclasses import replace
from typing import Final

from afarcloud.commands import NavHome, NavLand, NavTakeoff, NavWaypoint
from afarcloud.enumerations import PrecisionLandMode
from mavlink_broker.autopilots.families import Family
from mavlink_broker.autopilots.parameter_settings import (
    COPTER_RADIUS_M,
    ParameterOverrides,
    copter_radius,
)
from mavlink_broker.mavlink import mission_item
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.planning.situation import Items, Situation, Spot

_CLIMBS_UPRIGHT: Final = "minimum_pitch: a vehicle with rotors climbs upright"


def takeoff(command: NavTakeoff, situation: Situation) -> Items:
    """Climb, then fly to the position: on most autopilots a take-off climbs vertically.

    The waypoint exists even if the vehicle is at the position, so that the items do not depend on
    the vehicle's position: after a restart they must be the same.
    """
    p, family = command.parameters, situation.family
    place = {
        "latitude_deg": p.latitude,
        "longitude_deg": p.longitude,
        "relative_altitude_m": p.altitude,
    }
    climb = mission_item.takeoff(
        **place, minimum_pitch_deg=p.minimum_pitch, yaw_deg=_item_yaw(p.yaw_angle, family)
    )
    items = [climb]
    if family.takeoff_holds_position:
        go = mission_item.waypoint(**place, yaw_deg=_item_yaw(p.yaw_angle, family))
        items += [*_yaw_before(p.yaw_angle, family), go]
    spot = Spot(p.latitude, p.longitude, p.altitude)
    notes = (_CLIMBS_UPRIGHT,) if p.minimum_pitch != 0 else ()
    return Items(tuple(items), len(items) - 1, notes, spot, p.yaw_angle)


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
