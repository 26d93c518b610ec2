"""Borrows parameters of one vehicle: sets what a command needs, gives back what was there.

What is wanted is said anew for every part of a mission; what is wanted no more gets the value back
that it had before the first change, unless somebody else has set it since. One parameter is
written at a time, and only when it has been noted for good what it was: a broker that is killed
gives it back in its next life. What cannot be written is told and left alone; what cannot be given
back is tried again while the vehicle is heard.
"""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, NamedTuple, TypeAlias

from mavlink_broker.mavlink.addressing import Route
from mavlink_broker.mavlink.dialect import Message
from mavlink_broker.microservices.parameter_write import (
    Consent,
    Left,
    ParameterEncoding,
    ParameterWrite,
    Setting,
    Written,
)
from mavlink_broker.microservices.round_trip import RoundTrip

AGAIN_AFTER_S: Final = 10.0

Loan: TypeAlias = Sequence[Setting]
"""One wish in several spellings, newest first: versions of an autopilot name it differently."""

MOST_PLACED: Final = 8

_LOG = logging.getLogger(__name__)


class Borrowed(NamedTuple):
    """A parameter: what it was, and what we have set it to since, or were about to; newest last."""

    before: float
    placed: tuple[float, ...]

    def and_then(self, value: float) -> "Borrowed":
        """Set it to something else."""
        if self.placed and self.placed[-1] == value:
            return self
        others = tuple(placed for placed in self.placed if placed != value)
        return Borrowed(self.before, (*others, value)[-MOST_PLACED:])

    def is_ours(self, held: float) -> bool:
        """Whether a value that a vehicle has is one of ours, as far as its type can tell."""
        return any(is_same(held, placed) or held == round(placed) for placed in self.placed)


def is_same(held: float, value: float) -> bool:
    """Whether a vehicle has a value, to the single precision in which it travels."""
    return math.isclose(held, value, rel_tol=1e-6, abs_tol=1e-6)


def at_once() -> bool:
    """Keep no notes, and wait for none."""
    return True


class ParameterKeeper:
    """What is borrowed of one vehicle."""

    def __init__(self) -> None:
        self._wanted: tuple[Loan, ...] = ()
        self._borrowed: dict[str, Borrowed] = {}  # What is to be given back
        self._is_recalled = False  # From an earlier run, and nobody has said what is wanted now
        self._held: dict[str, float] = {}  # What has been written since
        self._refused: dict[str, str] = {}  # Why, for every spelling that failed
        self._running: tuple[Setting, ParameterWrite] | None = None
        self._not_before = -math.inf

    def want(self, loans: Sequence[Loan]) -> None:
        """Say what is needed from now on, instead of all before; nothing gives everything back."""
        self._is_recalled = False
        if self._wanted == tuple(loans):
            return
        self._wanted = tuple(loans)
        self._held = {name: value for name, value in self._held.items() if name in self._borrowed}
        self._refused = {}
        self._not_before = -math.inf

    def recall(self, borrowed: Mapping[str, Borrowed]) -> None:
        """Learn what an earlier run of the broker has borrowed; it stays until `want` is said."""
        self._borrowed = {**self._borrowed, **borrowed}
        self._is_recalled = bool(borrowed)

    @property
    def is_recalled(self) -> bool:
        """Whether something is kept only because an earlier run may have needed it."""
        return self._is_recalled

    @property
    def borrowed(self) -> Mapping[str, Borrowed]:
        """What is to be given back."""
        return dict(self._borrowed)

    @property
    def is_settled(self) -> bool:
        """Whether everything that is wanted has been set, or cannot be."""
        return all(self._is_set(loan) or self._is_refused(loan) for loan in self._wanted)

    @property
    def is_idle(self) -> bool:
        """Whether nothing is borrowed and nothing wanted."""
        return not (self._wanted or self._borrowed)

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
        is_noted: Callable[[], bool] = at_once,
    ) -> list[Message]:
        """Let time pass; to be called only while the vehicle is heard.

        `is_noted` tells whether what is borrowed now has been written down for good.
        """
        messages: list[Message] = []
        if self._running is not None:
            messages += self._running[1].tick(now)
            self._settle(now)
        if self._running is None and now >= self._not_before:
            setting = self._next()
            if setting is not None:
                consent = partial(self._consent, setting, is_noted)
                write = ParameterWrite(setting, route, round_trip, encoding, consent)
                self._running = setting, write
                messages += write.start(now)
        return messages

    def _next(self) -> Setting | None:
        """Give what is to be written now: what is to go back first, then what is wanted."""
        names = {setting.name for loan in self._wanted for setting in loan}
        for name, borrowed in reversed(self._borrowed.items()):
            if name not in names and not self._is_recalled:
                return Setting(name, borrowed.before)
        for loan in self._wanted:
            if not self._is_set(loan):
                open_ones = (setting for setting in loan if setting.name not in self._refused)
                setting = next(open_ones, None)
                if setting is not None:
                    return setting
        return None

    def _consent(self, setting: Setting, is_noted: Callable[[], bool], previous: float) -> Consent:
        """Say whether a value may go: for what is wanted, once it has been noted; else if ours."""
        borrowed = self._borrowed.get(setting.name)
        if self._wants(setting):
            before = borrowed or Borrowed(previous, ())
            self._borrowed[setting.name] = before.and_then(setting.value)
            return Consent.GIVEN if is_noted() else Consent.AWAITED
        is_ours = borrowed is not None and borrowed.is_ours(previous)
        return Consent.GIVEN if is_ours else Consent.DENIED

    def _wants(self, setting: Setting) -> bool:
        return any(setting in loan for loan in self._wanted)

    def _settle(self, now: float) -> None:
        if self._running is None or self._running[1].outcome is None:
            return
        (setting, write), self._running = self._running, None
        is_wanted = self._wants(setting)
        outcome = write.outcome
        if isinstance(outcome, Written):
            self._written(setting, outcome.previous)
        elif isinstance(outcome, Left):
            self._borrowed.pop(setting.name, None)
        elif is_wanted:
            self._refused[setting.name] = outcome.reason if outcome else ""
            self._keeps_another(setting.name, write.shown)
        else:
            _LOG.warning("not given back yet: %s", outcome.reason if outcome else "")
            self._not_before = now + AGAIN_AFTER_S

    def _keeps_another(self, name: str, shown: float | None) -> None:
        """Note what a vehicle has made of a value that it did not take as it was."""
        borrowed = self._borrowed.get(name)
        if borrowed is None or shown is None:
            return
        if is_same(shown, borrowed.before):
            del self._borrowed[name]
        else:
            self._borrowed[name] = borrowed.and_then(shown)

    def _written(self, setting: Setting, previous: float) -> None:
        """Note what it is now; what is as it was before is borrowed no more."""
        borrowed = self._borrowed.get(setting.name) or Borrowed(previous, ())
        self._borrowed[setting.name] = borrowed.and_then(setting.value)
        self._held[setting.name] = setting.value
        if setting.value == borrowed.before:
            del self._borrowed[setting.name]

    def _is_set(self, loan: Loan) -> bool:
        return any(self._held.get(setting.name) == setting.value for setting in loan)

    def _is_refused(self, loan: Loan) -> bool:
        return all(setting.name in self._refused for setting in loan)
