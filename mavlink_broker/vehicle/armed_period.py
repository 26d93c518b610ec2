"""Who has a vehicle in the newest period in which it was armed, and how long that has been over.

One holder at a time (`Holder`):

| from                 | on                                    | to     |
|----------------------|---------------------------------------|--------|
| any                  | armed, by order of the broker         | OURS   |
| any                  | armed when it is received first       | FOUND  |
| any                  | armed otherwise                       | OTHERS |
| FOUND; OTHERS, armed | `claim`                               | OURS   |
| OURS or FOUND, armed | `lose`                                | OTHERS |
| any, armed           | `take_away`                           | TAKEN  |
| TAKEN                | disarmed                              | OTHERS |
| FOUND                | disarmed in a mode of somebody else   | OTHERS |
| any                  | disarmed by another system's order    | OTHERS |
| any, not armed       | `end_by_others`                       | OTHERS |

It begins as OURS. FOUND counts as somebody else's flight until a mission, hover or return of an
earlier run is recognised in it. A mission may lose a vehicle for a moment, for a pilot may give it
back: that is in the mode (`note_mode`) and changes no holder.

What a restarted broker has to know of it, it notes (`noted_mode`): by a vehicle that stands
disarmed it cannot see any more who had it in the air.
"""

import math
from enum import Enum, auto
from typing import Final

from mavlink_broker.vehicle.control_authority import ObservedMode

STAND_S: Final = 30.0
"""How long a vehicle stands disarmed after somebody else had it armed, before a mission arms it.

Whoever has just landed it walks up to it, or swaps its battery: time to see that it stands, to walk
some 20 m, and to arm it again for a further flight.
"""
ARMING_SHOWN_WITHIN_S: Final = 45.0
"""How long after an order a vehicle may show that it obeys: 8 attempts of at most 5 s each."""
UNSEEN_S: Final = 5.0
"""After a longer silence of the vehicle somebody else may have landed it."""
DISARMED_WITHIN_S: Final = 3.0
"""Longest time from the acknowledgement of an order to disarm to the heartbeat that shows it."""
ARMED_BY_OTHERS: Final = "somebody else has armed it"
LEFT_BY_OTHERS: Final = (
    f"somebody else or its failsafe had it: it has to stand disarmed for {STAND_S:.0f} s first"
)
OBSTACLES: Final = (ARMED_BY_OTHERS, LEFT_BY_OTHERS)
"""What a mission waits for because of somebody else."""


class Holder(Enum):
    """Whose the newest period is in which the vehicle was armed."""

    OURS = auto()  # The broker has ordered it to arm, or has found its own flight
    FOUND = auto()  # It had begun before this broker received the vehicle: not decided yet
    OTHERS = auto()  # Somebody else has armed it, or has taken it when no mission flew it
    TAKEN = auto()  # Another system has taken it from a mission; until it is disarmed


