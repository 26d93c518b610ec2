"""What single kinds of mission items may ask for: pure.

Each rule takes an item, the whole mission, home and the parameters, and gives a rejection or
None. The mission is not there yet while an item is judged as it comes in.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final

from uav_firmware.lib.payload_rules import GIMBAL_DEVICE, fault_of
from uav_firmware.modules.navigator.mission.route import PAYLOAD, unset
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.msg.mission import (
    MissionCommand,
    MissionItem,
    MissionRejection,
    MissionResult,
)
from uav_firmware.msg.status import HomePosition

ROI_LOCATION = 3.0  # MAV_ROI_LOCATION

_PARAMETER: Final = (
    MissionResult.INVALID_PARAM1,
    MissionResult.INVALID_PARAM2,
    MissionResult.INVALID_PARAM3,
    MissionResult.INVALID_PARAM4,
    MissionResult.INVALID_PARAM5_X,
    MissionResult.INVALID_PARAM6_Y,
    MissionResult.INVALID_PARAM7,
)
Check = Callable[
    [MissionItem, Sequence[MissionItem], HomePosition | None, NavigatorParams],
    MissionRejection | None,
]


def name_of(item: MissionItem) -> str:
    """Number and command of an item, for sentences."""
    try:
        return f"item {item.seq} ({MissionCommand(item.command).name})"
    except ValueError:
        return f"item {item.seq} (command {item.command})"


def reject(item: MissionItem, parameter: int, reason: str) -> MissionRejection:
    """Refuse a parameter of an item, counted from 1."""
    return MissionRejection(
        item.seq, _PARAMETER[parameter - 1], f"{name_of(item)}: parameter {parameter} {reason}"
    )


def _hold_and_radius(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    timed = {
        MissionCommand.NAV_WAYPOINT,
        MissionCommand.NAV_LOITER_TIME,
        MissionCommand.NAV_LAND,
    }
    if item.command in timed and item.param1 < 0.0:
        return reject(item, 1, "is negative")
    if item.command == MissionCommand.NAV_DELAY and not item.param1 >= 0.0:
        return reject(item, 1, "must be a delay in seconds; a time of day is not supported")
    if item.command == MissionCommand.NAV_WAYPOINT and item.param2 < 0.0:
        return reject(item, 2, "is negative")
    if item.command == MissionCommand.NAV_LAND and item.param2 not in {0.0, 1.0}:
        return None if math.isnan(item.param2) else reject(item, 2, "asks for a landing target")
    return None


def _circle(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    if item.command != MissionCommand.NAV_LOITER_TURNS:
        return None
    if not item.param1 > 0.0:
        return reject(item, 1, f"is {item.param1:g}, no number of turns")
    if not unset(item.param3) and not 1.0 <= abs(item.param3) <= 1000.0:
        return reject(item, 3, f"is a radius of {item.param3:g} m, not within 1 to 1000")
    return None


def _condition(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    waits = {MissionCommand.CONDITION_DELAY, MissionCommand.CONDITION_DISTANCE}
    if item.command in waits and not item.param1 >= 0.0:
        return reject(item, 1, f"is {item.param1:g}, nothing to wait for")
    if item.command != MissionCommand.CONDITION_YAW:
        return None
    if not abs(item.param1) <= 360.0:
        return reject(item, 1, f"is {item.param1:g}, no angle")
    if item.param2 < 0.0:
        return reject(item, 2, "is negative")
    for number, value, allowed in (
        (3, item.param3, (-1.0, 0.0, 1.0)),
        (4, item.param4, (0.0, 1.0)),
    ):
        if not math.isnan(value) and value not in allowed:
            return reject(item, number, f"is {value:g}")
    return None


def _mode_of_home_and_roi(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    if item.command == MissionCommand.DO_SET_HOME and item.param1 not in {0.0, 1.0}:
        return reject(item, 1, f"is {item.param1:g}, neither 0 nor 1")
    if item.command == MissionCommand.DO_SET_HOME and item.param1 == 0.0 and math.isnan(item.z):
        return reject(item, 7, "holds no altitude")
    if item.command == MissionCommand.DO_SET_ROI and not (
        unset(item.param1) or item.param1 == ROI_LOCATION
    ):
        return reject(item, 1, f"is {item.param1:g}: only 0 (none) and 3 (a place) are supported")
    return None


def _fence(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    if item.command != MissionCommand.DO_FENCE_ENABLE or item.param1 in {0.0, 1.0}:
        return None
    if item.param1 == 2.0:
        return reject(item, 1, "is 2, but the geofence has no floor to switch off")
    return reject(item, 1, f"is {item.param1:g}, neither 0 nor 1")


def _payload(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    """What camera and gimbal can honour; a place to look at may name the one gimbal."""
    if item.command in {MissionCommand.DO_SET_ROI_LOCATION, MissionCommand.DO_SET_ROI_NONE}:
        known = unset(item.param1) or item.param1 == GIMBAL_DEVICE
        return None if known else reject(item, 1, f"is {item.param1:g}, no gimbal")
    if item.command not in PAYLOAD:
        return None
    fault = fault_of(item.command, item[5:12])
    return None if fault is None else reject(item, fault.parameter, fault.reason)


def _speed(
    item: MissionItem, _items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    if item.command != MissionCommand.DO_CHANGE_SPEED:
        return None
    if not math.isnan(item.param1) and item.param1 not in {0.0, 1.0, 2.0, 3.0}:
        return reject(item, 1, f"is {item.param1:g}, no speed type")
    if not (item.param2 > 0.0 or item.param2 in {-1.0, -2.0}):
        return reject(item, 2, f"is {item.param2:g}, no speed")
    if item.param3 > 0.0:
        return reject(item, 3, "asks for a throttle, which a multirotor has not")
    return None


def _jump(
    item: MissionItem, items: Sequence[MissionItem], _home: object, _params: object
) -> MissionRejection | None:
    if item.command != MissionCommand.DO_JUMP:
        return None
    if item.param1 not in range(len(items)):
        return reject(item, 1, f"is {item.param1:g}, no item of this mission")
    if not item.param2 >= -1.0 or item.param2 != int(item.param2):
        return reject(item, 2, f"is {item.param2:g}, no number of repetitions")
    between = items[int(item.param1) : item.seq]
    takes_time = any(other.command < MissionCommand.NAV_DELAY + 1 for other in between)
    if int(item.param1) <= item.seq and not takes_time:
        return reject(item, 1, "jumps over nothing that is flown")
    return None


RULES: Final[tuple[Check, ...]] = (
    _hold_and_radius,
    _circle,
    _condition,
    _mode_of_home_and_roi,
    _fence,
    _payload,
    _speed,
)
"""Rules about an item by itself."""

PLAN_RULES: Final[tuple[Check, ...]] = (_jump,)
"""Rules about an item among the others."""
