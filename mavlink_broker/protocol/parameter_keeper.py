"""Borrows parameters of one vehicle: sets what a command needs, gives back what was there.

What is wanted is said anew for every part of a mission; what is wanted no more gets the value back
that it had before the first change. One parameter is written at a time. What cannot be written is
told and left alone; what cannot be given back is tried again while the vehicle is heard.
"""

import logging
import math
from collections.abc import Mapping, Sequence
from typing import Final, TypeAlias

from mavlink_broker.dialect import Message
from mavlink_broker.protocol.parameter_write import (
    ParameterEncoding,
    ParameterWrite,
    Setting,
    Written,
)
from mavlink_broker.protocol.round_trip import RoundTrip
from mavlink_broker.protocol.route import Route

AGAIN_AFTER_S: Final = 10.0

Loan: TypeAlias = Sequence[Setting]
"""One wish in several spellings, newest first: versions of an autopilot name it differently."""

_LOG = logging.getLogger(__name__)


class ParameterKeeper:
    """What is borrowed of one vehicle."""

    def __init__(self) -> None:
        self._wanted: tuple[Loan, ...] = ()
        self._before: dict[str, float] = {}  # What is to be given back
        self._held: dict[str, float] = {}  # What has been written since
        self._refused: dict[str, str] = {}  # Why, for every spelling that failed
        self._running: tuple[Setting, ParameterWrite] | None = None
        self._not_before = -math.inf

    def want(self, loans: Sequence[Loan]) -> None:
        """Say what is needed from now on, instead of all before; nothing gives everything back."""
        if self._wanted == tuple(loans):
            return
        self._wanted = tuple(loans)
        self._held = {name: value for name, value in self._held.items() if name in self._before}
        self._refused = {}
        self._not_before = -math.inf

    @property
    def is_settled(self) -> bool:
        """Whether everything that is wanted has been set, or cannot be."""
        return all(self._is_set(loan) or self._is_refused(loan) for loan in self._wanted)

    @property
    def is_idle(self) -> bool:
        """Whether nothing is borrowed and nothing wanted."""
        return not (self._wanted or self._before)

    @property
    def refusals(self) -> Mapping[str, str]:
        """Why a wish was not granted, by the name of its first spelling."""
        return {
            loan[0].name: self._refused[loan[-1].name]
            for loan in self._wanted
            if self._is_refused(loan)
        }

    def receive(self, message: Message, now: float) -> list[Message]:
        """Take a message of the vehicle."""
        if self._running is None or not message.get_type().startswith("PARAM_"):
            return []
        return self._running[1].receive(message, now)

    def tick(
        self,
        now: float,
        route: Route,
        round_trip: RoundTrip,
        encoding: ParameterEncoding,
    ) -> list[Message]:
        """Let time pass; to be called only while the vehicle is heard."""
        messages: list[Message] = []
        if self._running is not None:
            messages += self._running[1].tick(now)
            self._settle(now)
        if self._running is None and now >= self._not_before:
            setting = self._next()
            if setting is not None:
                write = ParameterWrite(setting, route, round_trip, encoding)
                self._running = setting, write
                messages += write.start(now)
        return messages

    def _next(self) -> Setting | None:
        """Give what is to be written now: what is to go back first, then what is wanted."""
        names = {setting.name for loan in self._wanted for setting in loan}
        for name, value in reversed(self._before.items()):
            if name not in names:
                return Setting(name, value)
        for loan in self._wanted:
            if not self._is_set(loan):
                open_ones = (setting for setting in loan if setting.name not in self._refused)
                setting = next(open_ones, None)
                if setting is not None:
                    return setting
        return None

    def _settle(self, now: float) -> None:
        if self._running is None or self._running[1].outcome is None:
            return
        (setting, write), self._running = self._running, None
        is_wanted = any(setting in loan for loan in self._wanted)
        outcome = write.outcome
        if isinstance(outcome, Written):
            self._written(setting, outcome.previous)
        elif is_wanted:
            self._refused[setting.name] = outcome.reason if outcome else ""
        else:
            _LOG.warning("not given back yet: %s", outcome.reason if outcome else "")
            self._not_before = now + AGAIN_AFTER_S

    def _written(self, setting: Setting, previous: float) -> None:
        """Note what it is now; what is as it was before is borrowed no more."""
        before = self._before.setdefault(setting.name, previous)
        self._held[setting.name] = setting.value
        if setting.value == before:
            del self._before[setting.name]

    def _is_set(self, loan: Loan) -> bool:
        return any(self._held.get(setting.name) == setting.value for setting in loan)

    def _is_refused(self, loan: Loan) -> bool:
        return all(setting.name in self._refused for setting in loan)
