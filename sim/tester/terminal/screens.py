"""The seed's menus, as tables: what is shown, which number leads where, which questions follow.

Texts and numbers are those of the seed (section 4.4.7 of its description).
"""

import json
import math
from collections.abc import Callable, Mapping
from enum import Enum, auto
from typing import Final, NamedTuple

from sim.tester.vehicle.actions import (
    Action,
    FinishCommand,
    ObservationPart,
    SetBatteryCapacity,
    SetObservation,
)
from sim.tester.vehicle.alarms import Alarm


class Place(Enum):
    """Where in the menus the person is."""

    IDLE = auto()  # No mission: nothing is asked
    MAIN = auto()
    POSITION = auto()
    ALARM_TYPE = auto()
    EQUIPMENT_CODE = auto()
    FUNCTION_CODE = auto()
    ALARM_PARAMETERS = auto()
    BATTERY = auto()
    CAPACITY = auto()
    PERCENTAGE = auto()
    OBSERVATION = auto()
    RESOURCE_ID = auto()
    OBSERVED_PROPERTY = auto()
    RESULT_VALUE = auto()
    RESULT_UOM = auto()
    LANDING = auto()  # After an abort or an alarm


class Choice(NamedTuple):
    """One numbered line of a menu."""

    label: str
    to: Place
    action: Action | None = None
    alarm: Alarm | None = None


class Screen(NamedTuple):
    """One menu; choices are numbered from 1."""

    title: str
    choices: tuple[Choice, ...]
    prompt: str

    @property
    def text(self) -> str:
        """All of it, the prompt at its end."""
        numbered = (f"{n}. {choice.label}" for n, choice in enumerate(self.choices, start=1))
        return "\n".join((self.title, *numbered, self.prompt))


_EQUIPMENT: Final = (
    Alarm.SONAR,
    Alarm.PROPELLERS,
    Alarm.IMU,
    Alarm.CAMERA,
    Alarm.GPS,
    Alarm.HUMIDITY_SENSOR,
)
_FUNCTIONS: Final = (
    Alarm.LOCALIZATION,
    Alarm.PROPULSION,
    Alarm.NAVIGATION,
    Alarm.HUMIDITY_SENSING,
)
_CODE_PROMPT: Final = "------ Enter the selected code number: "


def _codes(alarms: tuple[Alarm, ...]) -> Screen:
    choices = (Choice(a.label, Place.ALARM_PARAMETERS, alarm=a) for a in alarms)
    back = Choice("Back", Place.ALARM_TYPE)
    return Screen("Select the alarm code", (*choices, back), _CODE_PROMPT)


SCREENS: Final[Mapping[Place, Screen]] = {
    Place.MAIN: Screen(
        "Mission running",
        (
            Choice("Set command as finished", Place.MAIN, FinishCommand()),
            Choice("Update position", Place.POSITION),
            Choice("Set alarm", Place.ALARM_TYPE),
            Choice("Update battery level", Place.BATTERY),
            Choice("Update observation info", Place.OBSERVATION),
        ),
        "------ Enter the action number: ",
    ),
    Place.ALARM_TYPE: Screen(
        "Select the alarm type",
        (
            Choice("Equipment failure", Place.EQUIPMENT_CODE),
            Choice("Function unavailable", Place.FUNCTION_CODE),
            Choice("Back", Place.MAIN),
        ),
        "------ Enter the selected type number: ",
    ),
    Place.EQUIPMENT_CODE: _codes(_EQUIPMENT),
    Place.FUNCTION_CODE: _codes(_FUNCTIONS),
    Place.BATTERY: Screen(
        "Select the battery param to change:",
        (
            Choice("Capacity", Place.CAPACITY),
            Choice("Percentage", Place.PERCENTAGE),
            Choice("Back", Place.MAIN),
        ),
        "------ Enter the selected number: ",
    ),
    Place.OBSERVATION: Screen(
        "Select the observation param to change:",
        (
            Choice("Resource id", Place.RESOURCE_ID),
            Choice("Observed property", Place.OBSERVED_PROPERTY),
            Choice("Result value", Place.RESULT_VALUE),
            Choice("Result uom", Place.RESULT_UOM),
            Choice("Back", Place.MAIN),
        ),
        "------ Enter the selected number: ",
    ),
}
INSISTING: Final = frozenset({Place.ALARM_TYPE, Place.EQUIPMENT_CODE, Place.FUNCTION_CODE})
"""Where what is no integer is asked for again, instead of showing the menu again."""
CORRECT_NUMBER: Final = "------ Enter a correct number: "
LANDING_PROMPT: Final = (
    "Enter '0' to set the drone as landed after the mission\nabort/alarm: "  # As the seed breaks it
)
POSITION_PARTS: Final = ("latitude", "longitude", "altitude", "yaw", "pitch", "roll")
POSITION_PROMPT: Final = " - Enter the new {} (if not an int it will be generated\nrandomly): "
ALARM_PROMPTS: Final = (
    "------ Enter the first parameter of the alarm (float): ",
    "------ Enter the second parameter of the alarm (float): ",
)
PERCENTAGE_PROMPT: Final = "------ Enter the new battery percentage (%): "
PERCENTAGE_TRIES: Final = 2


def finite(text: str) -> float:
    """Read a float.

    Raises:
        ValueError: if it is none, or none that counts.
    """
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def _capacity(text: str) -> Action:
    capacity_mah = finite(text)
    if not 0.0 < capacity_mah <= 100_000.0:
        raise ValueError(text)
    return SetBatteryCapacity(capacity_mah)


def _words(part: ObservationPart) -> Callable[[str], Action]:
    def read(text: str) -> Action:
        spelled = json.dumps(text, ensure_ascii=False).encode()
        if not text or not text.isprintable() or len(spelled) > LONGEST_WORDS_BYTES:
            raise ValueError(text)
        return SetObservation(part, text)

    return read


class Question(NamedTuple):
    """One value; what cannot be read leaves everything as it was."""

    prompt: str
    read: Callable[[str], Action]


LONGEST_WORDS_BYTES: Final = 32
"""With its quotes: three of them and a number are to fit into one message."""
QUESTIONS: Final[Mapping[Place, Question]] = {
    Place.CAPACITY: Question("------ Enter the new battery capacity (mAh): ", _capacity),
    Place.RESOURCE_ID: Question(
        "------ Enter the new resource id(string): ", _words(ObservationPart.RESOURCE_ID)
    ),
    Place.OBSERVED_PROPERTY: Question(
        "------ Enter the new observed property(string): ",
        _words(ObservationPart.OBSERVED_PROPERTY),
    ),
    Place.RESULT_VALUE: Question(
        "------ Enter the new result value(float): ",
        lambda text: SetObservation(ObservationPart.RESULT_VALUE, finite(text)),
    ),
    Place.RESULT_UOM: Question(
        "------ Enter the new result uom(string): ", _words(ObservationPart.RESULT_UOM)
    ),
}
