"""Types of fields and surveys, and of the foreign files that become fields and plans."""

from datetime import datetime
from typing import Annotated, Any, Final, Literal

from pydantic import Field as Member
from pydantic import RootModel, WithJsonSchema

from edge_server.api.schemas import Answer, Id, optional
from edge_server.geodata.field import Field


class Survey(Answer):
    """Figures of a survey, and its plans in the order of flight."""

    area_m2: float
    angle_deg: float
    lines: int
    line_spacing_m: float = optional()
    picture_spacing_m: float | None = optional()
    pictures: int = optional()
    flights: int
    length_m: float
    duration_s: float
    plans: list[dict[str, Any]]


_Corner = Annotated[list[float], Member(min_length=2, max_length=2)]
_Ring = Annotated[list[_Corner], Member(min_length=3)]


class StoredField(Field, Answer):
    """A field as it is kept."""

    boundary: _Ring  # type: ignore[assignment]  # as it is answered: lists
    holes: list[_Ring]  # type: ignore[assignment]  # as above
    exclusions: list[_Ring]  # type: ignore[assignment]  # as above
    entry: _Corner | None = None  # type: ignore[assignment]  # as above
    id: Id
    area_m2: float
    received_at: datetime
    updated_at: datetime


class LeftOut(Answer):
    """A part of a file that is no area: its path, and what it is."""

    path: str
    message: str


class SeveralFields(Answer):
    """The fields of a file, and what of it is no area and was left out."""

    fields: Annotated[list[StoredField], Member(min_length=1)]
    left_out: list[LeftOut] | None = None


class StoredFields(RootModel[StoredField | SeveralFields]):
    """The field that was posted, or all fields of a file with several parts."""


_POSITION: Final = {
    "type": "array",
    "prefixItems": [
        {"type": "number", "minimum": -180, "maximum": 180},
        {"type": "number", "minimum": -90, "maximum": 90},
    ],
    "minItems": 2,
}
_Position = Annotated[list[float], WithJsonSchema(_POSITION)]
_ClosedRing = Annotated[list[_Position], Member(min_length=4, max_length=1001)]
_Rings = Annotated[list[_ClosedRing], Member(min_length=1, max_length=51)]


class Polygon(Answer):
    """A geometry of GeoJSON."""

    type: Literal["Polygon"]
    coordinates: _Rings


class MultiPolygon(Answer):
    """A geometry of GeoJSON."""

    type: Literal["MultiPolygon"]
    coordinates: Annotated[list[_Rings], Member(min_length=1, max_length=100)]


class Feature(Answer):
    """A feature of GeoJSON."""

    type: Literal["Feature"]
    geometry: Polygon | MultiPolygon


class FeatureCollection(Answer):
    """Features of GeoJSON."""

    type: Literal["FeatureCollection"]
    features: Annotated[list[Feature], Member(min_length=1, max_length=100)]


class GeoJson(RootModel[Polygon | MultiPolygon | Feature | FeatureCollection]):
    """A boundary as in RFC 7946: longitude first, rings closed."""


class FieldOrGeoJson(RootModel[Field | GeoJson]):
    """A field, as our own document or as GeoJSON."""


class QGroundControlMission(Answer):
    """The mission of a `.plan` file."""

    version: Literal[2]
    items: Annotated[list[dict[str, Any]], Member(min_length=1)]


class QGroundControlPlan(Answer):
    """A `.plan` file of QGroundControl, as far as it is read here."""

    file_type: Literal["Plan"] = Member(alias="fileType")
    version: Literal[1]
    mission: QGroundControlMission
    geo_fence: dict[str, Any] = optional(alias="geoFence")
    rally_points: dict[str, Any] = optional(alias="rallyPoints")
