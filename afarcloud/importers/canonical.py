"""Brings a parsed document to the canonical spelling; the types then validate it.

The ranges that the information model's annex prints do not fit all parameters: a precision-landing
mode in metres, an acceptance radius of zero, a rectangle in two small integers. A plan under the
`annex` profile may use them; each becomes the nearest value that a vehicle can fly.
"""

from typing import Any, Final, TypeGuard

from afarcloud.enumerations import CommandType, PrecisionLandMode
from afarcloud.importers.document import Imported
from afarcloud.importers.positions import import_command, import_event
from afarcloud.importers.spellings import SPELLINGS

DEEPEST: Final = 20
"""Deeper than any document of AFarCloud."""
SMALLEST_RADIUS_M: Final = 0.1
LARGEST_LAND_MODE: Final = 10
WHOLE_PICTURE: Final = [[0.0, 0.0], [1.0, 1.0]]


def import_plan(body: Any) -> Imported:
    """Import a bare plan; what is no plan at all is left to the types."""
    imported = import_names(body)
    plan = imported.document
    missions = plan.get("missions") if isinstance(plan, dict) else None
    for path, command in _commands(missions):
        import_command(command, path, imported)
        if plan.get("profile") == "annex":
            import_annex_command(command)
    return imported


def import_event_document(body: Any) -> Imported:
    """Import a bare event."""
    imported = import_names(body)
    if isinstance(imported.document, dict):
        import_event(imported.document, imported)
    return imported


def import_names(body: Any) -> Imported:
    """Import any document: misprinted names become the right ones."""
    imported = Imported(None)
    imported.document = _renamed(body, "", imported, DEEPEST)
    return imported


def _renamed(value: Any, path: str, imported: Imported, depth: int) -> Any:
    if depth == 0:
        imported.refuse(path.removesuffix("."), "nests too deep")
        return None
    if isinstance(value, list):
        return [
            _renamed(one, f"{path}{index}.", imported, depth - 1) if _is_tree(one) else one
            for index, one in enumerate(value)
        ]
    if not isinstance(value, dict):
        return value
    members: dict[str, Any] = value
    renamed: dict[str, Any] = {}
    for sent, one in members.items():
        name = SPELLINGS.get(sent, sent)
        if name != sent and name in value:
            imported.refuse(f"{path}{sent}", f"means the same as {name}: give one of them")
            continue
        if name != sent:
            imported.rename(f"{path}{name}", f"{path}{sent}")
        renamed[name] = (
            _renamed(one, f"{path}{name}.", imported, depth - 1) if _is_tree(one) else one
        )
    return renamed


def _is_tree(value: Any) -> bool:
    return isinstance(value, (dict, list))


def _commands(missions: Any) -> list[tuple[str, dict[str, Any]]]:
    """Every command that is at least an object, with its path."""
    found = []
    for index, mission in enumerate(missions if isinstance(missions, list) else []):
        commands = mission.get("command_array") if isinstance(mission, dict) else None
        for position, command in enumerate(commands if isinstance(commands, list) else []):
            if isinstance(command, dict):
                found.append((f"missions.{index}.command_array.{position}", command))
    return found


def import_annex_command(command: dict[str, Any]) -> None:
    """Replace values that only the annex allows in the command's parameters."""
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
    """Return the mode of this number; a number that MAVLink does not define is opportunistic."""
    modes = [mode.value for mode in PrecisionLandMode if mode.value == number]
    return modes[0] if modes else PrecisionLandMode.OPPORTUNISTIC.value


def _is_number(value: Any) -> TypeGuard[int | float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
