"""Values that the information model's annex allows and no vehicle can be given as they are.

The annex prints ranges that do not fit their parameters: a precision-landing mode in metres, an
acceptance radius of zero, a rectangle in two small integers. A plan under the `annex` profile
may use them; each becomes the nearest thing that can be flown.
"""

from typing import Any, Final, TypeGuard

from afarcloud.enumerations import CommandType, PrecisionLandMode

SMALLEST_RADIUS_M: Final = 0.1
LARGEST_LAND_MODE: Final = 10
WHOLE_PICTURE: Final = [[0.0, 0.0], [1.0, 1.0]]


def import_annex_command(command: dict[str, Any]) -> None:
    """Replace such values in the command's parameters."""
    parameters = command.get("parameters")
    if not isinstance(parameters, dict):
        return
    match command.get("command_type_id"):
        case CommandType.NAV_WAYPOINT:
            radius = parameters.get("acceptance_radius")
            if _is_number(radius) and 0 <= radius < SMALLEST_RADIUS_M:
                parameters["acceptance_radius"] = SMALLEST_RADIUS_M
        case CommandType.NAV_LAND:
            mode = parameters.get("precision_land_mode")
            if _is_number(mode) and 0 <= mode <= LARGEST_LAND_MODE:
                parameters["precision_land_mode"] = _land_mode(mode)
        case CommandType.NAV_TRACK_SUBJECT:
            corners = parameters.get("corners")
            if isinstance(corners, list) and corners in ([0, 1], [1, 1], [0, 0], [1, 0]):
                parameters["corners"] = WHOLE_PICTURE


def _land_mode(number: float) -> int:
    """Any wish for precision that is no mode of MAVLink's is an opportunistic one."""
    modes = [mode.value for mode in PrecisionLandMode if mode.value == number]
    return modes[0] if modes else PrecisionLandMode.OPPORTUNISTIC.value


def _is_number(value: Any) -> TypeGuard[int | float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
