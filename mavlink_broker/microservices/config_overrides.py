"""Overrides the configuration of a vehicle for a mission and restores parameters afterwards.

The requested overrides are set for each part of a mission. A parameter that is no longer requested
gets back its value from before the first change, unless another client has changed it since. One
parameter is written at a time, and only after its original value is saved on the disk, so that a
killed broker restores it in its next run. A parameter that cannot be written is reported and not
retried; one that cannot be restored is retried while the vehicle is received.
"""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Final, NamedTuple, TypeAlias

from mavlink_broker.mavlink.dialect import Message, Route
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.command import RoundTrip
from mavlink_broker.microservices.parameter import (
    Limit,
    NotOverwritten,
    ParameterEncoding,
    ParameterWrite,
    Permission,
    Setting,
    Written,
)

RETRY_INTERVAL_S: Final = 10.0

ParameterOverride: TypeAlias = Sequence[Setting]
"""One override under each parameter name that firmware versions use, newest version first."""

MAX_PLACED: Final = 8

_LOG = logging.getLogger(__name__)


class OverriddenParameter(NamedTuple):
    """A parameter's original value, and the values that we set or were about to; newest last."""

    before: float
    placed: tuple[float, ...]

    def with_value(self, value: float) -> "OverriddenParameter":
        """Return it with one more value that we set."""
        if self.placed and self.placed[-1] == value:
            return self
        others = tuple(placed for placed in self.placed if placed != value)
        return OverriddenParameter(self.before, (*others, value)[-MAX_PLACED:])

    def with_setting(self, setting: Setting) -> "OverriddenParameter":
        """Return it with the value that we set; a limit does not raise the original one."""
        is_lower = isinstance(setting, Limit) and self.before < setting.value
        return self.with_value(self.before if is_lower else setting.value)

    def is_ours(self, held: float) -> bool:
        """Whether a vehicle's value is one that we set, within the precision of its type."""
        return any(is_same(held, placed) or held == round(placed) for placed in self.placed)


def is_same(held: float, value: float) -> bool:
    """Whether two values are equal in single precision, in which they are sent."""
    return math.isclose(held, value, rel_tol=1e-6, abs_tol=1e-6)


