"""The time by which pictures belong to commands: a vehicle's clock, continued over its restarts.

Until the vehicle has sent its clock the broker's own one stands in for it. The two have nothing in
common, so `update` gives by how much all times of before have to be shifted then.
"""

import math
from collections import deque
from typing import Final

from mavlink_broker.vehicle.vehicle import Vehicle

RECENT_S: Final = 900.0
"""Older pictures, taken before this run of the broker, are not downloaded."""
OWN_CLOCK_S: Final = 3.0
"""A camera whose clock differs more from the autopilot's has a clock of its own."""
_EVERY_S: Final = 1.0
PROVED_WITHIN_S: Final = 10.0
"""A clock that has gone back for longer is that of a restarted vehicle, also without a proof."""
_PROVED_LATE_S: Final = 60.0
"""A proof that comes so soon after a restart was assumed is of the same restart."""


REAL_RATE_WITHIN: Final = 0.1
"""A clock whose rate differs by less is not simulated: messages arrive unevenly."""
UNSEEN_BOOT_S: Final = 1e6
"""Offset of times before a restart that only an earlier run of the broker may have seen; longer
than any vehicle runs."""


class VehicleTime:
    """The time of one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._ahead_s: float | None = 0.0  # The broker's clock; None: the vehicle has restarted
        self._newest_s: float | None = None  # By the vehicle's clock, as it was received
        self._behind_since: float | None = None  # When that has gone back
        self.is_known = False
        """Whether the vehicle's clock was received in this run of the broker."""
        self._assumed_s = -math.inf  # When a restart was assumed that nothing has proved yet
        self._epoch_s = 0.0  # Added to the vehicle's time, which a restart sets back
        self._epoch_before_s: float | None = None  # The same, before the vehicle's last restart
        self.latest_s = 0.0
        """The latest time that was given."""
        # This time, the broker's, and what a restart has added to this one, of the last minutes
        self._received = deque[tuple[float, float, float]](maxlen=round(RECENT_S / _EVERY_S))

    def update(self, now: float) -> float:
        """Follow the vehicle's clock; gives how far the times of before have to be shifted."""
        time_s = self._vehicle.snapshot.time_s
        if time_s is None or time_s == self._newest_s or self._may_be_restarted(time_s, now):
            return 0.0
        self._newest_s = time_s
        if not self._received or now - self._received[-1][1] >= _EVERY_S:
            self._received.append((time_s + self._epoch_s, now, self._epoch_s))
        was_known, self.is_known = self.is_known, True
        self._ahead_s = now - time_s
        if was_known:
            return 0.0
        self.latest_s = self._epoch_s
        return -self._ahead_s

    def _may_be_restarted(self, time_s: float, now: float) -> bool:
        """Whether the clock has gone back, and it is not known yet what that means.

        `restarted` is called when more messages have proved a restart. One that nothing proves in
        time is assumed: a vehicle without a position sends few messages with its clock.
        """
        if self._newest_s is None or time_s > self._newest_s - OWN_CLOCK_S:
            self._behind_since = None
            return False
        self._behind_since = now if self._behind_since is None else self._behind_since
        if now - self._behind_since < PROVED_WITHIN_S:
            return True
        self._assumed_s = self._begin_epoch() + time_s
        return False

    def is_recent(self, time_s: float, now: float) -> bool:
        """Whether something is recent enough; everything is until the vehicle's clock is known.

        So is what was before an unseen restart: how long before is not known.
        """
        is_known = self.is_known and not self._is_of_unseen_boot(time_s)
        return not is_known or self.at(now) - time_s <= RECENT_S

    def _is_of_unseen_boot(self, time_s: float) -> bool:
        return self._epoch_s - UNSEEN_BOOT_S <= time_s < self._epoch_s - UNSEEN_BOOT_S / 2.0

    def broker_time(self, time_s: float, now: float) -> float:
        """Give the broker's time of something recent; now if the vehicle's clock does not give it.

        The two clocks may run at different rates: a simulated vehicle's runs at its speed.
        """
        if self._is_of_unseen_boot(time_s):
            time_s = self._epoch_s - OWN_CLOCK_S
        later_s, later, later_epoch_s = self.at(now), now, self._epoch_s
        if not self.is_known or time_s >= later_s:
            return now
        for earlier_s, earlier, epoch_s in reversed(self._received):
            if earlier_s <= time_s:
                if epoch_s != later_epoch_s:  # A restart lies between them: by the nearer one
                    since_s, until_s = time_s - earlier_s, later_s - time_s
                    if since_s < until_s:
                        return min(earlier + since_s, later)
                    return max(later - until_s, earlier)
                share = (time_s - earlier_s) / (later_s - earlier_s)
                return earlier + share * (later - earlier)
            later_s, later, later_epoch_s = earlier_s, earlier, epoch_s
        age_s = (later_s - time_s) / self._rate  # Before the first time that was received
        return later - age_s if age_s <= RECENT_S else now

    @property
    def knows_rate(self) -> bool:
        """Whether the vehicle's clock was received for long enough to show how fast it runs."""
        return self._measured_rate is not None

    @property
    def _rate(self) -> float:
        """How fast the vehicle's clock runs: a simulated one's at its speed."""
        rate = 1.0 if self._measured_rate is None else self._measured_rate
        return 1.0 if abs(rate - 1.0) < REAL_RATE_WITHIN else max(rate, REAL_RATE_WITHIN)

    @property
    def _measured_rate(self) -> float | None:
        times = [(at_s, at) for at_s, at, epoch_s in self._received if epoch_s == self._epoch_s]
        if not times or times[-1][1] - times[0][1] < _EVERY_S:
            return None
        (first_s, first), (last_s, last) = times[0], times[-1]
        return (last_s - first_s) / (last - first)

    @property
    def is_doubtful(self) -> bool:
        """Whether it is not known yet whether the vehicle has restarted."""
        return self._behind_since is not None

    @property
    def received_s(self) -> float | None:
        """The time by the newest clock that was received; None before that."""
        return None if self._newest_s is None else self._newest_s + self._epoch_s

    def restarted(self) -> float:
        """Begin anew with a vehicle that has restarted; gives the time of its start."""
        is_assumed = self.latest_s - self._assumed_s < _PROVED_LATE_S and not self.is_doubtful
        self._assumed_s = -math.inf
        return self._epoch_s if is_assumed else self._begin_epoch()

    def _begin_epoch(self) -> float:
        self._epoch_before_s = self._epoch_s
        self._epoch_s = self.latest_s + 2.0 * RECENT_S
        self._ahead_s = None if self.is_known else self._ahead_s
        self._newest_s = self._behind_since = None
        return self._epoch_s

    def since_boot_s(self, now: float) -> float:
        """Give the vehicle's time; the broker's if it has not sent any yet, 0 after a restart."""
        return 0.0 if self._ahead_s is None else now - self._ahead_s

    def at(self, now: float) -> float:
        """Give the time, which goes on over restarts."""
        time_s = self.since_boot_s(now) + self._epoch_s
        self.latest_s = max(self.latest_s, time_s)
        return time_s

    def of(
        self, since_boot_s: float, utc_s: float | None, now: float, *, is_same_clock: bool = False
    ) -> float:
        """Give the time of something by the vehicle's clock, perhaps before its last restart.

        `utc_s` is its time of day, None if it is not known; `is_same_clock` if its time since boot
        is known to be that of the autopilot.
        """
        now_s = self.since_boot_s(now)
        is_before = self._is_before(since_boot_s, utc_s, now_s)
        if self._epoch_before_s is not None and is_before:
            return since_boot_s + self._epoch_before_s
        if is_same_clock and is_before:  # An earlier run of the broker has seen the restart
            return since_boot_s + self._epoch_s - UNSEEN_BOOT_S
        return (min(since_boot_s, now_s) if self.is_known else since_boot_s) + self._epoch_s

    def _is_before(self, since_boot_s: float, utc_s: float | None, now_s: float) -> bool:
        """Whether something is older than the vehicle's last restart.

        Its time of day shows it, else a time since boot that lies in the future.
        """
        booted_s = self._vehicle.snapshot.booted_at_utc_s
        if utc_s is not None and booted_s is not None:
            return utc_s < booted_s - OWN_CLOCK_S
        return since_boot_s > now_s + OWN_CLOCK_S


