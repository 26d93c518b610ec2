"""A turn about a point: DO_ORBIT in flight, or LOITER_TURNS if the family has it as an item."""

import math
from dataclasses import replace
from typing import Final

from afarcloud.commands import NavHotpoint, NavHotpointParameters
from afarcloud.enumerations import OrbitType
from afarcloud.flyable import SLOWEST_TURN_DEG_S
from afarcloud.geodesy import offset, shifted
from afarcloud.route import Spot, start_point
from mavlink_broker.autopilots.families import Family, OrbitMethod
from mavlink_broker.autopilots.parameter_settings import copter_circle
from mavlink_broker.mavlink import mission_item
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.microservices.command import CommandInt
from mavlink_broker.planning.flight_commands import speed_items
from mavlink_broker.planning.situation import Circled, Items, LiveAction, Refusal, Situation, Turned

SPEED_MAX_M_S: Final = 10.0
ACCELERATION_MAX_M_S2: Final = 0.98 * 0.98 * 2.0
"""PX4 limits the acceleration on an orbit to 2 m/s^2; it always accepts a little less."""
COPTER_ACCELERATION_MAX_M_S2: Final = 1.25
"""ArduCopter uses half of WPNAV_ACCEL on a circle; its default is 2.5 m/s^2."""
SLACK_S: Final = 120.0
_ALWAYS_FLOWN: Final = frozenset(
    {
        OrbitType.ALONG_CIRCLE_LOOKING_BACKWARDS,
        OrbitType.AWAY_FROM_HOT_POINT,
        OrbitType.USING_INITIAL_HEADING,
    }
)
"""Headings that are flown from point to point if a vehicle's own orbit lacks them."""
_HARDLY_FASTER_DEG_S: Final = 0.5
_LOOKS: Final = frozenset({mavlink.MAV_CMD_DO_SET_ROI_LOCATION, mavlink.MAV_CMD_DO_SET_ROI_NONE})
"""For the gimbal: the circle's own options point the nose inwards."""
_FORWARDS: Final = 3.0  # ORBIT_YAW_BEHAVIOUR_HOLD_FRONT_TANGENT_TO_CIRCLE


def hotpoint(command: NavHotpoint, situation: Situation) -> Items | LiveAction | Refusal:
    """Fly one full turn, from the start point if there is one."""
    p = command.parameters
    if p.angular_velocity < SLOWEST_TURN_DEG_S:
        slow = f"a turn at {p.angular_velocity:g} deg/s takes longer than a day"
        return Refusal("angular_velocity", slow)
    wanted, p = p, _within_speed(p, situation.maximum_speed_m_s)
    part = _part(p, situation)
    return part if p is wanted else replace(part, notes=(_slowed(p), *part.notes))


def _part(p: NavHotpointParameters, situation: Situation) -> Items | LiveAction:
    manner = _manner(p, situation.family)
    if isinstance(manner, str):
        return _from_point_to_point(p, situation, manner)
    if manner is OrbitMethod.BY_ITEM:
        return _as_items(p, situation)
    return _live(p, situation)


def _within_speed(p: NavHotpointParameters, most_m_s: float) -> NavHotpointParameters:
    """Limit the turn to the mission's maximum speed; 0: the mission has none."""
    if most_m_s <= 0.0 or speed_on_circle_m_s(p.angular_velocity, p.radius) <= most_m_s:
        return p
    return p.model_copy(update={"angular_velocity": math.degrees(most_m_s / p.radius)})


def _slowed(p: NavHotpointParameters) -> str:
    return f"angular_velocity was limited to {p.angular_velocity:.1f} deg/s by maximum_speed"


def _manner(p: NavHotpointParameters, family: Family) -> OrbitMethod | str:
    """Give the method of a family, or the reason to fly from point to point."""
    if p.orbit_type in _ALWAYS_FLOWN and p.orbit_type not in family.orbit_headings:
        return (
            "orbit_type: flown from point to point, for "
            f"{family.name}'s own circle knows no such heading"
        )
    if _rate_deg_s(p) > family.circle_rate_max_deg_s + _HARDLY_FASTER_DEG_S:
        return (
            "angular_velocity: flown from point to point, for "
            f"{family.name}'s own circle turns by {family.circle_rate_max_deg_s:g} deg/s at most"
        )
    return family.orbiting


def speed_on_circle_m_s(angular_velocity_deg_s: float, radius_m: float) -> float:
    """Give the speed for the angular velocity, within the vehicle's limits on the circle [m/s]."""
    wanted = math.radians(angular_velocity_deg_s) * radius_m
    return min(wanted, SPEED_MAX_M_S, math.sqrt(ACCELERATION_MAX_M_S2 * radius_m))


def _rate_deg_s(p: NavHotpointParameters) -> float:
    """Give the angular velocity within these limits [deg/s]."""
    return math.degrees(speed_on_circle_m_s(p.angular_velocity, p.radius) / p.radius)


def _end_point(p: NavHotpointParameters, situation: Situation) -> Spot | None:
    """Give the end of a full turn: its start point, else the nearest point of the circle."""
    start, before = start_point(p), situation.spot
    if start is not None or before is None:
        return start
    north_m, east_m = offset(p.latitude, p.longitude, *before[:2])
    bearing_deg = math.degrees(math.atan2(east_m, north_m))
    return Spot(*shifted(p.latitude, p.longitude, bearing_deg, p.radius), p.orbit_altitude)