class ParameterOverrider:
    """Sets and restores the parameters of one vehicle."""

    def __init__(self) -> None:
        self._requested: tuple[ParameterOverride, ...] = ()
        self._overridden: dict[str, OverriddenParameter] = {}  # To be restored
        self.is_loaded = False
        """Whether overrides of an earlier run are kept because they may still be needed."""
        self._written_values: dict[str, float] = {}
        self._refused: dict[str, str] = {}  # Reason, for every name that failed
        self._running: tuple[Setting, ParameterWrite] | None = None
        self._not_before = -math.inf

    def set_overrides(self, overrides: Sequence[ParameterOverride]) -> None:
        """Request these overrides instead of all earlier ones; none restores everything.

        What was requested before and still is counts as set.
        """
        self.is_loaded = False
        if self._requested == tuple(overrides):
            return
        both = set(self._requested) & set(overrides)
        self._requested = tuple(overrides)
        kept = {setting.name for override in both for setting in override} | self._overridden.keys()
        self._written_values = {
            name: value for name, value in self._written_values.items() if name in kept
        }
        self._refused = {}
        self._not_before = -math.inf

    def load(self, overridden: Mapping[str, OverriddenParameter]) -> None:
        """Take what an earlier run has overridden; it stays until `set_overrides` is called."""
        self._overridden = {**self._overridden, **overridden}
        self.is_loaded = bool(overridden)

    @property
    def overridden(self) -> Mapping[str, OverriddenParameter]:
        """Parameters to be restored, by name."""
        return dict(self._overridden)

    @property
    def is_settled(self) -> bool:
        """Whether every requested override is set or has failed."""
        return all(
            self._is_set(override) or self._is_refused(override) for override in self._requested
        )

    @property
    def is_idle(self) -> bool:
        """Whether nothing is overridden and nothing requested."""
        return not (self._requested or self._overridden)

    @property
    def refusals(self) -> Mapping[str, str]:
        """Reasons of failed overrides, by their first parameter name."""
        return {
            override[0].name: self._refused[override[-1].name]
            for override in self._requested
            if self._is_refused(override)
        }

    def receive(self, message: Message, now: float) -> list[Message]:
        """Handle a message of the vehicle."""
        if self._running is None:
            return []
        return self._running[1].receive(message, now)

    def tick(
        self,
        now: float,
        route: Route,
        round_trip: RoundTrip,
        encoding: ParameterEncoding,
        is_saved: Callable[[], bool],
    ) -> list[Message]:
        """Do what is due at a time; to be called only while the vehicle is received.

        `is_saved` returns whether `overridden` is saved on the disk.
        """
        messages: list[Message] = []
        if self._running is not None:
            messages += self._running[1].tick(now)
            self._settle(now)
        if self._running is None and now >= self._not_before:
            setting = self._next()
            if setting is not None:
                permission = partial(self._permission, setting, is_saved)
                placed = self._within_original(setting)
                write = ParameterWrite(placed, route, round_trip, encoding, permission)
                self._running = setting, write
                messages += write.start(now)
        return messages

    def _next(self) -> Setting | None:
        """Return what to write now: first values to restore, then requested overrides."""
        names = {setting.name for override in self._requested for setting in override}
        for name, overridden in reversed(self._overridden.items()):
            if name not in names and not self.is_loaded:
                return Setting(name, overridden.before)
        for override in self._requested:
            if not self._is_set(override):
                open_ones = (setting for setting in override if setting.name not in self._refused)
                setting = next(open_ones, None)
                if setting is not None:
                    return setting
        return None

    def _within_original(self, setting: Setting) -> Setting:
        """Give what to write: a limit does not raise a value that was lower before."""
        overridden = self._overridden.get(setting.name)
        if overridden is None or not isinstance(setting, Limit):
            return setting
        return setting._replace(value=min(setting.value, overridden.before))

    def _permission(
        self, setting: Setting, is_saved: Callable[[], bool], previous: float
    ) -> Permission:
        """Permit a requested value once the original is saved, a restore if the value is ours.

        A vehicle whose own value is within a requested limit keeps that.
        """
        overridden = self._overridden.get(setting.name)
        if self._is_requested(setting):
            is_within = isinstance(setting, Limit) and previous <= setting.value
            if overridden is None and is_within:
                return Permission.DENIED
            before = overridden or OverriddenParameter(previous, ())
            self._overridden[setting.name] = before.with_setting(setting)
            return Permission.GRANTED if is_saved() else Permission.PENDING
        is_ours = overridden is not None and overridden.is_ours(previous)
        return Permission.GRANTED if is_ours else Permission.DENIED

    def _is_requested(self, setting: Setting) -> bool:
        return any(setting in override for override in self._requested)

    def _settle(self, now: float) -> None:
        if self._running is None or self._running[1].outcome is None:
            return
        (setting, write), self._running = self._running, None
        is_wanted = self._is_requested(setting)
        outcome = write.outcome
        if isinstance(outcome, Written):
            self._written(setting, outcome.previous)
        elif isinstance(outcome, NotOverwritten) and is_wanted:
            self._written_values[setting.name] = setting.value  # It is within this limit
        elif isinstance(outcome, NotOverwritten):
            self._overridden.pop(setting.name, None)
        elif is_wanted:
            self._refused[setting.name] = outcome.reason if outcome else ""
            self._record_other_value(setting.name, write.reported_value)
        else:
            _LOG.warning("not restored yet: %s", outcome.reason if outcome else "")
            self._not_before = now + RETRY_INTERVAL_S

    def _record_other_value(self, name: str, reported_value: float | None) -> None:
        """Record the value that a vehicle has stored instead of the requested one.

        The original value may be a late answer of before the write, which the vehicle obeys yet:
        it is read again when the override ends.
        """
        overridden = self._overridden.get(name)
        if overridden is None or reported_value is None:
            return
        if not is_same(reported_value, overridden.before):
            self._overridden[name] = overridden.with_value(reported_value)

    def _written(self, setting: Setting, previous: float) -> None:
        """Record the written value; a parameter with its original value is restored."""
        overridden = self._overridden.get(setting.name) or OverriddenParameter(previous, ())
        overridden = overridden.with_setting(setting)
        self._overridden[setting.name] = overridden
        self._written_values[setting.name] = setting.value
        if overridden.placed[-1] == overridden.before:
            del self._overridden[setting.name]

    def _is_set(self, override: ParameterOverride) -> bool:
        return any(self._written_values.get(setting.name) == setting.value for setting in override)

    def _is_refused(self, override: ParameterOverride) -> bool:
        return all(setting.name in self._refused for setting in override)


Items = tuple[MissionItem, ...]


class OverriddenPlan(NamedTuple):
    """A geofence or rally points: the original items and ours."""

    before: Items
    placed: Items | None  # None: a transfer has failed and the stored items are not known


@dataclass(slots=True)
class VehicleOverrides:
    """What a mission's geofence has overridden on one vehicle; plans by MAV_MISSION_TYPE."""

    plans: dict[int, OverriddenPlan] = field(default_factory=dict)
    values: dict[str, OverriddenParameter] = field(default_factory=dict)

    @property
    def is_open(self) -> bool:
        """Whether anything is still to be restored."""
        return bool(self.plans or self.values)

    def assume(self, kind: int, items: Items) -> None:
        """Assume that an earlier run has uploaded these items where there were none."""
        if items and kind not in self.plans:
            self.plans[kind] = OverriddenPlan((), items)
