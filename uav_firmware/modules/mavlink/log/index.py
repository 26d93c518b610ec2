"""The flight logs by number, as the log protocol wants them: 0 the oldest.

Logs lie as `2026-03-01/09_30_00.ulg`, a second one of the same second as `09_30_00_2.ulg`.
"""

import calendar
import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from uav_firmware.cal.files import Entry, FileStore, Place

_DAY: Final = re.compile(r"(\d{4})-(\d{2})-(\d{2})")
_LOG: Final = re.compile(r"(\d{2})_(\d{2})_(\d{2})(?:_(\d+))?\.ulg")


class Log(NamedTuple):
    """One flight log."""

    time_utc_s: int  # [s since 1970] At its beginning
    number: int  # Of those that began in the same second, from 1
    place: Place
    size: int  # [bytes] When it was listed


def find_logs(store: FileStore) -> list[Log]:
    """All logs, oldest first.

    Raises:
        OSError: if the store cannot be read.
    """
    return sorted(
        log
        for day in store.entries(())
        if day.is_folder and (date := _DAY.fullmatch(day.name))
        for log in _logs_of_day(store, day, date)
    )


def _logs_of_day(store: FileStore, day: Entry, date: "re.Match[str]") -> Iterator[Log]:
    for entry in store.entries((day.name,)):
        time = _LOG.fullmatch(entry.name)
        if time and entry.is_plain and not entry.is_folder:
            fields = [int(part) for part in (*date.groups(), *time.groups()[:3])]
            seconds = calendar.timegm((*fields, 0, 0, 0))
            yield Log(seconds, int(time[4] or 1), (day.name, entry.name), entry.size)
