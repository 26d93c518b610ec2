"""What MAVLink brings to the vehicle, and what the vehicle does about it."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import TypeAlias

from sim.tester.vehicle.actions import Pose
from sim.tester.vehicle.mission_steps import Item


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """COMMAND_LONG or COMMAND_INT; a parameter that is not set is NaN.

    The fifth and sixth are degrees times 1e7 where COMMAND_INT gives a place.
    """

    number: int
    parameters: tuple[float, float, float, float, float, float, float]
    frame: int = 0
    component: int = 1  # To whom
    sender: tuple[int, int] = (0, 0)  # System and component


@dataclass(frozen=True, slots=True)
class MissionReceived:
    """A whole mission has been stored."""

    items: Sequence[Item]


@dataclass(frozen=True, slots=True)
class AreaReceived:
    """A geofence or rally points have been stored."""

    what: str
    count: int  # Of items


@dataclass(frozen=True, slots=True)
class MissionCleared:
    """The mission has been taken away."""


@dataclass(frozen=True, slots=True)
class ItemMadeCurrent:
    """The mission is to begin at an item."""

    seq: int


@dataclass(frozen=True, slots=True)
class Armed:
    """The motors have been started or stopped by command."""

    armed: bool


LinkEvent: TypeAlias = (
    Command | MissionReceived | AreaReceived | MissionCleared | ItemMadeCurrent | Armed
)


class Result(Enum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3


class MissionChange(Enum):
    """What the person's menu has to follow."""

    RUNS = auto()
    ENDED = auto()
    INTERRUPTED = auto()


@dataclass(frozen=True, slots=True)
class Acknowledge:
    """Answer a command."""

    command: Command
    result: Result


@dataclass(frozen=True, slots=True)
class CompleteItems:
    """So many items of the mission have been flown, the current one first."""

    count: int


@dataclass(frozen=True, slots=True)
class ShowArming:
    """Have the motors run or not, and say so at once."""

    armed: bool


@dataclass(frozen=True, slots=True)
class ShowText:
    """Show a text to the operator."""

    text: str


@dataclass(frozen=True, slots=True)
class Warn:
    """Report a failure: a STATUSTEXT for people, the alarm's parameters for the broker."""

    text: str
    parameters: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Publish:
    """Send telemetry now, from where the vehicle is."""

    pose: Pose


@dataclass(frozen=True, slots=True)
class Observe:
    """Send the observation."""


@dataclass(frozen=True, slots=True)
class MeasureHumidity:
    """Send a measurement of the humidity sensor."""

    percent: float


Order: TypeAlias = (
    Acknowledge
    | CompleteItems
    | ShowArming
    | ShowText
    | Warn
    | Publish
    | Observe
    | MeasureHumidity
    | MissionChange
)
