"""Where in a stretch its speed is told, so that the vehicle flies at it; pure.

ArduCopter starts with its own speed at each leg behind a take-off, a circle or a live command
(`mode_auto.cpp`, `wp_start`). Until 4.5 it forgets there what was told before. Of the commands
between two legs the first is carried out before the next leg is started and all others after it,
so that a speed told twice holds on that leg in every version; a waypoint that it is at already is
over before the second, and so the speed is told behind the first waypoint once more.
"""

from dataclasses import replace

from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink import mission_item
from mavlink_broker.mavlink.dialect import mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.planning.situation import Items


def speed_items(speed_m_s: float, family: Family) -> tuple[MissionItem, ...]:
    """Give the items that tell a speed before a leg."""
    return (mission_item.change_speed(speed_m_s),) * (2 if family.starts_legs_anew else 1)


def with_speed(part: Items, speed_m_s: float, family: Family) -> Items:
    """Tell the speed of a stretch in its first part that flies: before all, or before its leg."""
    told = speed_items(speed_m_s, family)
    if not family.starts_legs_anew:
        return replace(part, items=(*told, *part.items), done=part.done + len(told))
    first, leg = _leg(part)
    is_waypoint = part.items[leg].command == mavlink.MAV_CMD_NAV_WAYPOINT
    again = told[:1] if is_waypoint else ()
    before, behind = part.items[:first], part.items[leg + 1 :]
    items = (*before, *told, *part.items[first : leg + 1], *again, *behind)
    done = part.done + len(told) + (len(again) if part.done > leg else 0)
    return replace(part, items=items, done=done)


def _leg(part: Items) -> tuple[int, int]:
    """Find the first item that is flown to, and where what belongs to it begins."""
    first = 0
    for number, item in enumerate(part.items):
        if item.command == mavlink.MAV_CMD_NAV_TAKEOFF:
            first = number + 1
        elif item.command <= mavlink.MAV_CMD_NAV_LAST:
            return first, number
    return 0, 0
