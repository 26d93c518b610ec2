"""The failsafe machine: which causes are present, and the action for the worst of them.

    CLEAR    --a cause demands more, deferred----------> WAITING   hold; COM_FAIL_ACT_T runs
    CLEAR    --a cause demands more, at once-----------> ACTING
    WAITING  --no cause demands more-------------------> CLEAR     the intended mode continues
    WAITING  --the time has passed---------------------> ACTING
    WAITING  --a stronger or an urgent cause-----------> ACTING
    WAITING, ACTING --the operator chooses a mode------> CLEAR     present causes are overridden
    ACTING   --a cause demands more--------------------> ACTING
    any      --disarmed--------------------------------> CLEAR

The action is selected at every update from all causes that are present and not overridden, as
PX4's failsafe framework does: a cause whose action was weaker than another one's acts when that
one clears. A cause demands more if its action is stronger than the present or the pending one.
An overridden cause acts again only after it has cleared.
"""

from collections.abc import Iterable, Sequence
from enum import Enum, auto
from typing import NamedTuple

from uav_firmware.modules.commander import mode_requirements
from uav_firmware.modules.commander.arm_state_machine import ArmingEvent
from uav_firmware.modules.commander.failsafe.causes import ROWS, Cause, Conditions
from uav_firmware.modules.commander.failsafe.params import FailsafeParams
from uav_firmware.modules.commander.failsafe.return_time import ReturnSpeeds
from uav_firmware.modules.commander.failsafe_actions import (
    DEFERRED,
    MODE_OF,
    Action,
    strength_of,
)
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.status import NavigationState


class Failsafe(Enum):
    """State of the machine."""

    CLEAR = auto()  # The intended mode is flown
    WAITING = auto()  # In hold, before the action
    ACTING = auto()  # A failsafe's mode is flown


class Threat(NamedTuple):
    """A cause and the action that it demands."""

    cause: Cause
    action: Action


class Reaction(NamedTuple):
    """Result of one update."""

    threats: Sequence[Threat] = ()  # New ones, worst first
    cleared: Sequence[Cause] = ()
    mode: NavigationState | None = None  # To change to
    event: ArmingEvent | None = None  # Stops the motors
    stays_low: bool = False  # The mode is a return, and the wind is too strong


