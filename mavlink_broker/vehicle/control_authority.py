"""Who is in command of a vehicle, by its heartbeat; pure.

The broker is in command while the vehicle is in a mode that an order or a mission of the broker
leads to, and no other system has ordered it into that mode: a vehicle acknowledges the order of a
ground station to everybody, with the number of that system. Any other mode was chosen by the
vehicle's own failsafe (HEARTBEAT.system_status is MAV_STATE_CRITICAL, which PX4 and ArduPilot set
while a failsafe acts; ArduPilot not for its fence, which FENCE_STATUS shows), or by another system:
a pilot with a remote control, or another ground station. Whoever it is, the broker sends no order
from then on (`is_order`).

A vehicle that no mission flies may still be the broker's: in a descent that it has ordered
(`OwnDescent`), or in the air where a mission has left it (`Hover`). Mode and place are noted, so
that a restarted broker knows them again: a vehicle that is armed in that mode or at that place, and
that no other system flies, has not been anywhere since.
"""

import math
from enum import Enum, auto
from typing import Final, NamedTuple, TypeAlias

from afarcloud.geodesy import distance_m
from mavlink_broker.autopilots.flight_modes import ModeRole
from mavlink_broker.mavlink.dialect import Message, Route, mav_cmd_name, mavlink
from mavlink_broker.planning.situation import Pose
from mavlink_broker.vehicle.telemetry import MissionNow, Position, Snapshot

_AUTOMATIC: Final[int] = mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
_MANUAL: Final[int] = mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED

AIRBORNE_MODES: Final = frozenset({ModeRole.MISSION, ModeRole.HOLD, ModeRole.GUIDED})
"""Modes in which a vehicle in the air waits for the next order, or has not obeyed it yet."""
DESCENT_MODES: Final = AIRBORNE_MODES | {ModeRole.ENDING}
"""Modes of a vehicle that has been ordered to land or to return."""
MISSION_MODES: Final = frozenset({ModeRole.MISSION, ModeRole.HOLD})
"""Modes in which a vehicle flies mission items, or is paused in them."""


_WAITING_MODES: Final = frozenset({ModeRole.HOLD, ModeRole.GUIDED})
"""Modes in which it shows by its acknowledgement alone that another system has given an order."""
_HOLDING_MODES: Final = _WAITING_MODES | {ModeRole.PAUSED}
_ORDERED_MODES: Final = _HOLDING_MODES | {ModeRole.ENDING}
"""Modes to which such an order leads."""
_RESUMING_COMMANDS: Final = frozenset(
    {mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_CMD_DO_PAUSE_CONTINUE}
)
_LANDING_COMMANDS: Final = frozenset(
    {mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH}
)
_TAKEOVER_COMMANDS: Final = frozenset(
    {
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_DO_REPOSITION,
        mavlink.MAV_CMD_DO_PAUSE_CONTINUE,
        mavlink.MAV_CMD_OVERRIDE_GOTO,
        mavlink.MAV_CMD_DO_ORBIT,
        mavlink.MAV_CMD_DO_FOLLOW,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        *_LANDING_COMMANDS,
    }
)


ACKNOWLEDGED_MODE_WITHIN_S: Final = 1.5
"""After its acknowledgement a mode shows in a heartbeat: a period of those, and half of one."""
ORDERED_MODE_WITHIN_S: Final = 3.0
"""A heartbeat shows the mode of an order that was accepted: at 1 Hz, and one may be lost."""
TAKEOVER_AFTER_S: Final = 5.0
"""How long a takeover must last: several periods of every message that could explain it."""
HELD_BY_FAILSAFE: Final = "the vehicle's own failsafe holds it"
DISARMED: Final = "the vehicle disarmed before the end of the mission"
FAILSAFE_AFTER_S: Final = 10.0
"""How long that must last: PX4 holds for 5 s before it does what its failsafe has chosen, and
resumes its mission when the reason has gone meanwhile."""


class Authority(Enum):
    """Who decides what a vehicle does."""

    BROKER = auto()
    FAILSAFE = auto()  # The vehicle itself
    OTHERS = auto()  # A pilot, or another ground station