class CameraClocks:
    """How far the clocks of a vehicle's cameras are behind the autopilot's.

    A camera that was restarted with its vehicle may show that before the vehicle does, and may send
    its time before the vehicle has sent any. Its clock is not believed then until either has proved
    what has happened.
    """

    def __init__(self) -> None:
        self._lag_s: dict[int, float] = {}  # By component
        self._doubted_since: dict[int, float] = {}  # Clocks that have gone back

    def clear(self) -> None:
        """Begin anew: the vehicle was restarted."""
        self._lag_s.clear()
        self._doubted_since.clear()

    def take(self, component: int, camera_s: float | None, time: VehicleTime, now: float) -> bool:
        """Note a camera's time since boot; false while it is not believed.

        None: the vehicle has not sent its own, so that nothing compares with it.
        """
        lag_s = 0.0 if camera_s is None else time.since_boot_s(now) - camera_s
        if camera_s is None or lag_s - self._lag_s.get(component, lag_s) > OWN_CLOCK_S:
            since = self._doubted_since.setdefault(component, now)
            if now - since < PROVED_WITHIN_S:
                return False
        if camera_s is None:
            return True
        self._doubted_since.pop(component, None)
        self._lag_s[component] = lag_s
        return True

    def is_doubtful(self, component: int, now: float) -> bool:
        """Whether it is not known yet what the time of a camera means; never for long."""
        since = self._doubted_since.get(component)
        return since is not None and now - since < PROVED_WITHIN_S

    def lag_s(self, component: int) -> float | None:
        """How far a camera's clock is behind; None: it has not sent its time."""
        return self._lag_s.get(component)