class FailsafeMachine:
    """Holds the present causes, the mode that the operator intends, and the pending action."""

    def __init__(self) -> None:
        self.state = Failsafe.CLEAR
        self.return_speeds = ReturnSpeeds()
        self._intended = NavigationState.AUTO_LOITER
        self._since_us: dict[Cause, int] = {}  # Start of each condition that holds
        self._ended_us: dict[Cause, int] = {}  # End of the condition of each cause that clears
        self._cleared: frozenset[Cause] = frozenset()  # By `override`, not yet returned
        self._present: frozenset[Cause] = frozenset()
        self._overridden: frozenset[Cause] = frozenset()
        self._taken = Action.NONE  # While ACTING
        self._pending = Action.NONE  # While WAITING: the strongest so far
        self._due_us = 0

    def override(self) -> None:
        """Override the present causes: the operator has chosen a mode.

        A cause whose condition has ended is over then, so that it acts when it comes back.
        """
        self.state = Failsafe.CLEAR
        self._cleared = frozenset(self._ended_us)
        self._ended_us.clear()
        self._present -= self._cleared
        self._overridden = self._present

    def clear(self) -> None:
        """Reset, at arming and disarming."""
        self.state = Failsafe.CLEAR
        self._since_us.clear()
        self._ended_us.clear()
        self._present = self._overridden = self._cleared = frozenset()

    def update(
        self, view: VehicleView, params: FailsafeParams, flown: NavigationState, airborne_s: float
    ) -> Reaction:
        """Evaluate all causes once, in the air; `flown` is the present mode."""
        if self.state is Failsafe.CLEAR:
            self._intended = flown
        moment = Conditions(view, params, self._intended, airborne_s, self.return_speeds)
        before = self._present
        self._present = self._evaluate(moment)
        self._overridden &= self._present
        threats = _worst_first(self._present - before, moment)
        cleared = tuple((before | self._cleared) - self._present)
        self._cleared = frozenset()
        asking = _worst_first(self._present - self._overridden, moment)
        demands = [threat for threat in asking if threat.action > Action.WARN]
        reaction = self._react(demands, moment, flown)
        return reaction._replace(threats=threats, cleared=cleared)

    def _evaluate(self, moment: Conditions) -> frozenset[Cause]:
        """Causes whose condition has held for their delay, and those not yet cleared."""
        now_us, since, present = moment.view.now_us, self._since_us, []
        former = self._present  # Mostly empty, as is `since`: a look into it takes longer
        for cause, row in ROWS.items():
            if not row.holds(moment, bool(former) and cause in former):
                if since:
                    since.pop(cause, None)
                if former and self._clears_later(cause, moment):
                    present.append(cause)
            elif now_us - since.setdefault(cause, now_us) >= row.delay_s(moment.params) * 1e6:
                present.append(cause)
                if former:
                    self._ended_us.pop(cause, None)
        return frozenset(present)

    def _clears_later(self, cause: Cause, moment: Conditions) -> bool:
        """Whether a cause without its condition is still present; an overridden one is not."""
        now_us, ended = moment.view.now_us, self._ended_us
        if cause in self._present and cause not in self._overridden:
            wait_us = ROWS[cause].clears_s(moment.params) * 1e6
            if now_us - ended.setdefault(cause, now_us) < wait_us:
                return True
        ended.pop(cause, None)
        return False

    def _react(
        self, demands: Sequence[Threat], moment: Conditions, flown: NavigationState
    ) -> Reaction:
        worst = demands[0].action if demands else Action.NONE
        if self.state is Failsafe.ACTING:
            stronger = worst > max(strength_of(flown), self._taken)
            return self._act(worst, moment) if stronger else Reaction()
        if worst <= strength_of(self._intended):
            return self._resume(moment) if self.state is Failsafe.WAITING else Reaction()
        deferred = all(_may_wait(demand) for demand in demands if demand.action is worst)
        if self.state is Failsafe.WAITING:
            worse = worst > self._pending
            due = moment.view.now_us >= self._due_us
            return self._act(worst, moment) if worse or due or not deferred else Reaction()
        if not (deferred and self._can_wait(moment)):
            return self._act(worst, moment)
        self.state = Failsafe.WAITING
        self._pending = worst
        self._due_us = moment.view.now_us + round(moment.params.action_delay_s * 1e6)
        return Reaction(mode=NavigationState.AUTO_LOITER)

    def _can_wait(self, moment: Conditions) -> bool:
        """Whether the vehicle can hold until the operator reacts."""
        holds = mode_requirements.missing(NavigationState.AUTO_LOITER, moment.view) is None
        return holds and moment.params.action_delay_s > 0.0

    def _resume(self, moment: Conditions) -> Reaction:
        """Change back to the intended mode, if it can be flown."""
        self.state = Failsafe.CLEAR
        missing = mode_requirements.missing(self._intended, moment.view)
        return Reaction(mode=self._intended if missing is None else None)

    def _act(self, action: Action, moment: Conditions) -> Reaction:
        """Start an action; a mode that cannot be flown becomes a landing."""
        if action is Action.DISARM:
            return Reaction(event=ArmingEvent.FAILSAFE)
        if action is Action.TERMINATE:
            return Reaction(event=ArmingEvent.TERMINATED)
        mode = MODE_OF[action]
        self.state = Failsafe.ACTING
        self._taken = action
        if mode_requirements.missing(mode, moment.view) is not None:
            return Reaction(mode=NavigationState.AUTO_LAND)
        windy = Cause.WIND_TOO_STRONG in self._present
        return Reaction(mode=mode, stays_low=windy and mode is NavigationState.AUTO_RTL)


def _worst_first(causes: Iterable[Cause], moment: Conditions) -> list[Threat]:
    threats = (Threat(cause, ROWS[cause].action(moment)) for cause in causes)
    return sorted(threats, key=lambda threat: threat.action, reverse=True)


def _may_wait(threat: Threat) -> bool:
    return threat.action in DEFERRED and not ROWS[threat.cause].urgent


class FailureLatch:
    """Failures of former flights that prevent the next arming: their texts, oldest first.

    A failure that shows in flight and not on the ground, such as a gyroscope that recovers at
    rest, is kept until a restart or until the operator acknowledges it by COM_FAIL_ACK. Failed
    motors and crashes are latched by failure_detector.
    """

    def __init__(self) -> None:
        self.texts: tuple[str, ...] = ()

    def note(self, causes: Iterable[Cause]) -> None:
        """Add those causes of a failsafe that are latched."""
        for cause in causes:
            row = ROWS[cause]
            if row.latched and row.text not in self.texts:
                self.texts = (*self.texts, row.text)

    def clear(self) -> None:
        """Drop all: the operator has acknowledged them."""
        self.texts = ()
