"""Follows the mission that a vehicle flies, for the intervals of its commands (`Attribution`).

The broker learns of a command later than it begins, and not at all of what is flown while the
vehicle cannot be received or while the broker stands still. A restarted broker follows a mission
of which an earlier run has ordered a part; its journal shows which (`EarlierFlight`).
"""

import math
from collections.abc import Iterator, Sequence
from typing import Final

from afarcloud.commands import Command, NavHome, NavLand
from afarcloud.enumerations import Status
from mavlink_broker.edge.wire import MissionWork
from mavlink_broker.pictures.attribution import (
    Attribution,
    PictureCommand,
    current_command,
    picture_command,
)
from mavlink_broker.pictures.vehicle_time import UNSEEN_BOOT_S, VehicleTime
from mavlink_broker.vehicle.mission_ledger import MissionLedger
from mavlink_broker.vehicle.recovery_state import RecoveryState
from mavlink_broker.vehicle.vehicle import Vehicle

PROGRESS_GAP_S: Final = 5.0
PROGRESS_SETTLED_S: Final = 5.0
"""How long after a gap in its progress the vehicle may be further than the ledger."""


class EarlierFlight:
    """The flight that an earlier run of the broker has ordered, as far as the journal shows it.

    Until the edge server has sent its mission again nobody knows whose the pictures are.
    """

    def __init__(self) -> None:
        self.was_flying = False
        """Whether the journal has had mission items, or a live command, under way."""
        self._first_command: str | None = None  # Of the items that were ordered last
        self._ordered_s = -math.inf  # When that was, by the vehicle's clock since boot
        self._armed_s = -math.inf  # When the vehicle was armed last before that, by the same

    def recall(self, recovery: RecoveryState) -> None:
        """Keep what the journal has, which is cleared when the vehicle has landed."""
        self.was_flying |= recovery.segment is not None or recovery.live is not None
        if recovery.segment is not None:
            self._first_command = recovery.segment
            ordered_s = recovery.began_s({recovery.segment})
            self._ordered_s = -math.inf if ordered_s is None else ordered_s
            self._armed_s = -math.inf if recovery.armed_s is None else recovery.armed_s

    @property
    def has_times(self) -> bool:
        """Whether the journal has times by the vehicle's clock."""
        return max(self._ordered_s, self._armed_s) > -math.inf

    def since_s(self, ledger: MissionLedger, commands: Sequence[Command]) -> list[float]:
        """Give when each command of the mission may have begun, at the earliest.

        One before the items that were ordered last has begun in the same flight, so that a flight
        before took no pictures for it; if the mission has landed in between, at any time before.
        """
        first, count = self.dated_from(ledger), len(commands)
        has_landed = any(isinstance(one, NavLand | NavHome) for one in commands[:first])
        is_of_flight = first < count and not has_landed
        before_s = min(self._armed_s, self._ordered_s) if is_of_flight else -math.inf
        return [before_s] * first + [self._ordered_s] * (count - first)

    def dated_from(self, ledger: MissionLedger) -> int:
        """Give the index of the first command of which it was noted when it was ordered.

        That is the first of the items that were ordered last; the number of commands without one.
        """
        names = map(ledger.name_of, range(len(ledger.commands)))
        found = (index for index, name in enumerate(names) if name == self._first_command)
        return next(found, len(ledger.commands))


