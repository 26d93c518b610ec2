"""Field boundaries as KML 2.2, and as KMZ, which is KML in a zip archive. Pure.

Every polygon of a placemark is a field with the placemark's name; points and lines are left out.
A document type, an entity, a link to elsewhere, or a tree too deep or too large is refused before
anything is made of it.
"""

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from afarcloud.faults import Fault, InvalidError
from afarcloud.plan import Vertex
from edge_server.geodata.rings import (
    MOST_FIELDS,
    Boundary,
    FieldFile,
    NoAreaError,
    Ring,
    field_file,
    fields_of,
    refusal,
)
from edge_server.geodata.zipped import Archive, is_zip

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MEDIA_TYPES: Final = frozenset(
    {"application/vnd.google-earth.kml+xml", "application/xml", "text/xml"}
)
ZIPPED_MEDIA_TYPE: Final = "application/vnd.google-earth.kmz"
DEEPEST: Final = 40
LARGEST_BYTES: Final = 4 * 1024 * 1024
"""Size of the KML that a KMZ unpacks to, whatever size the archive states."""
_GEOMETRIES: Final = frozenset(
    {"Point", "LineString", "LinearRing", "Model", "Track", "MultiTrack", "Polygon"}
)


def read(raw: bytes) -> FieldFile:
    """Read the boundaries of fields out of a KML or KMZ file.

    Raises:
        InvalidError: naming each area that is no boundary, and why; or if there is none.
    """
    root = _parsed(_unzipped(raw) if is_zip(raw) else raw)
    if _tag(root) != "kml":
        raise refusal("", "must be KML: its outermost element is another")
    if any(_tag(element) == "NetworkLink" for element in root.iter()):
        raise refusal("NetworkLink", "leads elsewhere; what is there is not read")
    found: list[Boundary] = []
    left_out: list[Fault] = []
    faults: list[Fault] = []
    for number, placemark in enumerate(_all(root, "Placemark")):
        try:
            found += _boundaries(placemark, f"Placemark.{number}", left_out)
        except NoAreaError as error:
            left_out += error.faults
        except InvalidError as error:
            faults += error.faults
        if len(found) > MOST_FIELDS:
            raise refusal("Placemark", f"make more than {MOST_FIELDS} fields")
    if not (found or left_out or faults):
        raise refusal("Placemark", "must be there at least once, with a polygon")
    return field_file(found, left_out, faults)


def _unzipped(raw: bytes) -> bytes:
    """The KML of a KMZ: `doc.kml`, else the first one; never more than it may be."""
    archive = Archive(raw, "KMZ")
    documents = sorted(archive.names(".kml"), key=lambda name: name.lower() != "doc.kml")
    if not documents:
        raise refusal("", "is a KMZ without KML")
    return archive.read(documents[0], LARGEST_BYTES)


def _parsed(raw: bytes) -> "Element":
    """Parse untrusted XML; the parser is loaded with the first file, for few servers get one."""
    from xml.etree.ElementTree import ParseError  # noqa: PLC0415  # see above

    from defusedxml import DefusedXmlException  # noqa: PLC0415  # as above
    from defusedxml.ElementTree import iterparse  # noqa: PLC0415  # as above

    depth = 0
    root: Element | None = None
    try:
        for event, element in iterparse(io.BytesIO(raw), events=("start", "end"), forbid_dtd=True):
            root = element if root is None else root
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise refusal("", "nests too deep")
    except DefusedXmlException:
        raise refusal("", "must not define a document type or entities") from None
    except ParseError as error:
        line, column = error.position
        raise refusal("", f"is not XML: at line {line} column {column}") from None
    except (ValueError, LookupError) as error:
        raise refusal("", f"is not XML that can be read: {error}") from None
    if root is None:
        raise refusal("", "is empty")
    return root


def _boundaries(placemark: "Element", path: str, left_out: list[Fault]) -> list[Boundary]:
    """Make fields of the polygons; what is beside them is added to `left_out`."""
    name = (_text(placemark, "name") or "").strip() or None
    geometries = [one for one in placemark.iter() if _tag(one) in _GEOMETRIES]
    inside = {ring for one in _all(placemark, "Polygon") for ring in _all(one, "LinearRing")}
    alone = [one for one in geometries if one not in inside]
    areas = [one for one in alone if _tag(one) == "Polygon"]
    others = [one for one in alone if _tag(one) != "Polygon"]
    strange = [
        Fault(path, _called(name, f"has a {_tag(one)}; only polygons are fields"))
        for one in others[:1]
    ]
    if not areas:
        raise NoAreaError(tuple(strange) or (Fault(path, _called(name, "has no polygon")),))
    left_out += strange
    polygons = []
    for number, polygon in enumerate(areas):
        place = f"{path}.Polygon.{number}"
        polygons.append((place, list(_rings(polygon, place))))
    return fields_of(name, polygons, [])


def _rings(polygon: "Element", path: str) -> Iterator[Ring]:
    """The outer ring, then the inner ones."""
    outer = [ring for side in _all(polygon, "outerBoundaryIs") for ring in _all(side, "LinearRing")]
    if len(outer) != 1:
        raise refusal(f"{path}.outerBoundaryIs", "must be there once, with one LinearRing")
    inner = [ring for side in _all(polygon, "innerBoundaryIs") for ring in _all(side, "LinearRing")]
    yield f"{path}.outerBoundaryIs", _corners(outer[0], f"{path}.outerBoundaryIs")
    for number, ring in enumerate(inner):
        place = f"{path}.innerBoundaryIs.{number}"
        yield place, _corners(ring, place)


def _corners(ring: "Element", path: str) -> list[Vertex]:
    """A closed ring of `longitude,latitude[,height]` as open ring of corners."""
    tuples = (_text(ring, "coordinates") or "").split()
    if len(tuples) < 4:
        raise refusal(f"{path}.coordinates", "must be four or more positions")
    corners = [_corner(one, f"{path}.coordinates.{index}") for index, one in enumerate(tuples)]
    if corners[0] != corners[-1]:
        raise refusal(f"{path}.coordinates", "must end where they begin")
    return corners[:-1]


def _corner(position: str, path: str) -> Vertex:
    try:
        longitude, latitude = (float(number) for number in position.split(",")[:2])
    except ValueError:
        raise refusal(path, "must be longitude,latitude in degrees, without blanks") from None
    if not -180.0 <= longitude <= 180.0:
        raise refusal(path, "must begin with a longitude, -180 to 180")
    if not -90.0 <= latitude <= 90.0:
        raise refusal(path, "must have a latitude, -90 to 90; KML has the longitude first")
    return latitude, longitude


def _all(element: "Element", tag: str) -> "list[Element]":
    return [one for one in element.iter() if _tag(one) == tag]


def _text(element: "Element", tag: str) -> str | None:
    """Text of the first child of a name."""
    return next((child.text for child in element if _tag(child) == tag), None)


def _tag(element: "Element") -> str:
    """Name of an element, whatever version of KML its namespace names."""
    return str(element.tag).rpartition("}")[2]


def _called(name: str | None, fault: str) -> str:
    return fault if name is None else f"({name[:60]}) {fault}"
