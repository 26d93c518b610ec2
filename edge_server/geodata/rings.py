"""Polygons of any file to boundaries of fields, with the path of each in the file."""

from collections.abc import Sequence
from typing import Final, NamedTuple, TypeAlias

from afarcloud.faults import Fault, InvalidError
from afarcloud.plan import Vertex
from afarcloud.wire import read_as
from edge_server.geodata.field import Field, check

Ring: TypeAlias = tuple[str, list[Vertex]]
"""Its path in the file, and its corners without the repeated first."""
LONGEST_NAME: Final = 255
MOST_FIELDS: Final = 100
"""Of one file."""
MOST_RINGS: Final = 101
"""Of one polygon."""


class Boundary(NamedTuple):
    """A field of a file, and its path in the file."""

    path: str
    field: Field


class FieldFile(NamedTuple):
    """The fields of a file, and what of it is no area: a point, a line, something without place."""

    boundaries: list[Boundary]
    left_out: tuple[Fault, ...] = ()


class NoAreaError(InvalidError):
    """A part of a file that is no area. It is left out where the file has one."""


def refusal(path: str, message: str) -> InvalidError:
    """Make the error of a file of which one part is wrong."""
    return InvalidError((Fault(path, message),))


def field_file(
    boundaries: list[Boundary], left_out: Sequence[Fault], faults: Sequence[Fault]
) -> FieldFile:
    """Give what was read of a file.

    Raises:
        InvalidError: if an area of it is wrong, or if it has none.
    """
    if faults or not boundaries:
        raise InvalidError(tuple(faults) or tuple(left_out))
    return FieldFile(boundaries, tuple(left_out))


def fields_of(
    name: str | None,
    polygons: Sequence[tuple[str, Sequence[Ring]]],
    exclusions: Sequence[Ring],
    entry: tuple[str, Vertex] | None = None,
) -> list[Boundary]:
    """Make one field of each polygon; several of one name are numbered.

    An entry has its path in the file, like a ring.

    Raises:
        InvalidError: if a polygon is no boundary, at its place in the file; or if there are
            more than one file may have.
    """
    if len(polygons) > MOST_FIELDS:
        raise InvalidError((Fault(polygons[0][0], f"is of more than {MOST_FIELDS} polygons"),))
    found = []
    for number, (path, rings) in enumerate(polygons, start=1):
        title = name if name is None or len(polygons) == 1 else _numbered(name, number)
        found.append(Boundary(path, _field(title, rings, exclusions, entry)))
    return found


def _numbered(name: str, number: int) -> str:
    return f"{name[: LONGEST_NAME - 8]} {number}"


def _field(
    name: str | None,
    rings: Sequence[Ring],
    exclusions: Sequence[Ring],
    entry: tuple[str, Vertex] | None,
) -> Field:
    outer, *holes = rings
    document = {
        "name": None if name is None else name[:LONGEST_NAME],
        "boundary": outer[1],
        "holes": [corners for _, corners in holes],
        "exclusions": [corners for _, corners in exclusions],
        "entry": None if entry is None else entry[1],
    }
    try:
        field = read_as(Field, document)
        check(field)
    except InvalidError as error:
        places = {"boundary": outer[0]}
        places |= {f"holes.{index}": path for index, (path, _) in enumerate(holes)}
        places |= {f"exclusions.{index}": path for index, (path, _) in enumerate(exclusions)}
        places |= {} if entry is None else {"entry": entry[0]}
        raise InvalidError(tuple(_placed(fault, places) for fault in error.faults)) from None
    return field


def _placed(fault: Fault, places: dict[str, str]) -> Fault:
    """Name the place in the file instead of the one in our document."""
    for path, file_path in places.items():
        if fault.path == path or fault.path.startswith(f"{path}."):
            return fault._replace(path=file_path + fault.path.removeprefix(path))
    return fault
