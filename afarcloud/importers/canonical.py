"""Brings a parsed document to the canonical spelling; the types then validate it."""

from typing import Any, Final

from afarcloud.importers.annex_values import import_annex_command
from afarcloud.importers.document import Imported
from afarcloud.importers.positions import import_command, import_event
from afarcloud.importers.spellings import SPELLINGS

DEEPEST: Final = 20
"""Deeper than any document of ours."""


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
            imported.refuse(f"{path}{sent}", f"says the same as {name}: give one of them")
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
