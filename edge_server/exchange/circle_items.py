"""Items that circle or follow: one function each, joined by the table of `to_commands`."""

import math
from typing import Final

from afarcloud.enumerations import CommandType, StartPoint
from afarcloud.plan import DEFAULT_SPEED_M_S
from edge_server.exchange import orbits
from edge_server.exchange.mission_item import Item, Place
from edge_server.exchange.translation import Refusal, Translation, whole

MOST_TURNS: Final = 50
RATE_MAX_DEG_S: Final = 20.0  # At which a circle without one is flown


def orbit(state: Translation, item: Item) -> None:
    """DO_ORBIT: signed radius, speed, yaw behaviour, angle to fly."""
    radius, speed, behaviour, angle = item.parameters[:4]
    if not radius:
        raise Refusal("has no radius")
    kind = orbits.ORBIT_TYPE.get(whole(behaviour, "its yaw behaviour", 0))
    if kind is None:
        raise Refusal(f"has a yaw behaviour that no orbit_type has: {behaviour:g}")
    turns = (angle or 0.0) / math.tau
    named = {"orbit_type": int(kind)}
    if speed is not None:
        rate = orbits.angular_velocity_deg_s(speed, abs(radius))
        _circle(state, item, radius, turns, angular_velocity=rate, **named)
    else:
        _circle(state, item, radius, turns, **named)


def loiter_turns(state: Translation, item: Item) -> None:
    """NAV_LOITER_TURNS, as ArduPilot circles: turns and signed radius."""
    turns, _, radius, _ = item.parameters[:4]
    if not radius:
        raise Refusal("has no radius")
    speed = state.speed_m_s or DEFAULT_SPEED_M_S
    rate = min(math.degrees(speed / abs(radius)), RATE_MAX_DEG_S)
    _circle(state, item, radius, turns or 0.0, angular_velocity=math.floor(rate * 1e6) / 1e6)


def follow(state: Translation, item: Item) -> None:
    """A bare waypoint just before is the place where the target is first expected."""
    if state.place is None:
        raise Refusal("follows a target, but no item before it has a position")
    place = state.place
    if state.bare:
        state.take_back()
    heading = item.extra.get("heading", 0)
    state.add(item, CommandType.NAV_FOLLOW_TARGET, heading=heading, **place.as_parameters())


def _circle(
    state: Translation, item: Item, radius: float, turns: float, **parameters: float
) -> None:
    """Whole turns, one command each."""
    count = round(turns)
    if abs(turns - count) > 0.01 or not 1 <= count <= MOST_TURNS:
        raise Refusal(f"must be 1 to {MOST_TURNS} whole turns")
    centre = state.place_of(item, state.place)
    start = _take_beginning(state, centre, abs(radius))
    for number in range(count):
        state.add(
            item,
            CommandType.NAV_HOTPOINT,
            latitude=centre.latitude_deg,
            longitude=centre.longitude_deg,
            orbit_altitude=centre.relative_altitude_m,
            radius=abs(radius),
            is_clockwise=radius > 0.0,
            start_point=int(StartPoint.NEAREST if number else start),
            **parameters,
        )
    state.has_flown = True


def _take_beginning(state: Translation, centre: Place, radius_m: float) -> StartPoint:
    """A bare waypoint on the circle, just before, is the place where it begins."""
    start = None
    if state.bare and state.place is not None:
        start = orbits.start_point(centre, radius_m, state.place)
    if start is None:
        return StartPoint.NEAREST
    state.take_back()
    return start
