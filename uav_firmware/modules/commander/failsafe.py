"""Failsafes: each cause asks for an action, the worst action wins.

An action is taken when it first becomes the worst one, so that an operator may overrule it
afterwards; a cause that has cleared and comes back counts as new.
"""

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Final, NamedTuple

from uav_firmware.modules.commander import mode_requirements
from uav_firmware.modules.commander.params import CommanderParams
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.status import NavigationState

_HYSTERESIS: Final = 0.02  # of a full battery: a sagging voltage does not chatter


class Action(IntEnum):
    """What a failsafe does; a greater one is worse."""

    NONE = 0
    WARN = 1
    HOLD = 2
    RETURN = 3
    LAND = 4


class Cause(IntEnum):
    """What can go wrong."""

    LINK_LOST = 0
    BATTERY_LOW = 1
    BATTERY_CRITICAL = 2
    BATTERY_EMERGENCY = 3
    POSITION_LOST = 4


MODE_OF: Final[Mapping[Action, NavigationState]] = {
    Action.HOLD: NavigationState.AUTO_LOITER,
    Action.RETURN: NavigationState.AUTO_RTL,
    Action.LAND: NavigationState.AUTO_LAND,
}

TEXT_OF: Final[Mapping[Cause, str]] = {
    Cause.LINK_LOST: "Ground station link lost",
    Cause.BATTERY_LOW: "Battery low",
    Cause.BATTERY_CRITICAL: "Battery critical",
    Cause.BATTERY_EMERGENCY: "Battery emergency",
    Cause.POSITION_LOST: "Position lost",
}

_LINK_ACTIONS: Final = (Action.NONE, Action.HOLD, Action.RETURN, Action.LAND)


class Threat(NamedTuple):
    """A cause that is present and what it asks for."""

    cause: Cause
    action: Action


class FailsafeMonitor:
    """Which causes are present; each clears by its own condition."""

    def __init__(self) -> None:
        self._active: frozenset[Cause] = frozenset()
        self._position_good_us = 0

    def update(self, view: VehicleView, params: CommanderParams) -> list[Threat]:
        """Threats that have just appeared, worst first."""
        if view.position_valid or self._position_good_us == 0:
            self._position_good_us = view.now_us
        present = {cause for cause in Cause if self._present(cause, view, params)}
        new = present - self._active
        self._active = frozenset(present)
        threats = [Threat(cause, action_of(cause, params)) for cause in new]
        return sorted(threats, key=lambda threat: threat.action, reverse=True)

    def worst(self, params: CommanderParams) -> Action:
        """Action of the worst cause that is present."""
        return max((action_of(cause, params) for cause in self._active), default=Action.NONE)

    def clear(self) -> None:
        """Forget all, at disarming."""
        self._active = frozenset()
        self._position_good_us = 0

    def _present(self, cause: Cause, view: VehicleView, params: CommanderParams) -> bool:
        if cause is Cause.LINK_LOST:
            silent = params.link_loss_s < view.ages.link < math.inf  # heard at least once
            return params.link_loss_action > 0 and silent
        if cause is Cause.POSITION_LOST:
            lost_us = view.now_us - self._position_good_us
            return lost_us > params.position_loss_s * 1e6
        if view.battery is None:
            return False
        threshold = {
            Cause.BATTERY_LOW: params.battery_low,
            Cause.BATTERY_CRITICAL: params.battery_critical,
            Cause.BATTERY_EMERGENCY: params.battery_emergency,
        }[cause]
        return view.battery.remaining < threshold + (_HYSTERESIS if cause in self._active else 0.0)


def mode_against(
    threats: Sequence[Threat], flown: NavigationState, view: VehicleView
) -> NavigationState | None:
    """Mode that the worst of the threats asks for; None when what is flown is as strong.

    What cannot be flown becomes a landing.
    """
    action = max((threat.action for threat in threats), default=Action.NONE)
    present = max((act for act, mode in MODE_OF.items() if mode is flown), default=Action.NONE)
    if action not in MODE_OF or action <= present:
        return None
    mode = MODE_OF[action]
    if mode_requirements.missing(mode, view) is None:
        return mode
    return NavigationState.AUTO_LAND if present < Action.LAND else None


def action_of(cause: Cause, params: CommanderParams) -> Action:
    """What a cause asks for."""
    if cause is Cause.LINK_LOST:
        return _LINK_ACTIONS[params.link_loss_action]
    return _ACTIONS[cause]


_ACTIONS: Final[Mapping[Cause, Action]] = {
    Cause.BATTERY_LOW: Action.WARN,
    Cause.BATTERY_CRITICAL: Action.RETURN,
    Cause.BATTERY_EMERGENCY: Action.LAND,
    Cause.POSITION_LOST: Action.LAND,
}
