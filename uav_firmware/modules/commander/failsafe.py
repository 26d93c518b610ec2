"""The failsafe machine: which causes are present, and what is done about the worst.

    CLEAR    --a cause appears, action deferred--------> WAITING   hold; COM_FAIL_ACT_T runs
    CLEAR    --a cause appears, action at once---------> ACTING
    WAITING  --the cause clears------------------------> CLEAR     the intended mode goes on
    WAITING  --the time is over------------------------> ACTING
    WAITING  --a worse cause appears-------------------> ACTING
    WAITING, ACTING --the operator chooses a mode------> CLEAR     what is present is overruled
    ACTING   --a worse cause appears-------------------> ACTING
    any      --disarmed--------------------------------> CLEAR

An action is taken when its cause appears, and only if it is worse than what is flown. So an
operator may overrule it, and a cause acts again only after it has cleared.
"""

from collections.abc import Sequence
from enum import Enum, auto
from typing import NamedTuple

from uav_firmware.modules.commander import mode_requirements
from uav_firmware.modules.commander.arming_states import ArmingEvent
from uav_firmware.modules.commander.failsafe_actions import (
    DEFERRED,
    MODE_OF,
    Action,
    strength_of,
)
from uav_firmware.modules.commander.failsafe_causes import ROWS, Cause, Moment
from uav_firmware.modules.commander.failsafe_params import FailsafeParams
from uav_firmware.modules.commander.return_time import ReturnPace
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
        self._waiting = Threat(Cause.LINK_LOST, Action.NONE)
        self._due_us = 0

    def overrule(self) -> None:
        """The operator has chosen a mode: what is present now shall not act again."""
        self.state = Failsafe.CLEAR

    def clear(self) -> None:
        """Forget all, at arming and disarming."""
        self.state = Failsafe.CLEAR
        self._since_us.clear()
        self._present = frozenset()

    def update(
        self, view: VehicleView, params: FailsafeParams, flown: NavigationState, airborne_s: float
    ) -> Reaction:
        """Look at the vehicle once, in the air; `flown` is the present mode."""
        if self.state is Failsafe.CLEAR:
            self._intended = flown
        moment = Moment(view, params, self._intended, airborne_s, self.pace)
        before = self._present
        self._present = self._judge(moment)
        threats = sorted(
            (Threat(cause, ROWS[cause].action(moment)) for cause in self._present - before),
            key=lambda threat: threat.action,
            reverse=True,
        )
        cleared = tuple(before - self._present)
        reaction = self._react(threats, moment, flown)
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

    def _react(self, threats: Sequence[Threat], moment: Moment, flown: NavigationState) -> Reaction:
        if threats and threats[0].action > self._strength(flown):
            return self._begin(threats[0], moment)
        if self.state is not Failsafe.WAITING:
            return Reaction()
        if self._waiting.cause not in self._present:
            self.state = Failsafe.CLEAR
            missing = mode_requirements.missing(self._intended, moment.view)
            return Reaction(mode=self._intended if missing is None else None)
        return self._act(self._waiting.action, moment) if self._is_due(moment) else Reaction()

    def _is_due(self, moment: Moment) -> bool:
        return moment.view.now_us >= self._due_us

    def _strength(self, flown: NavigationState) -> Action:
        """How strong an action is already being taken or waited for."""
        present = strength_of(flown)
        return max(present, self._waiting.action) if self.state is Failsafe.WAITING else present

    def _begin(self, threat: Threat, moment: Moment) -> Reaction:
        """Act on a threat, or hold and wait for the operator first."""
        hold = mode_requirements.missing(NavigationState.AUTO_LOITER, moment.view) is None
        deferred = (
            threat.action in DEFERRED
            and not ROWS[threat.cause].urgent
            and self.state is Failsafe.CLEAR
            and moment.params.action_delay_s > 0.0
        )
        if not (hold and deferred):
            return self._act(threat.action, moment)
        self.state = Failsafe.WAITING
        self._waiting = threat
        self._due_us = moment.view.now_us + round(moment.params.action_delay_s * 1e6)
        return Reaction(mode=NavigationState.AUTO_LOITER)

    def _act(self, action: Action, moment: Moment) -> Reaction:
        """Take an action; what cannot be flown becomes a landing."""
        if action is Action.DISARM:
            return Reaction(event=ArmingEvent.FAILSAFE)
        if action is Action.TERMINATE:
            return Reaction(event=ArmingEvent.TERMINATED)
        if action not in MODE_OF:
            return Reaction()
        mode = MODE_OF[action]
        self.state = Failsafe.ACTING
        possible = mode_requirements.missing(mode, moment.view) is None
        return Reaction(mode=mode if possible else NavigationState.AUTO_LAND)
