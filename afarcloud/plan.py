"""Plans, their missions, and the events that interrupt them."""

from typing import Annotated, Final, TypeAlias

from pydantic import BeforeValidator, Field, model_validator

from afarcloud.commands import Command
from afarcloud.enumerations import EventType, Profile
from afarcloud.numbers import (
    Boolean,
    HeightAboveHome,
    Int32,
    Latitude,
    Longitude,
    Model,
    PositiveHeightAboveHome,
    ShortText,
    Time,
    Ulid,
    VehicleId,
    field_error,
    json_integer,
    json_number,
)

Vertex: TypeAlias = tuple[Latitude, Longitude]
Polygon: TypeAlias = Annotated[tuple[Vertex, ...], Field(min_length=3, max_length=1000)]
Speed: TypeAlias = Annotated[float, Field(gt=0, le=100), BeforeValidator(json_number)]
DEFAULT_SPEED_M_S = 5.0
MOST_POLYGONS: Final = 64
MOST_CORNERS: Final = 2000
"""Limits of a geofence, inclusions and exclusions together: a farm needs tens of each, and a plan
is checked against all of them."""


class Geofence(Model):
    """Where a plan may fly: inside one inclusion, outside all exclusions, below a height."""

    inclusion: tuple[Polygon, ...] = ()
    exclusion: tuple[Polygon, ...] = ()
    max_altitude: PositiveHeightAboveHome | None = None

    @model_validator(mode="after")
    def _has_a_bounded_size(self) -> "Geofence":
        polygons = (*self.inclusion, *self.exclusion)
        larger = "exclusion" if len(self.exclusion) > len(self.inclusion) else "inclusion"
        if len(polygons) > MOST_POLYGONS:
            text = f"inclusion and exclusion have {len(polygons)} polygons, at most {MOST_POLYGONS}"
            raise field_error(larger, text)
        corners = sum(len(polygon) for polygon in polygons)
        if corners > MOST_CORNERS:
            text = f"inclusion and exclusion have {corners} corners, at most {MOST_CORNERS}"
            raise field_error(larger, text)
        return self


class RallyPoint(Model):
    """Where a vehicle that has to return may go instead of home."""

    latitude: Latitude
    longitude: Longitude
    altitude: HeightAboveHome


class Mission(Model):
    """The commands of one vehicle, flown in order."""

    sequence_number: Int32 = 0
    mission_id: Int32
    vehicle_id: VehicleId
    maximum_speed: Speed = DEFAULT_SPEED_M_S
    command_array: Annotated[tuple[Command, ...], Field(min_length=1, max_length=700)]


class Plan(Model):
    """One mission for each of one or more vehicles.

    With `dispatch` false it is kept and not flown until somebody dispatches it.
    """

    plan_id: Ulid | None = None
    name: ShortText | None = None
    sequence_number: Int32 = 0
    field_id: Int32 | None = None
    profile: Profile = Profile.FIELD
    created_at: Time | None = None
    expires_at: Time | None = None
    dispatch: Boolean = True
    geofence: Geofence | None = None
    rally_points: Annotated[tuple[RallyPoint, ...], Field(max_length=100)] = ()
    missions: Annotated[tuple[Mission, ...], Field(min_length=1, max_length=16)]


class AbortPoint(Model):
    """Where an aborted vehicle goes."""

    latitude: Latitude
    longitude: Longitude
    altitude: HeightAboveHome


class Event(Model):
    """An interruption of a vehicle's mission."""

    sequence_number: Int32 = 0
    vehicle_id: VehicleId
    event_type_id: Annotated[EventType, BeforeValidator(json_integer)]
    abort: AbortPoint | None = None
    maximum_speed: Speed | None = None
    expires_at: Time | None = None

    @model_validator(mode="after")
    def _parameters_fit_the_type(self) -> "Event":
        wants_speed = self.event_type_id == EventType.DRONE_SPEED
        if wants_speed != (self.maximum_speed is not None):
            raise field_error("maximum_speed", "goes with event_type_id 3, and only with it")
        if self.abort is not None and not self.event_type_id.takes_place:
            raise field_error("abort", "goes with event_type_id 1 or 2")
        return self


class LatestStateVector(Model):
    """A request for a fresh state vector of one vehicle, or of all."""

    sequence_number: Int32
    vehicle_id: VehicleId | None = None
