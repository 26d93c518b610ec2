"""The measurements of a flight as CSV (RFC 4180), a row per value. Pure.

Texts come from vehicles: one that a spreadsheet would calculate is written behind an apostrophe
(CWE-1236). Altitudes are metres above home.
"""

import csv
import io
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from typing import Any, Final

from afarcloud.numbers import LAST_SECOND, format_time

MEDIA_TYPE: Final = "text/csv; charset=utf-8"
HEADER: Final = (
    "time",
    "latitude_deg",
    "longitude_deg",
    "altitude_m",
    "resource",
    "property",
    "value",
    "unit",
)
_CALCULATED: Final = ("=", "+", "-", "@", "\t", "\r")


def write(documents: Iterable[dict[str, Any]]) -> Iterator[str]:
    """Write the header and a row for each value of measurement lists, as they are reported."""
    yield _row(HEADER)
    for document in documents:
        for one in document["observation_array"]:
            yield _row(
                (
                    _time(one["result_time"]),
                    document["latitude"],
                    document["longitude"],
                    document["altitude"],
                    _text(one["resource_id"]),
                    _text(one["observed_property"]),
                    one["result_value"],
                    _text(one["result_uom"]),
                )
            )


def _time(epoch_s: int) -> str:
    """Leave out what is no time: earlier versions have stored any number."""
    return format_time(datetime.fromtimestamp(epoch_s, UTC)) if epoch_s <= LAST_SECOND else ""


def _text(text: str) -> str:
    return f"'{text}" if text.startswith(_CALCULATED) else text


def _row(cells: Iterable[object]) -> str:
    line = io.StringIO(newline="")
    csv.writer(line).writerow(cells)
    return line.getvalue()