class ObservedMode(NamedTuple):
    """What a vehicle's heartbeat shows about its mode."""

    mode: str
    role: ModeRole
    armed: bool | None  # None: it has not sent a heartbeat yet
    in_failsafe: bool = False
    is_manual: bool = False  # By the standard bits, of an autopilot whose modes are not known
    ordered: "ForeignOrder | None" = None  # What another system has ordered since
    is_known: bool = True  # Else neither mode nor role shows what it does

    @property
    def may_be_others(self) -> bool:
        """Whether it can show that somebody else flies the vehicle: where nothing is known, not."""
        return self.is_known or self.is_manual or self.ordered is not None


class ForeignOrder(NamedTuple):
    """An order that the vehicle has accepted from another system."""

    system: int
    command: int  # MAV_CMD
    at: float  # [s] On the broker's clock


NotedOrder: TypeAlias = tuple[int, int]
"""System and command of such an order, as a restarted broker finds it."""


class Claim(NamedTuple):
    """The modes in which the broker is in command, in the present phase of a mission."""

    roles: frozenset[ModeRole]
    mode: str | None = None  # One more, by name: the mode in which the vehicle was armed
    may_be_armed: bool = True
    is_exclusive: bool = False  # What another system has ordered in these modes ends it


AIRBORNE: Final = Claim(AIRBORNE_MODES)
DESCENDING: Final = Claim(DESCENT_MODES)
ON_GROUND: Final = Claim(frozenset(), may_be_armed=False)
TAKEN: Final = Claim(frozenset(), may_be_armed=False)
"""A vehicle that another system has taken, until it is disarmed."""
HOVERING: Final = Claim(AIRBORNE_MODES, is_exclusive=True)
"""A vehicle in the air that waits for its next order."""
LEFT_MISSION: Final = Claim(AIRBORNE_MODES - {ModeRole.MISSION}, is_exclusive=True)
"""The same, once it is out of its mission mode: only another system puts it back there."""


def authority_of(seen: ObservedMode, claim: Claim) -> Authority:
    """Decide who is in command of a vehicle; a disarmed vehicle is the broker's."""
    if not seen.armed:
        return Authority.BROKER
    is_ours = (seen.role in claim.roles and not seen.is_manual) or seen.mode == claim.mode
    is_decisive = claim.is_exclusive or _comes_down(seen) or not seen.is_known
    is_ours &= not (_is_ordered_by_another(seen) and is_decisive)
    if claim.may_be_armed and is_ours:
        return Authority.BROKER
    return Authority.FAILSAFE if seen.in_failsafe else Authority.OTHERS


def _is_ordered_by_another(seen: ObservedMode) -> bool:
    """Whether another system has ordered the mode that a vehicle shows."""
    shows_it = seen.role in _WAITING_MODES or _comes_down(seen) or not seen.is_known
    return seen.ordered is not None and shows_it


def _comes_down(seen: ObservedMode) -> bool:
    if not seen.is_known:
        return seen.ordered is not None and seen.ordered.command in _LANDING_COMMANDS
    return seen.role is ModeRole.ENDING


def reason(who: Authority, seen: ObservedMode) -> str:
    """Name who has taken a vehicle from the broker, for a mission's report."""
    whose = {
        Authority.FAILSAFE: "its own failsafe flies it",
        Authority.OTHERS: "somebody else flies the vehicle",
    }.get(who, "the broker flies it")
    if who is Authority.OTHERS and seen.ordered is not None and _is_ordered_by_another(seen):
        name, system = mav_cmd_name(seen.ordered.command), seen.ordered.system
        whose = f"system {system} has paused or moved it by {name}"
        if _comes_down(seen):
            whose = f"system {system} has ordered it to come down by {name}"
    return f"the vehicle left the mission: mode {seen.mode}: {whose}"


class OwnPause:
    """Whether a vehicle holds in a mode because the broker has paused it."""

    def __init__(self) -> None:
        self._mode: str | None = None
        self._ordered_at = -math.inf
        self._is_held = False

    def order(self, mode: str | None, now: float) -> None:
        """Note that the broker orders the vehicle into a mode in which it holds."""
        self._mode, self._ordered_at, self._is_held = mode, now, False

    def update(self, mode: str, now: float) -> None:
        """Follow a heartbeat: it shows that mode soon after the order, and until it leaves it."""
        is_new = now - self._ordered_at <= ORDERED_MODE_WITHIN_S
        self._is_held = mode == self._mode and (is_new or self._is_held)

    def holds_in(self, mode: str) -> bool:
        """Whether it holds in this mode by order of the broker."""
        return self._is_held and mode == self._mode


