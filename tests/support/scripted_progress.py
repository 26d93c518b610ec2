"""How far a scripted vehicle has come in its mission, and what it shows of that."""

from tests.support.scripted_missions import ScriptedMissions
from tests.support.vehicle_wire import Message, mavlink, with_plan_ids


class ScriptedProgress:
    """The item that is flown, and the state of the mission."""

    def __init__(self, missions: ScriptedMissions) -> None:
        self.current = 0
        self.state = mavlink.MISSION_STATE_NO_MISSION
        self.began_at = 0.0  # The current item
        self.begun_early: list[int] = []  # MAV_CMDs of items that began outside of the mission mode
        self.resumed_at: list[int] = []  # Items, earlier than those at which it had paused
        self.restarted_at: list[int] = []  # Items at which it was when it began at its first again
        self._missions = missions
        self._has_lost_current = False

    @property
    def is_active(self) -> bool:
        return bool(self.state == mavlink.MISSION_STATE_ACTIVE)

    def stored(self) -> None:
        """Begin with a mission that was uploaded."""
        self.current = 0
        self._has_lost_current = self._missions.script.loses_current
        self.state = mavlink.MISSION_STATE_NOT_STARTED

    def begin(self, now: float) -> None:
        self.state, self.began_at = mavlink.MISSION_STATE_ACTIVE, now

    def set_current(self, seq: int) -> None:
        self.current = seq
        self._has_lost_current = False

    def reset_to(self, seq: int, *, in_mission: bool) -> None:
        """Begin in any mode all from an item to the first leg, if a reset resumes its mission."""
        if not self._missions.script.reset_resumes:
            return
        self.state = mavlink.MISSION_STATE_ACTIVE
        kinds = [] if in_mission else [item.command for item in self._missions.items[seq:]]
        legs = [n for n, kind in enumerate(kinds) if kind <= mavlink.MAV_CMD_NAV_LAST]
        self.begun_early += kinds[: legs[0] + 1 if legs else None]

    def resume_before_pictures(self, now: float) -> None:
        """Begin again at the place before the current item, as `mission_base.cpp` does."""
        before = list(enumerate(self._missions.items[: self.current]))
        places = [seq for seq, item in before if item.frame != mavlink.MAV_FRAME_MISSION]
        shoots = any(item.command == mavlink.MAV_CMD_IMAGE_START_CAPTURE for _, item in before)
        if places and shoots:
            self.resumed_at.append(places[-1])
            self.current, self.began_at = places[-1], now

    def restart(self, now: float) -> None:
        """Begin at the first item, as AUTO does if MIS_RESTART is 1 (`AP_Mission.cpp`)."""
        first = int(self._missions.script.home_is_item_0)
        if self.current > first:
            self.restarted_at.append(self.current)
        self.current, self.began_at = first, now

    def begin_anew(self) -> None:
        """Forget how far it was; the mission runs on, and a take-off waits for the propellers."""
        if self.is_active:
            self.current = int(self._missions.script.home_is_item_0)

    def is_over(self, item: Message, now: float) -> bool:
        """Whether the time of the current item is over; one that holds never ends."""
        if item.command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
            return False
        is_quick = item.command == mavlink.MAV_CMD_DO_CHANGE_SPEED
        return is_quick or now - self.began_at >= self._missions.script.item_time_s

    def advance(self) -> None:
        """Go on to the next item, or be complete."""
        if self.current + 1 < len(self._missions.items):
            self.current += 1
        else:
            self.state = mavlink.MISSION_STATE_COMPLETE
            if self._missions.script.current_goes_to_0_at_the_end:
                self.current = 0

    def message(self, *, in_mission: bool) -> Message:
        """MISSION_CURRENT."""
        script, items = self._missions.script, self._missions.items
        count = len(items) if script.counts_home else max(0, len(items) - 1)
        state = self.state
        if script.is_infeasible and items:
            state = mavlink.MISSION_STATE_NO_MISSION
        elif script.stops_elsewhere and not in_mission and self.is_active:
            state = mavlink.MISSION_STATE_NOT_STARTED
        total = count if items else script.no_mission_total
        current = mavlink.MAVLink_mission_current_message(
            self._shown_current(),
            total if script.sends_total else 0,
            state if script.sends_mission_state else mavlink.MISSION_STATE_UNKNOWN,
            1 if in_mission else 2,
        )
        return with_plan_ids(current, self._missions.plan_id, 0, 0)

    def _shown_current(self) -> int:
        if self._has_lost_current:
            return 0xFFFF
        if not self._missions.script.shows_legs_only or not self.current:
            return self.current
        rest = enumerate(self._missions.items[self.current :], self.current)
        legs = (seq for seq, item in rest if item.command <= mavlink.MAV_CMD_NAV_LAST)
        return next(legs, self.current)