class MissionFollower:
    """The mission that one vehicle flies, and the commands of it that have begun and ended."""

    def __init__(self, vehicle: Vehicle, time: VehicleTime, attribution: Attribution) -> None:
        self.flight: tuple[MissionWork, MissionLedger] | None = None
        """The mission that was followed last, also behind its end; None before the first one."""
        self.followed_since = -math.inf
        """From then on, by the broker's clock, its progress is that of this run without a gap."""
        self.followed_from_s = math.inf
        """When the first command of a mission was followed, by the vehicle's clock."""
        self._vehicle = vehicle
        self._time = time
        self._attribution = attribution
        self._earlier = EarlierFlight()
        self._updated_at = math.inf
        self._updated_s = 0.0  # The same, by the vehicle's clock
        self._shown_since = -math.inf  # From then on the vehicle has shown it without a gap
        self._is_shifted = False  # To the clock before a restart since the earlier flight
        self._flight_known_s = math.inf  # When the first mission of this run was received

    @property
    def is_mission_open(self) -> bool:
        """Whether the mission of a flight under way may still be received: of an earlier run."""
        is_flying = self._earlier.was_flying or not self._vehicle.is_identified
        return self.flight is None and is_flying

    def is_of_earlier_flight(self, time_s: float) -> bool:
        """Whether a picture was taken in a flight of an earlier run, before a mission was known."""
        return self._earlier.was_flying and time_s <= self._flight_known_s

    def follow_clock(self, now: float) -> None:
        """Follow the vehicle's clock, which may be received for the first time."""
        shift_s = self._time.update(now)
        self._attribution.shift(shift_s)
        self._updated_s += shift_s

    def update(
        self,
        work: MissionWork | None,
        ledger: MissionLedger | None,
        now: float,
        *,
        is_followed: bool,
    ) -> bool:
        """Follow the mission that is flown, if any; returns whether a mission begins or ends.

        `is_followed`: the ledger has the progress that the vehicle shows, not that of an earlier
        run.
        """
        self.follow_clock(now)
        is_earlier = work is None or work.was_accepted
        if is_earlier and self.followed_from_s == math.inf:
            self._earlier.recall(self._vehicle.recovery)
        command = None
        if work is not None and ledger is not None:
            if self.flight is None:
                self._flight_known_s = self._time.at(now)
            self.flight = work, ledger
            if ledger.status is Status.RUNNING and self._may_follow:
                command = current_command(ledger, work.mission.command_array, work.name)
        stood_still = now - self._updated_at > PROGRESS_GAP_S  # What has waited is read first
        time_s = self._time.at(now)
        if stood_still:  # What has waited has an old time, and what the vehicle has begun may not
            time_s = max(time_s, self._updated_s + now - self._updated_at)
        if stood_still or not is_followed or not self._vehicle.is_connected(now):
            self.followed_since = now
        self._updated_at, self._updated_s = now, self._time.at(now)
        return self._follow_command(command, now, time_s)

    def restarted(self) -> None:
        """Note that the vehicle has restarted; it may have flown commands before that unseen."""
        self._add_unseen(self._time.latest_s)

    @property
    def _may_follow(self) -> bool:
        """Whether the journal is read by now, and the vehicle's clock known if it has times of it.

        Before that the broker's own clock stands in for it.
        """
        if self.followed_from_s < math.inf:
            return True
        return self._vehicle.is_identified and (self._time.is_known or not self._earlier.has_times)

    def _follow_command(self, command: PictureCommand | None, now: float, time_s: float) -> bool:
        """Follow the command that runs; returns whether a mission begins or ends."""
        before = self._attribution.current
        ledger = None if self.flight is None else self.flight[1]
        is_of_boot_before = self._vehicle.recovery.was_restarted_since
        if is_of_boot_before and not self._is_shifted and self.followed_from_s < math.inf:
            self._is_shifted = True
            self._attribution.shift_earlier(-UNSEEN_BOOT_S)
        for passed in self._behind(before, 0 if ledger is None else ledger.begun):
            self._attribution.update(passed, time_s)
        self._add_unseen(time_s, 0 if ledger is None else ledger.finished)
        since_s = self._earlier_since_s(command, now)
        is_change = self._attribution.update(
            command,
            time_s,
            seen_s=self._progress_shown_s(now),
            resumed_since_s=None if command is None or not since_s else since_s[command.command],
        )
        if since_s:
            self._add_earlier(since_s)
        return is_change and (command is None or before is None)

    def _earlier_since_s(self, command: PictureCommand | None, now: float) -> list[float]:
        """Give when each command of an earlier run's mission may have begun, once it is known.

        Empty for a mission of this run, and before and behind that.
        """
        if command is None or self.flight is None or self.followed_from_s < math.inf:
            return []
        self.followed_from_s = self._time.at(now)
        work, ledger = self.flight
        commands = work.mission.command_array
        return self._earlier.since_s(ledger, commands) if work.was_accepted else []

    def _add_earlier(self, since_s: Sequence[float]) -> None:
        """Add the commands that an earlier run has seen end, whose pictures may come now."""
        if self.flight is None:
            return
        work, ledger = self.flight
        commands = work.mission.command_array
        dated_from = self._earlier.dated_from(ledger)
        for index in range(min(ledger.finished, len(commands))):
            one = picture_command(ledger, commands, work.name, index)
            if one.expected:
                is_undated = index < dated_from
                self._attribution.add_earlier(one, since_s[index], is_undated=is_undated)

    def _progress_shown_s(self, now: float) -> float | None:
        """When the vehicle has shown its progress last.

        What it has shown just after an outage is not in the ledger yet.
        """
        age_s = self._vehicle.age_s("MISSION_CURRENT", now)
        received_s = self._time.received_s
        if not self._vehicle.is_connected(now) or (age_s or 0.0) > PROGRESS_GAP_S:
            self._shown_since = now
        if now - max(self._shown_since, self.followed_since) < PROGRESS_SETTLED_S:
            return -math.inf
        if age_s is None or received_s is None:
            return received_s
        return min(received_s, self._time.at(now) - age_s)

    def _behind(self, before: PictureCommand | None, end: int | None) -> Iterator[PictureCommand]:
        """Give the commands of the mission in flight behind one of it, up to an index."""
        if before is None or self.flight is None or before.mission != self.flight[0].name:
            return
        work, ledger = self.flight
        commands = work.mission.command_array
        for index in range(before.command + 1, len(commands[:end])):
            yield picture_command(ledger, commands, work.name, index)

    def _add_unseen(self, until_s: float, end: int | None = None) -> None:
        """Note that the vehicle may have flown commands behind the present one unseen."""
        behind = self._behind(self._attribution.current, end)
        self._attribution.add_unseen((one for one in behind if one.expected), until_s)
