"""`QGC WPL 110`: a mission as lines of twelve numbers. Pure.

Columns: sequence, current, frame, command, four parameters, latitude, longitude, altitude,
autocontinue. ArduPilot's tools put home into the first row, above mean sea level. The format has
no way to leave a heading open but NaN, and those tools write 0 for it, so 0 is read as open.
"""

import math
import re
from collections.abc import Iterator, Sequence
from typing import Final

from afarcloud.faults import Fault, InvalidError
from edge_server.exchange.mission_item import ABSOLUTE, Cmd, Frame, Home, Item, MissionFile

HEADER: Final = re.compile(r"QGC\s+WPL\s+(\d+)\s*")
VERSION: Final = "110"
COLUMNS: Final = 12
_NUMBER: Final = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?|nan", re.IGNORECASE)
_WHOLE: Final = re.compile(r"\d{1,5}(\.0+)?")
_FARTHEST: Final = 1e9


def is_waypoint_list(raw: bytes) -> bool:
    """Whether bytes begin as such a file does."""
    return raw.removeprefix(b"\xef\xbb\xbf").lstrip()[:3].upper() == b"QGC"


def read(raw: bytes) -> MissionFile:
    """Read a file.

    Raises:
        InvalidError: naming each line that is none, and why.
    """
    lines = _lines(raw)
    first = next(lines, (1, ""))[1]
    found = HEADER.fullmatch(first)
    if found is None or found[1] != VERSION:
        raise InvalidError((Fault("line.1", f"must be: QGC WPL {VERSION}"),))
    rows: list[Item] = []
    faults = []
    for number, line in lines:
        try:
            rows.append(_row(line, len(rows), f"line.{number}"))
        except ValueError as error:
            faults.append(Fault(f"line.{number}", str(error)))
    if faults:
        raise InvalidError(tuple(faults))
    home = _home(rows)
    return MissionFile(rows if home is None else rows[1:], home, zero_yaw_is_unset=True)


def _lines(raw: bytes) -> Iterator[tuple[int, str]]:
    """Lines that are not empty, with their number."""
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidError((Fault("", f"is not UTF-8 at byte {error.start}"),)) from None
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line.strip()


def _row(line: str, index: int, path: str) -> Item:
    """Read a line; raises ValueError with the reason."""
    numbers = line.split()
    if len(numbers) != COLUMNS:
        raise ValueError(f"must have {COLUMNS} columns, not {len(numbers)}")
    sequence, _, frame, command = (_whole(numbers[place]) for place in range(4))
    if sequence != index:
        raise ValueError(f"must be number {index}: the numbers run from 0 without gaps")
    return Item(
        path=path,
        number=index,
        command=command,
        frame=frame,
        parameters=tuple(_number(column) for column in numbers[4:11]),
        auto_continue=_whole(numbers[11]) != 0,
    )


def _whole(text: str) -> int:
    if _WHOLE.fullmatch(text) is None:
        raise ValueError("must have whole numbers for sequence, current, frame, command, continue")
    return int(float(text))


def _number(text: str) -> float | None:
    """A parameter; NaN is none."""
    if _NUMBER.fullmatch(text) is None:
        raise ValueError("must have numbers for parameters and place")
    value = float(text)
    if math.isnan(value):
        return None
    if abs(value) > _FARTHEST:
        raise ValueError("has a number that is out of all range")
    return value


def _home(rows: list[Item]) -> Home | None:
    """Home out of the first row, when that is what it is: nothing of it is flown.

    Some tools write it in a frame above home, where its height has no meaning; a waypoint before
    the take-off can be nothing else.
    """
    if not rows or rows[0].command != Cmd.NAV_WAYPOINT:
        return None
    is_absolute = rows[0].frame in ABSOLUTE
    takes_off_next = len(rows) > 1 and rows[1].command == Cmd.NAV_TAKEOFF
    latitude, longitude, altitude = rows[0].parameters[4:]
    if latitude is None or longitude is None or not (is_absolute or takes_off_next):
        return None
    return Home(latitude, longitude, altitude if is_absolute else None)


def write(items: Sequence[Item], home: Home) -> str:
    """Write a file that ArduPilot's tools and QGroundControl open, home in its first row.

    What is not set is written as 0, as those tools do; fence, rally points and what an item has
    beside its numbers have no place in this format.
    """
    place = (home.latitude_deg, home.longitude_deg, home.altitude_amsl_m)
    rows = [_columns(0, 1, Frame.GLOBAL, Cmd.NAV_WAYPOINT, (0.0, 0.0, 0.0, 0.0, *place))]
    for number, item in enumerate(items, start=1):
        rows.append(_columns(number, 0, item.frame, item.command, item.parameters))
    return "\n".join((f"QGC WPL {VERSION}", *rows, ""))


def _columns(
    number: int, current: int, frame: int, command: int, parameters: Sequence[float | None]
) -> str:
    *first, latitude, longitude, altitude = (one or 0.0 for one in parameters)
    places = [f"{latitude:.8f}", f"{longitude:.8f}", f"{altitude:.6f}"]
    numbers = [str(int(one)) for one in (number, current, frame, command)]
    return "\t".join([*numbers, *(f"{one:.8f}" for one in first), *places, "1"])
