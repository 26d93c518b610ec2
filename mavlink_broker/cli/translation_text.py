"""A translated mission as text: a table per stretch, a paragraph per live command."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

from afarcloud.plan import Mission
from mavlink_broker.cli.translation_json import command_lists, end_sentence, items
from mavlink_broker.microservices.command import CommandAlternatives
from mavlink_broker.planning.mission import FlightPlan, Itinerary, LiveCommand
from mavlink_broker.planning.situation import Spot

_FRAMES: Final = {0: "0 above sea", 2: "2 none", 6: "6 above home"}
_HEADER: Final = (
    *("seq", "command", "frame", "p1", "p2", "p3", "p4", "x", "y", "z"),
    "command_id",
)
_E7: Final = 1e7


def mission_lines(mission: Mission, itinerary: Itinerary) -> Iterator[str]:
    """Give the lines of one mission."""
    count = len(itinerary.segments)
    for number, segment in enumerate(itinerary.segments, 1):
        yield ""
        if isinstance(segment, FlightPlan):
            yield f"part {number} of {count}: mission items"
            yield from _stretch(segment, mission)
        else:
            command = mission.command_array[segment.command]
            name = command.command_type_id.name
            yield f"part {number} of {count}: command {command.command_id} ({name}), live"
            yield from _live(segment)
    yield from _notes(mission, itinerary)


def _stretch(plan: FlightPlan, mission: Mission) -> Iterator[str]:
    rows = [
        _row(item, mission.command_array[owner].command_id)
        for item, owner in zip(items(plan), plan.command_of_item, strict=True)
    ]
    widths = [max(len(row[i]) for row in (_HEADER, *rows)) for i in range(len(_HEADER))]
    for row in (_HEADER, *rows):
        yield "  " + "  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip()


def _row(item: dict[str, Any], command_id: int) -> Sequence[str]:
    has_place = item["frame"] != 2
    return (
        str(item["seq"]),
        f"{item['name']} ({item['command']})",
        _FRAMES.get(item["frame"], str(item["frame"])),
        *(_number(item[f"param{i}"]) for i in range(1, 5)),
        *(f"{item[a] / _E7:.7f}" if has_place else str(item[a]) for a in ("x", "y")),
        _number(item["z"]),
        str(command_id),
    )


def _live(live: LiveCommand) -> Iterator[str]:
    action = live.action
    if action.approach is not None:
        yield f"  first  to {_place(action.approach)}"
    if action.follow is not None:
        yield f"  target {_place(action.follow)}, sent 5 times a second"
    yield from _alternatives("begin ", action.begin, action.alternative_notes)
    yield f"  lasts  {end_sentence(action.end)}"
    yield from _alternatives("finish", action.finish, ())


def _alternatives(
    title: str, alternatives: CommandAlternatives, notes: Sequence[str]
) -> Iterator[str]:
    for number, alternative in enumerate(command_lists(alternatives)):
        lost = notes[number] if number < len(notes) else ""
        behind = f"  [{lost}]" if lost else ""
        for step, command in enumerate(alternative):
            label = title if number == step == 0 else "or    " if step == 0 else "then  "
            yield f"  {label} {_command(command)}{behind}"


def _command(command: dict[str, Any]) -> str:
    last = (
        ("x", "y", "z") if command["message"] == "COMMAND_INT" else ("param5", "param6", "param7")
    )
    names = (*(f"param{i}" for i in range(1, 5)), *last)
    values = " ".join(_number(command[name]) for name in names)
    return f"{command['message']} {command['name']} ({command['command']}): {values}"


def _notes(mission: Mission, itinerary: Itinerary) -> Iterator[str]:
    noted = [
        (command, notes)
        for command, notes in zip(mission.command_array, itinerary.notes, strict=True)
        if notes
    ]
    if noted:
        yield ""
        yield "notes"
    for command, notes in noted:
        for note in notes:
            yield f"  command {command.command_id} ({command.command_type_id.name}): {note}"


def _place(spot: Spot) -> str:
    height = f"{spot.relative_altitude_m:g} m above home"
    return f"{spot.latitude_deg:.7f}, {spot.longitude_deg:.7f}, {height}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.8g}"
