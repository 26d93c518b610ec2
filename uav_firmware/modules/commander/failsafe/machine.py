"""The failsafe machine: which causes are present, and what is done about the worst.

    CLEAR    --a cause asks for more, deferred---------> WAITING   hold; COM_FAIL_ACT_T runs
    CLEAR    --a cause asks for more, at once----------> ACTING
    WAITING  --no cause asks for more any longer-------> CLEAR     the intended mode goes on
    WAITING  --the time is over------------------------> ACTING
    WAITING  --a worse or an urgent cause asks---------> ACTING
    WAITING, ACTING --the operator chooses a mode------> CLEAR     what is present is overruled
    ACTING   --a cause asks for more-------------------> ACTING
    any      --disarmed--------------------------------> CLEAR

The action is selected anew at every look, over all causes that are present and not overruled, as
PX4's failsafe framework does: a cause whose action was covered by another one takes over when
that one clears. A cause asks for more if its action is stronger than what is flown or waited for.
An overruled cause acts again only after it has cleared.
"""

from collections.abc import Iterable, Sequence
from enum import Enum, auto
from typing import NamedTuple

from uav_firmware.modules.commander.arming.arming_states import ArmingEvent
from uav_firmware.modules.commander.failsafe.actions import (
    DEFERRED,
    MODE_OF,
    Action,
    strength_of,
)
from uav_firmware.modules.commander.failsafe.causes import ROWS, Cause, Moment
from uav_firmware.modules.commander.failsafe.params import FailsafeParams
from uav_firmware.modules.commander.failsafe.return_time import ReturnPace
from uav_firmware.modules.commander.modes import requirements
from uav_firmware.modules.commander.vehicle_view import VehicleView
from uav_firmware.msg.status import NavigationState


class Failsafe(Enum):
    """Where the machine stands."""

    CLEAR = auto()  # The intended mode is flown
    WAITING = auto()  # In hold, before the action
    ACTING = auto()  # A failsafe's mode is flown


class Threat(NamedTuple):
    """A cause that has appeared and what it asks for."""

    cause: Cause
    action: Action


class Reaction(NamedTuple):
    """What comes of one look at the vehicle."""

    threats: Sequence[Threat] = ()  # New ones, worst first
    cleared: Sequence[Cause] = ()
    mode: NavigationState | None = None  # To be flown from now on
    event: ArmingEvent | None = None  # Stops the motors


class FailsafeMachine:
    """Present causes, the mode that the operator intends, and the action that waits."""

    def __init__(self) -> None:
        self.state = Failsafe.CLEAR
        self.pace = ReturnPace()
        self._intended = NavigationState.AUTO_LOITER
        self._since_us: dict[Cause, int] = {}  # Conditions that hold, and since when
        self._present: frozenset[Cause] = frozenset()
        self._overruled: frozenset[Cause] = frozenset()
        self._taken = Action.NONE  # While ACTING
        self._awaited = Action.NONE  # While WAITING: the strongest so far
        self._due_us = 0

    def overrule(self) -> None:
        """The operator has chosen a mode: what is present now shall not act again."""
        self.state = Failsafe.CLEAR
        self._overruled = self._present

    def clear(self) -> None:
        """Forget all, at arming and disarming."""
        self.state = Failsafe.CLEAR
        self._since_us.clear()
        self._present = self._overruled = frozenset()

    def update(
        self, view: VehicleView, params: FailsafeParams, flown: NavigationState, airborne_s: float
    ) -> Reaction:
        """Look at the vehicle once, in the air; `flown` is the present mode."""
        if self.state is Failsafe.CLEAR:
            self._intended = flown
        moment = Moment(view, params, self._intended, airborne_s, self.pace)
        before = self._present
        self._present = self._judge(moment)
        self._overruled &= self._present
        threats = _worst_first(self._present - before, moment)
        cleared = tuple(before - self._present)
        asking = _worst_first(self._present - self._overruled, moment)
        demands = [threat for threat in asking if threat.action > Action.WARN]
        reaction = self._react(demands, moment, flown)
        return reaction._replace(threats=threats, cleared=cleared)

    def _judge(self, moment: Moment) -> frozenset[Cause]:
        """Causes whose condition has held for their delay."""
        now_us, since, present = moment.view.now_us, self._since_us, []
        for cause, row in ROWS.items():
            if not row.holds(moment, cause in self._present):
                since.pop(cause, None)
            elif now_us - since.setdefault(cause, now_us) >= row.delay_s(moment.params) * 1e6:
                present.append(cause)
        return frozenset(present)

    def _react(self, demands: Sequence[Threat], moment: Moment, flown: NavigationState) -> Reaction:
        worst = demands[0].action if demands else Action.NONE
        if self.state is Failsafe.ACTING:
            stronger = worst > max(strength_of(flown), self._taken)
            return self._act(worst, moment) if stronger else Reaction()
        if worst <= strength_of(self._intended):
            return self._resume(moment) if self.state is Failsafe.WAITING else Reaction()
        deferred = all(_may_wait(demand) for demand in demands if demand.action is worst)
        if self.state is Failsafe.WAITING:
            worse = worst > self._awaited
            due = moment.view.now_us >= self._due_us
            return self._act(worst, moment) if worse or due or not deferred else Reaction()
        if not (deferred and self._can_wait(moment)):
            return self._act(worst, moment)
        self.state = Failsafe.WAITING
        self._awaited = worst
        self._due_us = moment.view.now_us + round(moment.params.action_delay_s * 1e6)
        return Reaction(mode=NavigationState.AUTO_LOITER)

    def _can_wait(self, moment: Moment) -> bool:
        """Whether the vehicle can hold and the operator is to be given time."""
        holds = requirements.missing(NavigationState.AUTO_LOITER, moment.view) is None
        return holds and moment.params.action_delay_s > 0.0

    def _resume(self, moment: Moment) -> Reaction:
        """Go back to what the operator intends, if that can be flown."""
        self.state = Failsafe.CLEAR
        missing = requirements.missing(self._intended, moment.view)
        return Reaction(mode=self._intended if missing is None else None)

    def _act(self, action: Action, moment: Moment) -> Reaction:
        """Take an action; what cannot be flown becomes a landing."""
        if action is Action.DISARM:
            return Reaction(event=ArmingEvent.FAILSAFE)
        if action is Action.TERMINATE:
            return Reaction(event=ArmingEvent.TERMINATED)
        mode = MODE_OF[action]
        self.state = Failsafe.ACTING
        self._taken = action
        possible = requirements.missing(mode, moment.view) is None
        return Reaction(mode=mode if possible else NavigationState.AUTO_LAND)


def _worst_first(causes: Iterable[Cause], moment: Moment) -> list[Threat]:
    threats = (Threat(cause, ROWS[cause].action(moment)) for cause in causes)
    return sorted(threats, key=lambda threat: threat.action, reverse=True)


def _may_wait(threat: Threat) -> bool:
    return threat.action in DEFERRED and not ROWS[threat.cause].urgent
