"""What becomes of a ground station's message."""

from dataclasses import dataclass
from enum import Enum, auto
from typing import TypeAlias

from mavlink_broker.mavlink.dialect import Message


class Tenure(Enum):
    """Whose a vehicle is at the moment."""

    FREE = auto()  # No mission of the broker runs on it
    MISSION = auto()  # One does
    TRANSFER = auto()  # One does, and is just being sent to it or read back


@dataclass(frozen=True, slots=True)
class Pass:
    """It goes to the vehicle as it is."""


@dataclass(frozen=True, slots=True)
class Answer:
    """It is as good as done: the ground station is answered in the vehicle's name."""

    message: Message


@dataclass(frozen=True, slots=True)
class Later:
    """It is let fall without a word; ground stations ask again."""


@dataclass(frozen=True, slots=True)
class Refuse:
    """It is not for ground stations while a mission runs."""

    answer: Message | None = None  # Goes back in the vehicle's name
    instead: Message | None = None  # Goes to the vehicle in the ground station's name


Verdict: TypeAlias = Pass | Answer | Later | Refuse
