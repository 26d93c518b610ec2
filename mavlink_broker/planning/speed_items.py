"""Places the speed items in a segment so that the vehicle flies at the speed; pure.

ArduCopter starts each leg after a take-off, a circle or a live command with its own speed
(`mode_auto.cpp`, `wp_start`). Until 4.5 this resets a speed that was set before. Of the commands
between two legs it executes the first before the next leg starts and all others after it, so that
a speed that is set twice holds on that leg in every version. A waypoint at the vehicle's own
position ends before the second, so the speed is set once more after the first waypoint.
"""

from dataclasses import replace

from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink import mission_item
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.planning.situation import Items


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
