"""Items that move the vehicle: one function each, joined by the table of `to_commands`."""

from typing import Final

from afarcloud.enumerations import CommandType
from edge_server.exchange.mission_item import Item, Place
from edge_server.exchange.payload_items import pictures_on_the_way
from edge_server.exchange.translation import Refusal, Translation, unset, whole

SAME_PLACE_M: Final = 0.05


def takeoff(state: Translation, item: Item) -> None:
    """NAV_TAKEOFF: minimum pitch, heading, place; without one, at home."""
    place = state.place_of(item, state.home)
    state.add(
        item,
        CommandType.NAV_TAKEOFF,
        minimum_pitch=item.parameters[0] or 0.0,
        yaw_angle=state.heading_of(item.parameters[3]),
        **place.as_parameters(),
    )
    state.place = place


def waypoint(state: Translation, item: Item) -> None:
    """NAV_WAYPOINT: hold, acceptance radius, pass radius, heading, place."""
    hold, radius, control, yaw = item.parameters[:4]
    heading = state.heading_of(yaw)
    _go(state, item, state.place_of(item), hold or 0.0, heading, radius, control)
    state.bare = unset(hold, radius, control) and heading is None


def gate(state: Translation, item: Item) -> None:
    """CONDITION_GATE: a waypoint that is passed."""
    _go(state, item, state.place_of(item))


def loiter_time(state: Translation, item: Item) -> None:
    """NAV_LOITER_TIME: a waypoint with a hold; at home without one, a hover there."""
    hold = item.parameters[0] or 0.0
    place = state.place_of(item, state.place)
    if hold == 0.0 and _is_home(state, place):
        _hover_at_home(state, item, place)
    else:
        _go(state, item, place, hold)


def loiter_for_ever(state: Translation, item: Item) -> None:
    """The end of a mission that does not land."""
    place = state.place_of(item, state.place)
    if _is_home(state, place):
        _hover_at_home(state, item, place)
    elif state.place is None or state.place.distance_m(place) > SAME_PLACE_M:
        _go(state, item, place)
    state.hold = item


def return_home(state: Translation, item: Item) -> None:
    """NAV_RETURN_TO_LAUNCH."""
    state.add(item, CommandType.NAV_HOME, landing=True)
    state.has_flown = True


def land(state: Translation, item: Item) -> None:
    """NAV_LAND: abort altitude, precision, heading, place; without one, here."""
    abort_altitude, precision, _, yaw = item.parameters[:4]
    place = state.place_of(item, state.place)
    state.add(
        item,
        CommandType.NAV_LAND,
        minimum_target_altitude=abort_altitude or 0.0,
        precision_land_mode=whole(precision, "its precision", 0),
        desired_yaw_angle=state.heading_of(yaw),
        latitude=place.latitude_deg,
        longitude=place.longitude_deg,
        landing_altitude=place.relative_altitude_m,
    )
    state.place, state.has_flown = place, True


def speed(state: Translation, item: Item) -> None:
    """DO_CHANGE_SPEED: the whole mission has one."""
    kind, speed, throttle, relative = item.parameters[:4]
    if kind not in {None, 0.0, 1.0}:
        raise Refusal("is about climbing or descending; a plan has one maximum_speed")
    if throttle not in {None, 0.0, -1.0} or relative not in {None, 0.0}:
        raise Refusal("sets a throttle or a difference; a plan has one maximum_speed")
    if speed is None or speed <= 0.0:
        raise Refusal("has no speed above 0")
    if (state.has_flown or state.is_speed_set) and speed != state.speed_m_s:
        raise Refusal("changes the speed on the way; a plan has one maximum_speed")
    state.speed_m_s, state.is_speed_set = speed, True


def turn(state: Translation, item: Item) -> None:
    """CONDITION_YAW: the heading at the place that follows."""
    if item.parameters[3]:
        raise Refusal("turns by an angle, not to a heading")
    state.heading = item, (item.parameters[0] or 0.0) % 360.0


def delay(state: Translation, item: Item) -> None:
    """NAV_DELAY: a longer hold at the waypoint before."""
    seconds, *moment = item.parameters[:4]
    if seconds is None or seconds < 0.0 or any(one not in {None, 0.0, -1.0} for one in moment):
        raise Refusal("waits for a time of day, which no command does")
    last = state.commands[-1] if state.commands else None
    if last is not None and last["command_type_id"] == CommandType.NAV_WAYPOINT:
        last["parameters"]["hold_time"] += seconds
        state.bare = False
    elif state.place is not None:
        _go(state, item, state.place, seconds)
    else:
        raise Refusal("waits before there is a place to wait at")


def _go(
    state: Translation,
    item: Item,
    place: Place,
    hold_s: float = 0.0,
    heading: float | None = None,
    radius: float | None = None,
    control: float | None = None,
) -> None:
    pictures_on_the_way(state, item, place)
    named = {"acceptance_radius": radius} if radius else {}
    state.add(
        item,
        CommandType.NAV_WAYPOINT,
        hold_time=hold_s,
        trajectory_control=control or 0.0,
        desired_yaw_angle=heading,
        **named,
        **place.as_parameters(),
    )
    state.place, state.has_flown = place, True


def _is_home(state: Translation, place: Place) -> bool:
    if state.home is None:
        return False
    home = Place(state.home.latitude_deg, state.home.longitude_deg, 0.0)
    return home.distance_m(place) <= SAME_PLACE_M


def _hover_at_home(state: Translation, item: Item, place: Place) -> None:
    state.add(item, CommandType.NAV_HOME, landing=False)
    state.place, state.has_flown = place, True
