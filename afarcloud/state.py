"""Reports of a vehicle: state, results, mission reports and alarms."""

import base64
import binascii
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from afarcloud.enumerations import ALARM_CODES, AlarmType, ImageFormat, Status
from afarcloud.numbers import (
    EpochSeconds,
    Fraction,
    Int32,
    Latitude,
    Longitude,
    Model,
    Number,
    ShortText,
    Time,
    Ulid,
    VehicleId,
    Yaw,
    field_error,
    json_integer,
    json_number,
)

MAXIMUM_FRAME_BYTES = 1_048_576
MAXIMUM_FRAME_BASE64 = (MAXIMUM_FRAME_BYTES + 2) // 3 * 4
MESSAGE_LENGTH: Final = 1000
"""Characters of a text for people, at most."""

_MAGIC: dict[ImageFormat, tuple[bytes, ...]] = {
    ImageFormat.JPEG: (b"\xff\xd8\xff",),
    ImageFormat.PNG: (b"\x89PNG\r\n\x1a\n",),
    ImageFormat.TIFF: (b"II*\x00", b"MM\x00*"),
    ImageFormat.WEBP: (b"RIFF",),
    ImageFormat.DNG: (b"II*\x00", b"MM\x00*"),
}


def _amp_hours(value: object) -> object:
    number = json_number(value)
    if number > 100:
        raise ValueError(f"must be at most 100 Ah; is {number} in mAh?")
    return number


Pitch = Annotated[float, Field(ge=-90, le=90), BeforeValidator(json_number)]
Roll = Annotated[float, Field(ge=-180, lt=180), BeforeValidator(json_number)]
Capacity = Annotated[float, Field(ge=0, le=100), BeforeValidator(_amp_hours)]


class Report(Model):
    """Fields of every report of a vehicle."""

    sequence_number: Int32
    vehicle_id: VehicleId
    recorded_at: Time | None = None
    session_id: Ulid | None = None


class Pose(Report):
    """Where the vehicle was and how it lay when a command ended."""

    latitude: Latitude
    longitude: Longitude
    altitude: Number
    yaw: Yaw
    pitch: Pitch
    roll: Roll


class Battery(Report):
    """The battery when a command ended: capacity in Ah, percentage as a fraction."""

    capacity: Capacity
    percentage: Fraction


class StateVector(Report):
    """Position, attitude, speed and battery, about once a second."""

    latitude: Latitude
    longitude: Longitude
    altitude: Number
    yaw: Yaw
    pitch: Pitch
    roll: Roll
    battery_capacity: Capacity | None = None
    battery_percentage: Fraction | None = None
    linear_speed: Annotated[float, Field(ge=0, le=100), BeforeValidator(json_number)]


class CommandReport(Model):
    """How far one command is; `message` says why it failed or was changed."""

    command_id: Int32
    command_status_id: Annotated[Status, BeforeValidator(json_integer)]
    message: str | None = Field(default=None, max_length=MESSAGE_LENGTH)


class MissionReport(Report):
    """How far a mission and each of its commands are.

    `plan_id` and `work_id` name the one flight that is meant: a `mission_id` may be flown again.
    """

    mission_id: Int32
    plan_id: Ulid | None = None
    work_id: Annotated[int, Field(ge=1, le=2**63 - 1), BeforeValidator(json_integer)] | None = None
    mission_status_id: Annotated[Status, BeforeValidator(json_integer)]
    command_report_array: Annotated[tuple[CommandReport, ...], Field(max_length=700)]
    message: str | None = Field(default=None, max_length=MESSAGE_LENGTH)

    @model_validator(mode="after")
    def _every_command_once(self) -> "MissionReport":
        first: dict[int, int] = {}
        for index, report in enumerate(self.command_report_array):
            earlier = first.setdefault(report.command_id, index)
            if earlier != index:
                raise field_error(
                    f"command_report_array.{index}.command_id",
                    f"{report.command_id} is already in command_report_array.{earlier}",
                )
        return self


_CODE_FITS_TYPE: Final[dict[str, Any]] = {
    "oneOf": [
        {
            "properties": {
                "alarm_type_id": {"const": kind.value},
                "alarm_code_id": {"minimum": codes.start, "maximum": codes.stop - 1},
            }
        }
        for kind, codes in ALARM_CODES.items()
    ]
}
"""The rule between type and code, for the JSON Schema."""


class Alarm(Report):
    """A failure that ends the mission."""

    model_config = ConfigDict(json_schema_extra=_CODE_FITS_TYPE)

    alarm_type_id: Annotated[AlarmType, BeforeValidator(json_integer)]
    alarm_code_id: Annotated[int, Field(ge=1, le=99), BeforeValidator(json_integer)]
    param_array: tuple[Number, Number] = (0.0, 0.0)
    mission_id: Int32 | None = None
    message: str | None = Field(default=None, max_length=MESSAGE_LENGTH)

    @model_validator(mode="after")
    def _code_fits_the_type(self) -> "Alarm":
        codes = ALARM_CODES[self.alarm_type_id]
        if self.alarm_code_id not in codes:
            raise field_error(
                "alarm_code_id",
                f"of alarm type {self.alarm_type_id.value} is {codes.start} to {codes.stop - 1}",
            )
        return self


class Observation(Model):
    """One measured value."""

    resource_id: ShortText
    observed_property: ShortText
    result_time: EpochSeconds
    result_value: Number
    result_uom: ShortText


class ObservationList(Report):
    """Measurements made at one place."""

    latitude: Latitude
    longitude: Longitude
    altitude: Number
    observation_array: Annotated[tuple[Observation, ...], Field(min_length=1, max_length=100)]


class Image(Report):
    """A picture, base64 in `frame`, at most 1 MiB decoded."""

    format: ImageFormat
    image_size: Int32
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]{0,128}$")] = ""
    frame: Annotated[str, Field(max_length=MAXIMUM_FRAME_BASE64)]

    @model_validator(mode="after")
    def _the_frame_is_what_it_says(self) -> "Image":
        try:
            data = base64.b64decode(self.frame, validate=True)
        except (binascii.Error, ValueError):
            raise field_error("frame", "must be base64") from None
        if len(data) > MAXIMUM_FRAME_BYTES:
            raise field_error("frame", f"must decode to at most {MAXIMUM_FRAME_BYTES} bytes")
        if len(data) != self.image_size:
            raise field_error("image_size", f"must be {len(data)}, the length of frame")
        if not data.startswith(_MAGIC[self.format]):
            raise field_error("frame", f"does not begin like {self.format.value}")
        return self
