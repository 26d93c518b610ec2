"""The request for a survey: field, and pictures or swath. Angles in degrees, lengths in m."""

from typing import Annotated, NamedTuple, Self

from pydantic import BeforeValidator, Field, model_validator

from afarcloud.numbers import (
    Boolean,
    Int32,
    Latitude,
    Longitude,
    Model,
    PositiveHeightAboveHome,
    ShortText,
    Time,
    VehicleId,
    Yaw,
    field_error,
    json_integer,
    json_number,
)
from afarcloud.plan import DEFAULT_SPEED_M_S, Geofence, Polygon, Speed, Vertex
from edge_server.survey.lines import Footprint

Overlap = Annotated[float, Field(ge=0, le=0.95), BeforeValidator(json_number)]
Millimetres = Annotated[float, Field(gt=0, le=1000), BeforeValidator(json_number)]
Metres = Annotated[float, Field(ge=0.5, le=500), BeforeValidator(json_number)]
Rings = Annotated[tuple[Polygon, ...], Field(max_length=50)]
SMALLEST_SPACING_M = 0.5


class Camera(Model):
    """A camera that looks straight down; its width lies across the line of flight."""

    sensor_width_mm: Millimetres
    sensor_height_mm: Millimetres
    focal_length_mm: Millimetres


class Place(Model):
    """A place on the ground."""

    latitude: Latitude
    longitude: Longitude


class VehicleHome(Place):
    """Where one vehicle takes off."""

    vehicle_id: VehicleId


class Home(NamedTuple):
    """Where a vehicle of a survey starts, and returns to."""

    place: Place
    is_takeoff: bool = False
    """Its missions take off there; otherwise, as where several start from one place or this one is
    not known, they take off towards their first place."""
    beyond: tuple[Polygon, ...] = ()
    """No-fly areas that lie on its paths from home and back alone."""


class SurveyTerms(Model):
    """How a field is to be covered, and by whom.

    `homes` names where vehicles take off; `home` holds for those that it does not name.
    """

    name: ShortText | None = None
    geofence: Geofence | None = None
    camera: Camera | None = None
    swath_width: Metres | None = None
    altitude: PositiveHeightAboveHome
    side_overlap: Overlap = 0.6
    front_overlap: Overlap = 0.75
    angle: Yaw | None = None
    maximum_speed: Speed = DEFAULT_SPEED_M_S
    vehicles: Annotated[tuple[VehicleId, ...], Field(min_length=1, max_length=16)]
    home: Place | None = None
    homes: Annotated[tuple[VehicleHome, ...], Field(max_length=16)] = ()
    entry: Vertex | None = None
    endurance: Annotated[float, Field(ge=60, le=86_400), BeforeValidator(json_number)] = 900.0
    most_commands: Annotated[int, Field(ge=4, le=700), BeforeValidator(json_integer)] = 100
    first_mission_id: Int32 | None = None
    expires_at: Time | None = None
    dispatch: Boolean = False
    plan_per_vehicle: Boolean = False

    @model_validator(mode="after")
    def _fields_fit(self) -> Self:
        if (self.camera is None) == (self.swath_width is None):
            raise field_error("camera", "goes in place of swath_width: give exactly one of them")
        if len(set(self.vehicles)) != len(self.vehicles):
            raise field_error("vehicles", "names a vehicle twice")
        known = [home.vehicle_id for home in self.homes]
        if len(set(known)) != len(known) or not set(known) <= set(self.vehicles):
            raise field_error("homes", "names a vehicle twice, or one that is not in vehicles")
        footprint = self.footprint
        spacings = [footprint.line_spacing_m]
        spacings += [footprint.place_spacing_m] if footprint.along_m else []
        if min(spacings) < SMALLEST_SPACING_M:
            raise field_error(
                "altitude",
                f"and overlaps put places {min(spacings):.2f} m apart; at least "
                f"{SMALLEST_SPACING_M} m can be flown",
            )
        return self

    @property
    def footprint(self) -> Footprint:
        """What one picture, or the swath, covers on level ground."""
        if self.camera is None:
            across = self.swath_width or 0.0
            return Footprint(across, 0.0, across * (1.0 - self.side_overlap), 0.0)
        scale = self.altitude / self.camera.focal_length_mm
        across, along = self.camera.sensor_width_mm * scale, self.camera.sensor_height_mm * scale
        return Footprint(
            across,
            along,
            across * (1.0 - self.side_overlap),
            along * (1.0 - self.front_overlap),
        )


class SurveyRequest(SurveyTerms):
    """A field and how it is to be covered: what is planned.

    No-fly areas beyond what is covered are met by the paths from home and back alone.
    """

    boundary: Polygon
    holes: Rings = ()
    exclusions: Rings = ()
    beyond: tuple[Polygon, ...] = ()


class SurveyOrder(SurveyTerms):
    """What is asked for: a field by its number, or by a boundary of its own.

    Holes and exclusions are those of this survey; a field that is named has its own besides. Its
    entry holds unless this survey has another. An area is the part of a named field that alone is
    covered; the plans are still those of the field.
    """

    field_id: Int32 | None = None
    area: Polygon | None = None
    boundary: Polygon | None = None
    holes: Rings = ()
    exclusions: Rings = ()

    @model_validator(mode="after")
    def _one_field(self) -> Self:
        if (self.field_id is None) == (self.boundary is None):
            raise field_error("boundary", "goes in place of field_id: give exactly one of them")
        if self.area is not None and self.field_id is None:
            raise field_error("area", "is a part of a stored field: name it in field_id")
        return self
