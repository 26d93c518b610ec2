r"""What a person would call a command, found again in the items of a mission.

A vehicle is given items, and one command of a plan may be several: a take-off is a climb and a
waypoint, a picture is an aimed gimbal, a wait for it, a shot and a pause. A mission is therefore
written as letters, one per item, and cut by a pattern: what prepares (S: speed, heading, region of
interest) belongs to what follows, what holds or looks ahead (H, N) to what came before.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

# MAV_CMD, https://mavlink.io/en/messages/common.html#MAV_CMD
WAYPOINT: Final = 16
HOLD: Final = 17
TURNS: Final = 18
RETURN: Final = 20
LAND: Final = 21
TAKE_OFF: Final = 22
_E7: Final = 1e7
_LETTERS: Final[Mapping[int, str]] = {
    TAKE_OFF: "T",
    WAYPOINT: "W",
    TURNS: "O",
    LAND: "L",
    RETURN: "R",
    HOLD: "H",
    93: "D",  # NAV_DELAY
    115: "S",  # CONDITION_YAW
    178: "S",  # DO_CHANGE_SPEED
    195: "S",  # DO_SET_ROI_LOCATION
    197: "N",  # DO_SET_ROI_NONE
    203: "P",  # DO_DIGICAM_CONTROL
    205: "G",  # DO_MOUNT_CONTROL
    1000: "G",  # DO_GIMBAL_MANAGER_PITCHYAW
    2000: "P",  # IMAGE_START_CAPTURE
    2500: "V",  # VIDEO_START_CAPTURE
    2501: "v",  # VIDEO_STOP_CAPTURE
}
_CLIMBED: Final = "w"
"""A waypoint where the take-off before it goes."""
_STEP: Final = re.compile(r"S*(?:TS*w?|(?:S*WP)+D|(?:GD?)?PD|.)[HN]*|S+")
_NAMES: Final[Mapping[str, str]] = {
    "T": "take off to {place}",
    "W": "fly to {place}",
    "O": "circle round {place}",
    "L": "land at {place}",
    "R": "return home and land",
    "H": "hold at {place}",
    "D": "wait {item.param1:g} s",
    "G": "aim the camera",
    "P": "take pictures",
    "V": "start the video of stream {item.param1:g}",
    "v": "stop the video of stream {item.param1:g}",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """A mission item as it is on the wire: x and y are degrees times 1e7 where it has a place."""

    command: int
    param1: float = 0.0
    param2: float = 0.0
    param3: float = 0.0
    param4: float = math.nan
    x: int = 0
    y: int = 0
    z: float = 0.0


@dataclass(frozen=True, slots=True)
class Step:
    """Some neighbouring items that are finished together."""

    first: int
    last: int  # The last that is flown to its end: not the hold behind it
    title: str
    lands: bool


def steps(items: Sequence[Item]) -> tuple[Step, ...]:
    """Cut a mission into what a person finishes at once."""
    letters = "".join(_letters(items))
    return tuple(
        _step(items, letters, match.start(), match.end()) for match in _STEP.finditer(letters)
    )


def _letters(items: Sequence[Item]) -> Iterator[str]:
    climb: Item | None = None
    for item in items:
        letter = _LETTERS.get(item.command, "X")
        if letter == "T":
            climb = item
        elif letter == "W" and climb is not None:
            same = (item.x, item.y, item.z) == (climb.x, climb.y, climb.z)
            letter, climb = _CLIMBED if same else letter, None
        elif letter != "S":
            climb = None
        yield letter


def _step(items: Sequence[Item], mission: str, start: int, end: int) -> Step:
    letters = mission[start:end]
    flown = letters.rstrip("H") or letters
    main = next((n for n, letter in enumerate(letters) if letter != "S"), 0)
    letter = "P" if "P" in letters else letters[main]
    name = "take a panorama" if "WP" in letters else _NAMES.get(letter, "command {item.command}")
    item = items[start + main]
    return Step(
        start,
        start + len(flown) - 1,
        name.format(item=item, place=place(item)),
        letters[main] in "LR",
    )


def place(item: Item) -> str:
    """Describe the place of an item."""
    return f"{item.x / _E7:.7f}, {item.y / _E7:.7f}, {item.z:g} m"
