"""The menus as a state machine: a line in, an action and the next prompt out.

Independent of terminal and vehicle; random numbers are an argument.
"""

from collections.abc import Callable
from typing import Final

from sim.tester.terminal.screens import (
    ALARM_PROMPTS,
    CORRECT_NUMBER,
    INSISTING,
    LANDING_PROMPT,
    PERCENTAGE_PROMPT,
    PERCENTAGE_TRIES,
    POSITION_PARTS,
    POSITION_PROMPT,
    QUESTIONS,
    SCREENS,
    Place,
    finite,
)
from sim.tester.vehicle.actions import Action, Land, Pose, SetAlarm, SetBatteryPercentage, SetPose
from sim.tester.vehicle.alarms import Alarm

Draw = Callable[[float, float], float]
"""Gives a random number between two bounds."""

DRAWN_FROM: Final = (0.0, 100.0)
"""Bounds of what is generated in place of a bad answer."""
_LIMITS: Final = {"latitude": 90.0, "longitude": 180.0, "altitude": 100_000.0, "pitch": 90.0}
"""Greatest size of what makes sense; a turn may be any number."""


class Menu:
    """Where one person is in the menus."""

    def __init__(self, draw: Draw, *, percentage: int) -> None:
        self.place = Place.IDLE
        self._draw = draw
        self._percentage = percentage
        self._tries = 0
        self._alarm: Alarm | None = None
        self._entered: list[float] = []
        self.prompt = ""  # What is to be shown before the next line
        self._answers: dict[Place, Callable[[str], Action | None]] = {
            **dict.fromkeys(SCREENS, self._choose),
            **dict.fromkeys(QUESTIONS, self._fill_in),
            Place.POSITION: self._take_position,
            Place.ALARM_PARAMETERS: self._take_alarm_parameter,
            Place.PERCENTAGE: self._take_percentage,
            Place.LANDING: self._take_landing,
        }

    # Notifications of the vehicle.

    def mission_runs(self) -> None:
        """A mission has begun; who is in a menu stays there."""
        if not self.is_asking or self.place is Place.LANDING:
            self._go(Place.MAIN)

    def mission_ended(self) -> None:
        """Nothing is to be done until another mission begins."""
        self._go(Place.IDLE)

    def mission_interrupted(self) -> None:
        """The mission was aborted or has failed: only the landing is left."""
        if self.place is not Place.LANDING:
            self._go(Place.LANDING)

    # What the person's side asks.

    @property
    def is_asking(self) -> bool:
        """Whether a line is waited for."""
        return self.place is not Place.IDLE

    def answer(self, line: str) -> Action | None:
        """Interpret a line; return the action that it requests."""
        return self._answers[self.place](line.strip()) if self.is_asking else None

    def _go(self, place: Place) -> None:
        self.place = place
        self._entered, self._tries = [], 0
        if place in SCREENS:
            self.prompt = SCREENS[place].text
        elif place in QUESTIONS:
            self.prompt = QUESTIONS[place].prompt
        else:
            self.prompt = {
                Place.POSITION: POSITION_PROMPT.format(POSITION_PARTS[0]),
                Place.ALARM_PARAMETERS: ALARM_PROMPTS[0],
                Place.PERCENTAGE: PERCENTAGE_PROMPT,
                Place.LANDING: LANDING_PROMPT,
            }.get(place, "")

    def _choose(self, text: str) -> Action | None:
        choices = SCREENS[self.place].choices
        try:
            number = int(text)
        except ValueError:
            self.prompt = self._ask_again()
            return None
        if not 1 <= number <= len(choices):
            self._go(self.place)
            return None
        choice = choices[number - 1]
        self._alarm = choice.alarm
        self._go(choice.to)
        return choice.action

    def _ask_again(self) -> str:
        return CORRECT_NUMBER if self.place in INSISTING else SCREENS[self.place].text

    def _fill_in(self, text: str) -> Action | None:
        read = QUESTIONS[self.place].read
        self._go(Place.MAIN)
        try:
            return read(text)
        except ValueError:
            return None

    def _take_position(self, text: str) -> Action | None:
        self._entered.append(self._coordinate(text, POSITION_PARTS[len(self._entered)]))
        if len(self._entered) < len(POSITION_PARTS):
            self.prompt = POSITION_PROMPT.format(POSITION_PARTS[len(self._entered)])
            return None
        pose = Pose(*self._entered)
        self._go(Place.MAIN)
        return SetPose(pose)

    def _coordinate(self, text: str, part: str) -> float:
        """Read a number, or draw one; nothing is drawn that is not on the globe."""
        limit = _LIMITS.get(part, DRAWN_FROM[1])
        try:
            value = finite(text)
        except ValueError:
            return self._draw(DRAWN_FROM[0], min(limit, DRAWN_FROM[1]))
        if part in _LIMITS and abs(value) > limit:
            return self._draw(DRAWN_FROM[0], min(limit, DRAWN_FROM[1]))
        return value

    def _take_alarm_parameter(self, text: str) -> Action | None:
        try:
            self._entered.append(finite(text))
        except ValueError:
            self.prompt = ALARM_PROMPTS[len(self._entered)]
            return None
        if len(self._entered) < len(ALARM_PROMPTS) or self._alarm is None:
            self.prompt = ALARM_PROMPTS[len(self._entered)]
            return None
        first, second = self._entered
        self._go(Place.LANDING)
        return SetAlarm(self._alarm, (first, second))

    def _take_percentage(self, text: str) -> Action | None:
        try:
            percentage = int(text)
        except ValueError:
            percentage = self._percentage
        if 0 <= percentage <= 100 and percentage != self._percentage:
            self._percentage = percentage
            self._go(Place.MAIN)
            return SetBatteryPercentage(percentage)
        self._tries += 1
        if self._tries < PERCENTAGE_TRIES:
            self.prompt = PERCENTAGE_PROMPT
        else:
            self._go(Place.BATTERY)
        return None

    def _take_landing(self, text: str) -> Action | None:
        if text != "0":
            self.prompt = LANDING_PROMPT
            return None
        self._go(Place.IDLE)
        return Land()
