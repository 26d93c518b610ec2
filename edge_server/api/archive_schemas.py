"""Types of answers about the archive: flights and their results, maps, logs and alarms."""

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import Field as Member

from afarcloud.enumerations import Status
from edge_server.api.schemas import Answer, Id


class Flight(Answer):
    """A flight in the archive; one without a mission began when its vehicle was armed.

    `plan_name` is null for a plan without a name, or that is not kept any more.
    """

    id: Id
    vehicle_id: int
    mission_id: int | None
    plan_id: str | None
    plan_name: str | None
    started_at: datetime
    ended_at: datetime | None
    mission_status_id: Status | None
    distance_m: float
    pictures: int
    alarms: int


class FlownCommand(Answer):
    """A command of a flight, and when its status was reported."""

    command_id: int
    command_status_id: Status
    command_status_name: str
    message: str | None
    started_at: datetime | None
    ended_at: datetime | None


class FlightWithResults(Flight):
    """A flight with its commands, and the poses and batteries at their ends.

    `lost_reports` of its vehicle could not be archived while it was flown.
    """

    message: str | None
    lost_reports: Annotated[int, Member(ge=0)]
    command_array: list[FlownCommand]
    results: list[dict[str, Any]]


class FlightPicture(Answer):
    """A picture of a flight without its data; `thumbnail_url` is null where there is none."""

    id: Id
    recorded_at: datetime
    name: str
    size_bytes: int
    latitude: float | None
    longitude: float | None
    altitude: float | None
    content_type: str
    url: str
    thumbnail_url: str | None


class FlightLog(Answer):
    """A log that its vehicle has written of a flight; `url` is null until it is complete."""

    id: Id
    format: Literal["ulg", "bin", "tlog"]
    file_name: str
    started_at: datetime
    ended_at: datetime
    size_bytes: int
    received_bytes: int
    is_complete: bool
    url: str | None


class ReceivedLog(Answer):
    """A log that a broker sends; the next part begins at `received_bytes`."""

    name: str
    vehicle_id: Id
    format: Literal["ulg", "bin", "tlog"]
    started_at: datetime
    ended_at: datetime
    listed_at: datetime | None
    size_bytes: int
    received_bytes: int
    is_complete: bool


class PictureFootprint(Answer):
    """Latitude and longitude of a picture's corners on the ground, from the top left clockwise."""

    id: Id
    corners: list[list[float]] | None
    band: Literal["rgb", "nir", "ndvi", "other"]


class FlightMap(Answer):
    """The map of a flight's pictures of a band; `corners` are from the north-west on clockwise."""

    band: Literal["rgb", "nir", "ndvi"]
    state: Literal["none", "making", "ready", "failed"]
    reason: str | None
    url: str | None
    made_at: datetime | None
    corners: list[list[float]] | None
    pictures: int
    metres_per_px: float | None


class MadeFlightMap(Answer):
    """A map of a flight that is made; `corners` are from the north-west on clockwise.

    `plan_name` is that of the flight.
    """

    id: Id
    flight_id: Id
    vehicle_id: Id
    plan_name: str | None
    band: Literal["rgb", "nir", "ndvi"]
    url: str
    made_at: datetime
    corners: list[list[float]]
    pictures: int
    metres_per_px: float


class FlightObservations(Answer):
    """Measurements made at one place."""

    id: Id
    vehicle_id: int
    recorded_at: datetime
    latitude: float
    longitude: float
    altitude: float
    observation_array: list[dict[str, Any]]


class RecordedAlarm(Answer):
    """An alarm in the archive."""

    id: Id
    recorded_at: datetime
    vehicle_id: int
    flight_id: int | None
    mission_id: int | None
    alarm_type_id: int
    alarm_type_name: str
    alarm_code_id: int
    param_array: list[float]
    description: str | None
    acknowledged_at: datetime | None
    acknowledged_by: str | None
