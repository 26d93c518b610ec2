"""The failsafe machine: which causes are present, and the action for the worst of them.

    CLEAR    --a cause demands more, deferred----------> WAITING   hold; COM_FAIL_ACT_T runs
    CLEAR    --a cause demands more, at once-----------> ACTING
    WAITING  --no cause demands more-------------------> CLEAR     the intended mode continues
    WAITING  --no cause demands more than before it----> ACTING    the former action continues
    WAITING  --the time has passed---------------------> ACTING
    WAITING  --a stronger or an urgent cause-----------> ACTING
    WAITING, ACTING --the operator chooses a mode------> CLEAR     present causes are overridden
    ACTING   --it holds or a pilot flies; more, deferred--> WAITING
    ACTING   --a cause demands more, at once-----------> ACTING
    any      --disarmed--------------------------------> CLEAR

The action is selected at every update from all causes that are present and not overridden, as
PX4's failsafe framework does: a cause whose action was weaker than another one's acts when that
one clears. A cause demands more if its action is stronger than the present or the pending one.
An overridden cause acts again only after it has cleared.

A failsafe's mode relies on sensors and sticks that the intended mode may do without. So what a
cause demands is judged by the mode that is flown; whether a wait may end without an action, by
the mode that would continue.
"""

from collections.abc import Iterable, Sequence
from enum import Enum, auto
from typing import Final, NamedTuple

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

_WAIT_MODE: Final = NavigationState.AUTO_LOITER


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

    threats: Sequence[Threat] = ()  # New ones, worst first; then those that now demand more
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
        self._actions: dict[Cause, Action] = {}  # Of the present causes
        self._taken = Action.NONE  # While ACTING, and while WAITING the one before it
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
            self._taken = Action.NONE
        moment = Conditions(view, params, self._intended, flown, airborne_s, self.return_speeds)
        before = self._present
        self._present = self._evaluate(moment)
        threats = _worst_first(self._present, moment)
        # A cause that only warns in this mode has not been overridden in those where it acts
        self._overridden &= {threat.cause for threat in threats if threat.action > Action.WARN}
        cleared = tuple((before | self._cleared) - self._present)
        self._cleared = frozenset()
        asking = _worst_first(self._present - self._overridden, moment)
        new = [threat for threat in threats if threat.cause not in before]
        new += [
            threat for threat in asking if threat.cause in before and self._rises(threat, flown)
        ]
        self._actions = dict(threats)
        reaction = self._react(asking, moment)
        return reaction._replace(threats=new, cleared=cleared)

    def _rises(self, threat: Threat, flown: NavigationState) -> bool:
        """Whether a present cause demands more than at the last update, and than what is flown."""
        more = threat.action > self._actions.get(threat.cause, Action.NONE)
        return more and threat.action > self._in_force(flown)

    def _in_force(self, mode: NavigationState) -> Action:
        """Action that a mode already is, or that has led to it."""
        return max(strength_of(mode), self._taken)

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

    def _react(self, asking: Sequence[Threat], moment: Conditions) -> Reaction:
        worst = _worst(asking)
        if self.state is Failsafe.WAITING:
            demanded = self._demanded_in(self._continues, asking, moment)
            if demanded <= self._in_force(self._continues):
                return self._resume(moment)
            worst = max(worst, demanded)
        elif worst <= self._in_force(moment.flown):
            return Reaction()
        deferred = all(_may_wait(threat) for threat in asking if threat.action is worst)
        if self.state is Failsafe.WAITING:
            worse = worst > self._pending
            due = moment.view.now_us >= self._due_us
            return self._act(worst, moment) if worse or due or not deferred else Reaction()
        # A return or landing that is flown has had its wait
        if self._taken > Action.HOLD or not (deferred and self._can_wait(moment)):
            return self._act(worst, moment)
        self.state = Failsafe.WAITING
        # A cause that demands more because of the hold is no reason to end it early
        self._pending = max(worst, self._demanded_in(_WAIT_MODE, asking, moment))
        self._due_us = moment.view.now_us + round(moment.params.action_delay_s * 1e6)
        return Reaction(mode=_WAIT_MODE)

    @property
    def _continues(self) -> NavigationState:
        """Mode that continues when a wait ends without an action."""
        return MODE_OF.get(self._taken, self._intended)

    def _demanded_in(
        self, mode: NavigationState, asking: Iterable[Threat], moment: Conditions
    ) -> Action:
        """Action that the causes would demand if `mode` were flown."""
        there = moment._replace(flown=mode)
        causes = (cause for cause, _ in asking if self._would_stay(cause, there))
        return _worst(_worst_first(causes, there))

    def _would_stay(self, cause: Cause, there: Conditions) -> bool:
        """Whether a present cause would be present there; one that clears has no condition."""
        return cause in self._ended_us or ROWS[cause].holds(there, cause in self._present)

    def _can_wait(self, moment: Conditions) -> bool:
        """Whether the vehicle can hold until the operator reacts."""
        holds = mode_requirements.missing(_WAIT_MODE, moment.view) is None
        return holds and moment.params.action_delay_s > 0.0

    def _resume(self, moment: Conditions) -> Reaction:
        """Change back to the mode before the wait, if it can be flown."""
        mode = self._continues
        self.state = Failsafe.CLEAR if self._taken is Action.NONE else Failsafe.ACTING
        missing = mode_requirements.missing(mode, moment.view)
        return Reaction(mode=mode if missing is None else None)

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


def _worst(threats: Iterable[Threat]) -> Action:
    """The strongest action beyond a warning."""
    return max((action for _, action in threats if action > Action.WARN), default=Action.NONE)


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