LONGEST_DESCENT_S: Final = 900.0
"""A return that began longer ago is not taken for that of an earlier run of the broker."""


class OwnDescent:
    """The return or landing that the broker ordered last, while the vehicle flies it."""

    def __init__(self) -> None:
        self.is_flown = False
        """Whether the vehicle flies it, or is about to; else another system decides."""
        self._ordered_at: float | None = None  # None: since the last update
        self._mode: str | None = None  # None: the vehicle has not shown it yet
        self._mode_before = ""
        self._mode_at_order: str | None = None
        self._sought: str | None = None  # That of an earlier run, until the vehicle is received
        self.began_s: float | None = None  # By the vehicle's clock since boot

    @property
    def is_sought(self) -> bool:
        """Whether an earlier run has ordered one, and its vehicle was not received yet."""
        return self._sought is not None

    @property
    def mode(self) -> str | None:
        """The mode in which the vehicle flies it, or did for an earlier run; None: it does not."""
        return self._mode if self.is_flown else self._sought

    def recall(self, mode: str | None, began_s: float | None) -> None:
        """Restore the mode in which it was flown for an earlier run of the broker."""
        self._sought, self.began_s = mode, began_s

    def own_mode(self, seen: ObservedMode) -> str | None:
        """The mode in which it was ordered, while the vehicle shows that one; None afterwards."""
        is_before = self.is_flown and self._mode is None and seen.mode == self._mode_before
        return seen.mode if is_before else None

    def order(self, mode: str) -> None:
        """Note which mode the vehicle shows when it is ordered to come down."""
        self._mode_at_order = mode

    def begin(self, seen: ObservedMode, time_s: float | None) -> None:
        """Note that the vehicle has accepted the order, at a time of its clock."""
        is_shown = seen.role is ModeRole.ENDING and seen.mode != self._mode_at_order
        self.is_flown, self._ordered_at = True, None
        self._mode = seen.mode if is_shown else None
        self._mode_before, self._sought, self.began_s = seen.mode, None, time_s

    def end(self) -> None:
        """Note that it is over, or that something else is ordered."""
        self.is_flown, self._sought = False, None

    def update(
        self,
        seen: ObservedMode,
        *,
        is_down: bool,
        now: float,
        time_s: float | None = None,
    ) -> None:
        """End it with the landing, with any other mode, or if the vehicle does not begin it.

        One whose modes are not known flies it until a pilot steers.

        A vehicle that shows the mode of an earlier run's, not too late by its clock, flies that.
        """
        if self._sought is not None and seen.armed is not None:
            is_timed = time_s is not None and self.began_s is not None
            flown_s = (time_s or 0.0) - (self.began_s or 0.0) if is_timed else 0.0
            self._mode, self._sought, self._ordered_at = self._sought, None, -math.inf
            self.is_flown = 0.0 <= flown_s <= LONGEST_DESCENT_S
        if not self.is_flown:
            return
        if self._ordered_at is None:
            self._ordered_at = now
        is_new = now - self._ordered_at <= ORDERED_MODE_WITHIN_S
        if not seen.armed or is_down:
            self.end()
        elif seen.ordered is not None and (seen.role is ModeRole.ENDING or not seen.is_known):
            self.is_flown = False  # By another system, behind the broker's order
        elif is_new and seen.role is ModeRole.ENDING:
            # The first heartbeats may still show the mode of before
            is_another = self._mode not in {None, self._mode_at_order, seen.mode}
            self._mode, self.is_flown = seen.mode, not is_another
        elif not is_new:
            self.is_flown = seen.mode == self._mode if seen.is_known else not seen.is_manual


HOVERS_WITHIN_M: Final = 30.0
"""Horizontally, with wind and another satellite fix."""
AS_HIGH_WITHIN_M: Final = 15.0


