"""What the broker reads from STATUSTEXT, by autopilot family and firmware version.

MAVLink gives some events no message but STATUSTEXT. A text is compared with the rows of every
family: it may arrive before the autopilot is identified, and no text has two meanings.

`StatusTexts` collects the texts of a vehicle. One of more than 50 bytes is sent in numbered chunks
with a common id; three dots stand for lost chunks.
"""

import re
from collections import deque
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Final, NamedTuple

from mavlink_broker.mavlink.dialect import Message, mavlink


class TextMeaning(Enum):
    """What a status text means for the flight."""

    MISSION_UPLOADED = auto()  # A client has uploaded a mission
    MISSION_INVALID = auto()  # The vehicle stops its mission, because a new geofence forbids it
    TARGET_OUTSIDE_GEOFENCE = auto()  # The vehicle ignores a reposition that it has acknowledged
    NO_GROUND_STATION = auto()  # The vehicle does not arm without a ground station's heartbeat
    WIND_TOO_STRONG = auto()  # A failsafe ends the mission because of wind


class KnownText(NamedTuple):
    """One row: a text, the firmware that sends it and its meaning."""

    firmware: str
    pattern: re.Pattern[str]
    meaning: TextMeaning


def _begins(text: str) -> re.Pattern[str]:
    return re.compile(f"^{re.escape(text)}")


def _contains(pattern: str) -> re.Pattern[str]:
    return re.compile(pattern, re.IGNORECASE)


PX4: Final = (
    KnownText("1.17", _begins("No valid mission available"), TextMeaning.MISSION_INVALID),
    KnownText(
        "1.17", _begins("Reposition is outside geofence"), TextMeaning.TARGET_OUTSIDE_GEOFENCE
    ),
    # The first chunk of: Preflight Fail: No connection to the ground control station
    KnownText(
        "1.14", _contains("no connection to the ground contro"), TextMeaning.NO_GROUND_STATION
    ),
    KnownText("1.17", _contains("no connection to the gcs"), TextMeaning.NO_GROUND_STATION),
    # As in: Wind speed is above limit (12.0m/s)
    KnownText("1.14", _contains(r"wind[^;]*\blimit"), TextMeaning.WIND_TOO_STRONG),
)
"""Firmware versions as the scripted vehicles of the tests model them."""

FARM_FLIGHT: Final = (
    # As in: Wind too strong: RETURN
    KnownText("this tree", _contains(r"wind[^;]*\btoo strong"), TextMeaning.WIND_TOO_STRONG),
)
"""The project's own vehicle, which also sends PX4's texts."""

ARDUPILOT: Final = (
    KnownText("Copter 4.6", _begins("Flight plan received"), TextMeaning.MISSION_UPLOADED),
)

_ALL: Final = (*PX4, *FARM_FLIGHT, *ARDUPILOT)


def means(text: str, meaning: TextMeaning) -> bool:
    """Whether a status text has a meaning, whichever family sent it.

    `text` is the text of one STATUSTEXT(253), or several joined by "; ".
    """
    return any(row.meaning is meaning and row.pattern.search(text) for row in _ALL)


TEXTS_KEPT: Final = 16
MAX_REPORTED: Final = 3
"""Texts in one report: the first is often the cause of the last."""
CHUNK_TIMEOUT_S: Final = 10.0
"""After this time the same id means another text."""
_GAP: Final = "..."


@dataclass(slots=True)
class _Text:
    time: float
    identifier: int  # 0: sent in one chunk
    chunks: dict[int, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        parts = [self.chunks.get(number, _GAP) for number in range(max(self.chunks) + 1)]
        return " ".join("".join(parts).split())


class StatusTexts:
    """The latest STATUSTEXTs of one vehicle with severity WARNING or worse."""

    def __init__(self) -> None:
        self._texts: deque[_Text] = deque(maxlen=TEXTS_KEPT)

    def receive(self, message: Message, now: float) -> None:
        """Handle a STATUSTEXT; other messages are ignored."""
        if message.get_type() != "STATUSTEXT" or message.severity > mavlink.MAV_SEVERITY_WARNING:
            return
        entry = self._open(message.id, now)
        if entry is None:
            entry = _Text(now, message.id)
            self._texts.append(entry)
        entry.chunks[message.chunk_seq] = message.text

    def since(self, time: float) -> list[str]:
        """Return the latest different texts since a time, in their order."""
        texts = [entry.text for entry in self._texts if entry.time >= time]
        different = dict.fromkeys(text for text in texts if text)
        return list(different)[-MAX_REPORTED:]

    def clear(self) -> None:
        """Forget everything."""
        self._texts.clear()

    def _open(self, identifier: int, now: float) -> _Text | None:
        if identifier == 0:
            return None
        return next(
            (
                entry
                for entry in self._texts
                if entry.identifier == identifier and now - entry.time < CHUNK_TIMEOUT_S
            ),
            None,
        )