class ArmedPeriod:
    """The newest period in which one vehicle was armed."""

    def __init__(self) -> None:
        self._holder = Holder.OURS
        self.is_armed: bool | None = None
        """By the vehicle's newest heartbeat; None: not received yet."""
        self._flown: ObservedMode | None = None  # By the newest heartbeat that showed it armed
        self._is_others_mode = False  # Somebody else has it by that, from a mission; it may pass
        self._forgotten_mode: str | None = None  # That of `_flown`, before a restart
        self._noted_before: str | None = None  # By an earlier run
        self._ordered_at = -math.inf  # Newest order to arm that is not answered yet
        self._left_at: float | None = None  # When it was over, if it was somebody else's
        self._heard_at = math.inf  # Newest heartbeat
        self._is_end_unseen = False  # It was over while the vehicle was not received
        self._disarmed_at = -math.inf
        self._is_disarmed_by_others = False  # By an acknowledged order, also in an earlier run
        self._disarming_at = -math.inf  # When it accepted another system's order to disarm
        self.is_found = False
        """Whether it had begun before this broker received the vehicle."""

    # What is seen and ordered

    def order_arming(self, now: float) -> None:
        """Note that the broker orders the vehicle to arm."""
        self._ordered_at = now

    def refuse_arming(self) -> None:
        """Note that the vehicle has refused that order: who arms it now is somebody else."""
        self._ordered_at = -math.inf

    def update(self, seen: ObservedMode, now: float) -> None:
        """Follow a heartbeat of the vehicle."""
        if seen.armed is None:
            return
        gap_s, self._heard_at = now - self._heard_at, now
        if seen.armed:
            self._flown = seen
            if not self.is_armed:
                self._begin(now)
        elif self.is_armed:
            self._is_end_unseen, self._disarmed_at = gap_s > UNSEEN_S, now
            self._is_disarmed_by_others = now - self._disarming_at <= DISARMED_WITHIN_S
            is_lost = self.is_others and self._is_others_mode
            if self._holder is Holder.TAKEN or is_lost or self._is_disarmed_by_others:
                self._holder = Holder.OTHERS
            self._left_at = now if self.is_others else None
        elif self.stood_s(now) is None:
            self._left_at = None
        self.is_armed = seen.armed

    def _begin(self, now: float) -> None:
        is_ordered = now - self._ordered_at <= ARMING_SHOWN_WITHIN_S
        self.is_found = not is_ordered and self.is_armed is None
        not_ordered = Holder.FOUND if self.is_found else Holder.OTHERS
        self._holder = Holder.OURS if is_ordered else not_ordered
        self._ordered_at, self._left_at, self._forgotten_mode = -math.inf, None, None
        self._is_end_unseen = self._is_disarmed_by_others = False
        if not self.is_found:
            self._noted_before = None

    def note_foreign_disarming(self, now: float) -> None:
        """Note that the vehicle has accepted another system's order to disarm it, or to arm it."""
        self._disarming_at = now
        if now - self._disarmed_at <= DISARMED_WITHIN_S:
            self._is_disarmed_by_others = True
            self.end_by_others(now)

    def note_mode(self, *, is_others: bool) -> None:
        """Note whether somebody else has it from a mission, by the mode in which it is armed."""
        if self.is_armed:
            self._is_others_mode = is_others

    def end_mission(self) -> None:
        """Note that no mission flies it any more: whose it is has been decided."""
        self._is_others_mode = False

    def forget_mode(self) -> None:
        """Forget in which mode it flew: the vehicle was restarted."""
        self._forgotten_mode = self._flown.mode if self._flown else self._forgotten_mode
        self._flown = None

    # Whose it is

    def claim(self) -> None:
        """Note that the vehicle flies, hovers or comes down for a mission of the broker."""
        if self._holder is Holder.FOUND:  # It may have landed before its mission was recognised
            self._holder, self._left_at = Holder.OURS, None
        elif self.is_armed and self._holder is not Holder.TAKEN:
            self._holder = Holder.OURS

    def take_away(self) -> None:
        """Note that another system, or its failsafe, has taken an armed vehicle from a mission."""
        if self.is_armed:
            self._holder = Holder.TAKEN

    def lose(self) -> None:
        """Note that another system has taken an armed vehicle that no mission flew."""
        if self.is_armed and self._holder is not Holder.TAKEN:
            self._holder = Holder.OTHERS

    def end_by_others(self, now: float) -> None:
        """Note that another system had a disarmed vehicle when it was disarmed, a moment ago."""
        if not self.is_armed:
            self._holder, self._left_at = Holder.OTHERS, now

    @property
    def was_disarmed_by_others(self) -> bool:
        """Whether another system's order has disarmed it, of a vehicle that is disarmed."""
        return not self.is_armed and self._is_disarmed_by_others

    @property
    def is_taken(self) -> bool:
        """Whether another system has taken it from a mission, until it is disarmed."""
        return self._holder is Holder.TAKEN

    @property
    def is_others(self) -> bool:
        """Whether it is somebody else's, as far as is known."""
        return self._holder is not Holder.OURS

    def was_theirs_in(self, mode: str | None) -> bool:
        """Whether an earlier run has noted, in this period, that somebody else has it in a mode."""
        return self.is_found and mode is not None and mode == self._noted_before

    @property
    def has_ended_unseen(self) -> bool:
        """Whether the vehicle was disarmed while it was not received, or before this run."""
        is_unseen = self._flown is None and self._forgotten_mode is None
        return self.is_armed is False and (is_unseen or self._is_end_unseen)

    def flown_mode(self, seen: ObservedMode) -> ObservedMode:
        """Give the mode of an armed vehicle; of a disarmed one, the last in which it was armed.

        `seen` is the present one. If this run of the broker has not seen it armed, that one counts
        if an earlier run has lost it to somebody else in it: from another he may have given it
        back.
        """
        if seen.armed:
            return seen
        if self._flown is None and self.noted_mode == seen.mode:
            return seen._replace(armed=True)
        return self._flown or seen

    # For a restarted broker

    def recall(
        self, noted_mode: str | None, now: float, *, is_disarmed_by_others: bool = False
    ) -> None:
        """Restore what an earlier run has noted; a vehicle that is disarmed stands from now on.

        In flight its mode shows whose it is.
        """
        self._is_disarmed_by_others |= is_disarmed_by_others and self._flown is None
        self._noted_before = noted_mode
        if noted_mode is not None and self._flown is None and self._left_at is None:
            self.end_by_others(now)

    @property
    def noted_mode(self) -> str | None:
        """In which somebody else has it, or had it while it has to stand for him; else None."""
        if self.is_armed is None:
            return self._noted_before
        is_theirs = self.is_others and (self.is_armed or self._left_at is not None)
        is_undecided = self._is_others_mode and (self.is_armed or not self.is_others)
        if not is_theirs and not is_undecided:
            return None
        is_unknown = self._holder is Holder.FOUND and self.is_armed and not is_undecided
        if is_unknown:
            return self._noted_before
        seen = self._forgotten_mode if self._flown is None else self._flown.mode
        return seen or self._noted_before

    # Standing

    def stood_s(self, now: float) -> float | None:
        """How long it has stood since somebody else's flight; None: long enough, or without one."""
        if self._left_at is None or now - self._left_at >= STAND_S:
            return None
        return now - self._left_at

    def obstacle(self, now: float) -> str | None:
        """Name why no mission may arm the vehicle because of somebody else; None if one may."""
        if self.is_armed and self.is_others:
            return ARMED_BY_OTHERS
        return None if self.stood_s(now) is None else LEFT_BY_OTHERS

    def warning(self, now: float) -> str | None:
        """Describe for operators how long the vehicle has stood, while it has to stand longer."""
        stood_s = self.stood_s(now)
        return None if stood_s is None else f"{LEFT_BY_OTHERS}, and has for {stood_s:.0f} s"