class Hover:
    """The hover of one vehicle."""

    def __init__(self) -> None:
        self.is_held = False
        """Whether the vehicle hovers there, and no other system has taken it."""
        self.place: Pose | None = None
        """Where a mission has left it; of an earlier run, until the vehicle was found there."""
        self.mode: str | None = None
        """The mode in which it waits for the broker; of an earlier run, in which it was left."""
        self._mission: MissionNow | None = None  # When it began, or was found

    def own_mode(self, seen: ObservedMode) -> str | None:
        """Give the present mode if it waits in it, and no order to wait leads to it; else None."""
        is_own = seen.mode == self.mode and seen.role not in AIRBORNE_MODES
        return seen.mode if is_own else None

    @property
    def is_sought(self) -> bool:
        """Whether an earlier run has noted a place, and the vehicle may still be found there."""
        return self.place is not None and not self.is_held

    def begin(self, snapshot: Snapshot, seen: ObservedMode, *, in_this_mode: bool = False) -> None:
        """Note that a mission has left the vehicle in the air.

        `in_this_mode` if it waits in the mode that it shows, whichever that is, for the broker.
        """
        position = snapshot.position
        self.place = position and Pose(
            position.latitude_deg, position.longitude_deg, position.altitude_m
        )
        self.mode = seen.mode if in_this_mode or seen.role in AIRBORNE_MODES else None
        self._hold(snapshot)

    def _hold(self, snapshot: Snapshot) -> None:
        self.is_held = True
        self._mission = snapshot.mission

    def end(self) -> None:
        """Note that the vehicle hovers no more, or for another system."""
        self.is_held, self.place, self.mode = False, None, None

    def recall(self, place: Pose | None, mode: str | None = None) -> None:
        """Restore the place and the mode that an earlier run of the broker has noted."""
        self.place, self.mode = place, mode
        self._mission = None

    def update(
        self,
        snapshot: Snapshot,
        mode: ObservedMode,
        *,
        is_identified: bool,
        is_ordered: bool = False,
    ) -> None:
        """End with a landing or a takeover; find the vehicle at the place of an earlier run.

        `is_ordered` while the broker itself orders something: a change of mode may be its own.
        """
        claim = HOVERING._replace(mode=self.own_mode(mode))
        is_ours = authority_of(mode, claim) is Authority.BROKER
        if not is_ordered and self._flies_another(snapshot, mode):
            is_ours = False
        if snapshot.armed is False or (self.is_held and not is_ours):
            self.end()
        elif self.is_held:
            self.mode = mode.mode
        elif self.place is not None and snapshot.armed is not None:
            if snapshot.position is None or not is_identified:
                return
            on_ground = snapshot.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
            if is_ours and not on_ground and _is_at(self.place, snapshot.position):
                self.mode = mode.mode
                self._hold(snapshot)
            else:
                self.end()

    def _flies_another(self, snapshot: Snapshot, seen: ObservedMode) -> bool:
        """Whether the vehicle flies mission items, which another system has started.

        Its mission mode was entered again, or another mission is active than when it was found.
        """
        before, now = self._mission, snapshot.mission
        if seen.role is not ModeRole.MISSION or (
            now is not None and now.state == mavlink.MISSION_STATE_NO_MISSION
        ):
            return False
        if self.mode not in {None, seen.mode}:
            return True
        is_active = now is not None and now.state == mavlink.MISSION_STATE_ACTIVE
        was_active = before is not None and before.state == mavlink.MISSION_STATE_ACTIVE
        is_same = before is not None and now is not None and before.mission_id == now.mission_id
        return self.is_held and is_active and not (was_active and is_same)


def _is_at(place: Pose, position: Position) -> bool:
    is_near = distance_m(*position[:2], *place[:2]) <= HOVERS_WITHIN_M
    return is_near and abs(position.altitude_m - place.altitude_m) <= AS_HIGH_WITHIN_M


def order_of_another(message: Message, route: Route, now: float) -> ForeignOrder | None:
    """Read a COMMAND_ACK by which a vehicle accepts the order of another system."""
    system = route.other_addressee(message)
    is_answer = message.get_type() == "COMMAND_ACK"
    if system is None or not is_answer or message.result != mavlink.MAV_RESULT_ACCEPTED:
        return None
    return ForeignOrder(system, message.command, now)


