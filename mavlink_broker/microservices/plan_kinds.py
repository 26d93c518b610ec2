"""The three kinds of plan that a vehicle holds, by MAV_MISSION_TYPE; each has its own transfers."""

from typing import Final

from mavlink_broker.mavlink.dialect import mavlink

MISSION: Final[int] = mavlink.MAV_MISSION_TYPE_MISSION
FENCE: Final[int] = mavlink.MAV_MISSION_TYPE_FENCE
RALLY: Final[int] = mavlink.MAV_MISSION_TYPE_RALLY

PLAN_NAMES: Final = {MISSION: "mission", FENCE: "geofence", RALLY: "rally points"}
ID_NAMES: Final = {MISSION: "mission_id", FENCE: "fence_id", RALLY: "rally_points_id"}
"""Where MISSION_CURRENT tells the id of each."""
