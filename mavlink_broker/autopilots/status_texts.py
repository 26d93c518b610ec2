"""STATUSTEXT messages that the broker acts on, by autopilot family and firmware version.

MAVLink gives these events no message of their own. A text is compared with the rows of every
family: it may arrive before the autopilot is identified, and no text has two meanings.
"""

import re
from enum import Enum, auto
from typing import Final, NamedTuple


class TextMeaning(Enum):
    """What a status text says about the flight."""

    MISSION_UPLOADED = auto()  # A client has uploaded a mission
    MISSION_INVALID = auto()  # The vehicle stops its mission, because a new geofence forbids it
    TARGET_OUTSIDE_GEOFENCE = auto()  # The vehicle ignores a reposition that it has acknowledged
    NO_GROUND_STATION = auto()  # The vehicle does not arm without a ground station's heartbeat
    WIND_TOO_STRONG = auto()  # A failsafe ends the mission because of wind


class StatusText(NamedTuple):
    """One row: a text, the firmware that sends it and its meaning."""

    firmware: str
    pattern: re.Pattern[str]
    meaning: TextMeaning


def _begins(text: str) -> re.Pattern[str]:
    return re.compile(f"^{re.escape(text)}")


def _contains(pattern: str) -> re.Pattern[str]:
    return re.compile(pattern, re.IGNORECASE)


PX4: Final = (
    StatusText("1.17", _begins("No valid mission available"), TextMeaning.MISSION_INVALID),
    StatusText(
        "1.17", _begins("Reposition is outside geofence"), TextMeaning.TARGET_OUTSIDE_GEOFENCE
    ),
    # The first chunk of: Preflight Fail: No connection to the ground control station
    StatusText(
        "1.14", _contains("no connection to the ground contro"), TextMeaning.NO_GROUND_STATION
    ),
    StatusText("1.17", _contains("no connection to the gcs"), TextMeaning.NO_GROUND_STATION),
    # As in: Wind speed is above limit (12.0m/s)
    StatusText("1.14", _contains(r"wind[^;]*\blimit"), TextMeaning.WIND_TOO_STRONG),
)
"""Firmware versions as the scripted vehicles of the tests model them."""

FARM_FLIGHT: Final = (
    # As in: Wind too strong: RETURN
    StatusText("this tree", _contains(r"wind[^;]*\btoo strong"), TextMeaning.WIND_TOO_STRONG),
)
"""The project's own vehicle, which also sends PX4's texts."""

ARDUPILOT: Final = (
    StatusText("Copter 4.6", _begins("Flight plan received"), TextMeaning.MISSION_UPLOADED),
)

_ALL: Final = (*PX4, *FARM_FLIGHT, *ARDUPILOT)


def means(text: str, meaning: TextMeaning) -> bool:
    """Whether a status text has a meaning, whichever family sent it.

    `text` is the text of one STATUSTEXT(253), or several joined by "; ".
    """
    return any(row.meaning is meaning and row.pattern.search(text) for row in _ALL)