def _live(p: NavHotpointParameters, situation: Situation) -> LiveAction:
    speed_m_s = speed_on_circle_m_s(p.angular_velocity, p.radius)
    heading, notes = _heading(p.orbit_type, situation.family)
    counts = situation.family.orbiting is OrbitMethod.COUNTED
    orbit = CommandInt(
        command=mavlink.MAV_CMD_DO_ORBIT,
        parameters=(
            p.radius if p.is_clockwise else -p.radius,
            speed_m_s,
            heading,
            math.tau if counts else math.nan,
        ),
        latitude_deg=p.latitude,
        longitude_deg=p.longitude,
        altitude_m=situation.home.altitude_amsl_m + p.orbit_altitude,
    )
    return LiveAction(
        begin=((orbit,),),
        approach=start_point(p),
        approach_speed_m_s=situation.approach_speed_m_s,
        end=Turned(
            *(p.latitude, p.longitude, p.radius, math.tau),
            is_clockwise=p.is_clockwise,
            speed_m_s=speed_m_s,
        ),
        finish=situation.family.holding,
        within_s=2.0 * math.tau * p.radius / speed_m_s + SLACK_S,
        notes=(*_limited(p, speed_m_s), *notes),
        ends_at=_end_point(p, situation),
    )


def _from_point_to_point(p: NavHotpointParameters, situation: Situation, reason: str) -> LiveAction:
    """Fly the circle from point to point."""
    speed_m_s = speed_on_circle_m_s(p.angular_velocity, p.radius)
    return LiveAction(
        begin=situation.family.holding,
        approach=_end_point(p, situation),
        approach_speed_m_s=situation.approach_speed_m_s,
        end=Circled(
            turn=Turned(p.latitude, p.longitude, p.radius, math.tau, p.is_clockwise),
            height_m=p.orbit_altitude,
            speed_m_s=speed_m_s,
            heading=p.orbit_type,
        ),
        within_s=3.0 * math.tau * p.radius / speed_m_s + SLACK_S,
        notes=(*_limited(p, speed_m_s), reason),
        ends_at=_end_point(p, situation),
    )


def _as_items(p: NavHotpointParameters, situation: Situation) -> Items:
    """ArduPilot's circle; the nose points ahead, or to the centre by a ROI.

    It goes round no faster than it may fly: that alone makes it slower than 20 deg/s, for AUTO
    keeps the rate that it was switched on with (`AC_Circle.cpp`).
    """
    p, rounded = _kept(p)
    wanted_m_s = speed_on_circle_m_s(p.angular_velocity, p.radius)
    speed_m_s = min(wanted_m_s, math.sqrt(COPTER_ACCELERATION_MAX_M_S2 * p.radius))
    notes = [*_limited(p, speed_m_s), *rounded]
    inwards = p.orbit_type is OrbitType.TOWARDS_HOT_POINT
    centre = {"latitude_deg": p.latitude, "longitude_deg": p.longitude}
    circle = mission_item.turn(
        **centre,
        relative_altitude_m=p.orbit_altitude,
        radius_m=p.radius if p.is_clockwise else -p.radius,
    )
    before = []
    start = start_point(p)
    if start is not None:
        before.append(mission_item.waypoint(**start._asdict()))
    before.append(mission_item.change_speed(speed_m_s))
    behind = []
    if inwards and not situation.refused & _LOOKS:
        before.append(mission_item.look_at(**centre))
        behind.append(mission_item.look_ahead())
    elif not inwards and p.orbit_type is not OrbitType.ALONG_CIRCLE_LOOKING_FORWARDS:
        notes.append(f"orbit_type {p.orbit_type.name} is not supported: it looks forwards")
    behind += speed_items(situation.maximum_speed_m_s, situation.family)
    spot = _end_point(p, situation) or _north_of(p)
    rate_deg_s = math.degrees(speed_m_s / p.radius) * (1.0 if p.is_clockwise else -1.0)
    overrides = copter_circle(rate_deg_s, along=not inwards)
    return Items((*before, circle, *behind), len(before), tuple(notes), spot, overrides=overrides)


def _north_of(p: NavHotpointParameters) -> Spot:
    """Give a point of the circle: a vehicle is never sent to the centre."""
    return Spot(*shifted(p.latitude, p.longitude, 0.0, p.radius), p.orbit_altitude)


def _kept(p: NavHotpointParameters) -> tuple[NavHotpointParameters, tuple[str, ...]]:
    """Give the circle as ArduPilot stores it: whole metres of radius, beyond 255 m whole tens."""
    radius_m = _whole_m(p.radius)
    if radius_m == p.radius:
        return p, ()
    kept = p.model_copy(update={"radius": radius_m})
    return kept, (f"radius: the vehicle keeps {radius_m:g} m",)


def kept_radius_m(p: NavHotpointParameters, family: Family) -> float:
    """Give the radius at which a family's vehicles fly."""
    return _whole_m(p.radius) if _manner(p, family) is OrbitMethod.BY_ITEM else p.radius


def _whole_m(radius_m: float) -> float:
    step = 10.0 if radius_m > 255.0 else 1.0
    return math.floor(radius_m / step) * step


def _heading(wanted: OrbitType, family: Family) -> tuple[float, tuple[str, ...]]:
    value = family.orbit_headings.get(wanted)
    if value is not None:
        return value, ()
    return _FORWARDS, (f"orbit_type {wanted.name} is not supported: it looks forwards",)


def _limited(p: NavHotpointParameters, speed_m_s: float) -> tuple[str, ...]:
    flown_deg_s = math.degrees(speed_m_s / p.radius)
    if flown_deg_s >= p.angular_velocity * 0.999:
        return ()
    return (f"angular_velocity was limited to {flown_deg_s:.1f} deg/s",)
