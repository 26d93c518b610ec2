"""The base of every AFarCloud type, and its numbers, times and texts as JSON carries them.

JSON has one number type; Python's coercions are wider than that. A bool is no number, a string
is no number, 1.0 is an integer, and NaN or infinity is never accepted.
"""

import math
import re
from datetime import UTC, datetime
from typing import Annotated, Any, Final, TypeAlias

from pydantic import (
    AfterValidator,
    AwareDatetime,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
)
from pydantic_core import PydanticCustomError

INT32_MAX = 2**31 - 1
LAST_YEAR = 9998
LAST_SECOND: Final = int(datetime(LAST_YEAR, 12, 31, 23, 59, 59, tzinfo=UTC).timestamp())
"""The last one of that year [s since 1970]."""
MAXIMUM_HEIGHT_M = 120.0
"""Height limit above ground of the EU open category (Regulation 2019/947)."""


FIELD_RULE = "field_rule"
"""Type of the errors made by `field_error`; their context names the field."""


class Model(BaseModel):
    """Frozen; an unknown field, NaN or infinity is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def field_error(field: str, message: str) -> PydanticCustomError:
    """Make the error of a rule between fields, reported at one of them."""
    return PydanticCustomError(FIELD_RULE, "{message}", {"field": field, "message": message})


class Vanished(float):
    """What is left of a number whose text is not 0 and whose nearest double is."""


_TOO_SMALL: Final = "is closer to 0 than a double can represent: write 0"
_NOT_ZERO: Final = re.compile(r"-?[0.]*[1-9]")
_RFC3339: Final = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d.*", re.ASCII)


def parse_number(text: str) -> float:
    """Read a JSON number with a fraction or an exponent; one that underflows is `Vanished`."""
    number = float(text)
    return Vanished(number) if number == 0.0 and _NOT_ZERO.match(text) else number


def json_integer(value: Any) -> Any:
    """Refuse a bool or a string, accept 1.0 as 1; anything else is left to the type."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError("must be an integer")  # noqa: TRY004  # pydantic wants ValueError
    if isinstance(value, Vanished):
        raise ValueError(_TOO_SMALL)  # noqa: TRY004  # as above
    if isinstance(value, float):
        if not math.isfinite(value) or value != int(value):
            raise ValueError(f"must be an integer, not {value}")
        return int(value)
    return value


def json_number(value: Any) -> Any:
    """Refuse a bool, a string, NaN and infinity."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError("must be a number")  # noqa: TRY004  # pydantic wants ValueError
    if isinstance(value, Vanished):
        raise ValueError(_TOO_SMALL)  # noqa: TRY004  # as above
    try:
        number = float(value)
    except OverflowError:
        raise ValueError("must be a finite number") from None
    if not math.isfinite(number):
        raise ValueError("must be a finite number")
    return number


def json_boolean(value: Any) -> Any:
    """Accept true and false only."""
    if not isinstance(value, bool):
        raise ValueError("must be true or false")  # noqa: TRY004  # pydantic wants ValueError
    return value


def _json_time(value: Any) -> Any:
    is_text = isinstance(value, str) and _RFC3339.fullmatch(value)  # Not "1", the epoch's seconds
    if not is_text and not isinstance(value, datetime):
        message = "must be an RFC 3339 time such as 2026-11-21T08:00:00Z"
        raise ValueError(message)  # pydantic wants ValueError
    return value


def _time_in_utc(value: datetime) -> datetime:
    """Refuse what UTC cannot express: an offset may lead beyond the first and the last year.

    The last year itself is left out: a time in seconds, rounded, may end up behind it.
    """
    try:
        is_known = value.astimezone(UTC).year <= LAST_YEAR
    except OverflowError:
        is_known = False
    if not is_known:
        raise ValueError(f"must lie between the years 1 and {LAST_YEAR} in UTC")
    return value


def _compass(degrees: float) -> float:
    """Bring an angle to [0, 360); adding a turn to a tiny negative must not result in 360."""
    turned = degrees % 360.0
    return 0.0 if turned >= 360.0 else turned


def format_time(value: datetime) -> str:
    """Write a time as RFC 3339 in UTC with a Z."""
    return value.astimezone(UTC).isoformat().replace("+00:00", "Z")


Int32: TypeAlias = Annotated[int, Field(ge=0, le=INT32_MAX), BeforeValidator(json_integer)]
"""A counter or an id: 0 to 2^31 - 1."""

VehicleId: TypeAlias = Annotated[int, Field(ge=1, le=INT32_MAX), BeforeValidator(json_integer)]
Byte: TypeAlias = Annotated[int, Field(ge=0, le=255), BeforeValidator(json_integer)]
PositiveByte: TypeAlias = Annotated[int, Field(ge=1, le=255), BeforeValidator(json_integer)]
EpochSeconds: TypeAlias = Annotated[int, Field(ge=0, le=LAST_SECOND), BeforeValidator(json_integer)]
"""Seconds since 1970, up to the end of the last year that a `Time` may have."""

Number: TypeAlias = Annotated[float, BeforeValidator(json_number)]
Latitude: TypeAlias = Annotated[float, Field(ge=-90, le=90), BeforeValidator(json_number)]
Longitude: TypeAlias = Annotated[float, Field(ge=-180, le=180), BeforeValidator(json_number)]

Yaw: TypeAlias = Annotated[
    float, Field(ge=-180, lt=360), AfterValidator(_compass), BeforeValidator(json_number)
]
"""Degrees clockwise from north; -180 to 360 is read, [0, 360) is kept."""

HeightAboveHome: TypeAlias = Annotated[
    float, Field(ge=0, le=MAXIMUM_HEIGHT_M), BeforeValidator(json_number)
]
PositiveHeightAboveHome: TypeAlias = Annotated[
    float, Field(gt=0, le=MAXIMUM_HEIGHT_M), BeforeValidator(json_number)
]

Fraction: TypeAlias = Annotated[float, Field(ge=0, le=1), BeforeValidator(json_number)]
Boolean: TypeAlias = Annotated[bool, BeforeValidator(json_boolean)]
Time: TypeAlias = Annotated[
    AwareDatetime,
    AfterValidator(_time_in_utc),
    BeforeValidator(_json_time),
    PlainSerializer(format_time, when_used="json"),
]
ShortText: TypeAlias = Annotated[str, Field(min_length=1, max_length=255)]
Ulid: TypeAlias = Annotated[str, Field(pattern=r"^[0-7][0-9A-HJKMNP-TV-Z]{25}$")]
"""Crockford base 32, 26 characters: 48 bits of milliseconds and 80 random bits."""