class ForeignOrderMonitor:
    """The newest order of another system, while a vehicle is in the mode that it led to."""

    def __init__(self) -> None:
        self.order: ForeignOrder | None = None
        self._noted: NotedOrder | None = None  # By an earlier run, until the vehicle is received
        self._knows_modes = True
        self._role: ModeRole | None = None  # By the newest heartbeat
        self._resumed_at = -math.inf  # When a heartbeat showed that it waits no more

    def forget(self) -> None:
        """Note that an order of the broker is newer, or that the vehicle was restarted."""
        self.order = self._noted = None

    @property
    def noted(self) -> "NotedOrder | None":
        """What a restarted broker has to know: whose order holds the vehicle."""
        holds = self._role in _HOLDING_MODES or not self._knows_modes
        if self.order is None or not holds:
            return self._noted
        return self.order.system, self.order.command

    def recall(self, noted: "NotedOrder | None", now: float) -> None:
        """Restore what an earlier run has noted, if the vehicle still holds."""
        self._noted = noted
        if self._role is not None:
            self._find_noted(now, holds=self._role in _HOLDING_MODES)

    def _find_noted(self, now: float, *, holds: bool) -> None:
        if self._noted is not None and self.order is None and holds:
            self.order = ForeignOrder(*self._noted, now)
        self._noted = None

    def accept(self, order: ForeignOrder, now: float, *, knows_modes: bool) -> None:
        """Note an order, if it makes a vehicle hold, go or come down.

        One whose mode was shown before its acknowledgement is carried out by now. Where modes are
        not known, one that may resume a mission ends the order before it.
        """
        if not knows_modes and order.command in _RESUMING_COMMANDS:
            self.order = None
            return
        was_shown = now - self._resumed_at <= ACKNOWLEDGED_MODE_WITHIN_S
        is_resumption = order.command in _RESUMING_COMMANDS and self._role not in _ORDERED_MODES
        if order.command in _TAKEOVER_COMMANDS and not (is_resumption and was_shown):
            self.order = order

    def update(self, seen: ObservedMode, now: float) -> None:
        """Follow a heartbeat; where modes are not known, an order holds until the landing.

        A vehicle that waited and waits no more has left the order's mode at once: the order resumed
        the mission. One that comes down later than an order shows does so for another reason.
        """
        self._knows_modes = seen.is_known
        if not seen.is_known:
            if seen.armed is not None:
                self._find_noted(now, holds=seen.armed)
                self.order = self.order if seen.armed else None
            return
        role = seen.role
        before, self._role = self._role, role
        self._find_noted(now, holds=role in _HOLDING_MODES)
        waited, waits = before in _ORDERED_MODES, role in _ORDERED_MODES
        if waited and not waits:
            self._resumed_at = now
        if self.order is None:
            return
        age_s = now - self.order.at
        is_left = not waits and (waited or age_s > ACKNOWLEDGED_MODE_WITHIN_S)
        begins_to_descend = role is ModeRole.ENDING and before is not ModeRole.ENDING
        if not seen.armed or is_left or (begins_to_descend and age_s > ORDERED_MODE_WITHIN_S):
            self.order = None


def is_manual(base_mode: int) -> bool:
    """Whether the standard bits of a heartbeat show that a pilot steers, and nothing else does."""
    return bool(base_mode & _MANUAL) and not base_mode & _AUTOMATIC


def shows_manual(base_mode: int) -> bool:
    """Whether a heartbeat proves that its vehicle sets these bits by who steers it."""
    return bool(base_mode & _AUTOMATIC) or not base_mode & _MANUAL


class TakeoverDebounce:
    """Reports a takeover that lasts."""

    def __init__(self) -> None:
        self._since: float | None = None

    def update(self, reason: str | None, now: float) -> str | None:
        """Follow the present reason to assume a takeover; returns it once it has lasted."""
        if reason is None:
            self._since = None
            return None
        if self._since is None:
            self._since = now
        after_s = FAILSAFE_AFTER_S if reason == HELD_BY_FAILSAFE else TAKEOVER_AFTER_S
        return reason if now - self._since >= after_s else None
