"""How a vehicle flies its mission: one item after the other, and how far it has come."""

from enum import Enum, auto
from typing import Any, Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dst.scheduler import Scheduler
from dst.vehicles.autopilot import Autopilot
from dst.vehicles.flight import HOME, SPEED_M_S, Circle, Flight, Reached, offset_m
from dst.vehicles.mission_store import MissionStore
from dst.vehicles.pictures import Camera

_TURN_M_S: Final = 2.0
"""Speed on a circle of a mission."""


class ItemEnd(Enum):
    """How an item has ended."""

    DONE = auto()
    LANDED = auto()  # The vehicle stands
    RETURNS = auto()  # The vehicle has to return, outside of its mission


class MissionFlight:
    """The mission that a vehicle has stored, as it is flown."""

    def __init__(
        self, scheduler: Scheduler, store: MissionStore, flight: Flight, autopilot: Autopilot
    ) -> None:
        self.current = 0
        """Index of the item that is flown, or is the next one."""
        self.is_complete = False
        self._scheduler = scheduler
        self._store = store
        self._flight = flight
        self._autopilot = autopilot
        self._circle: Circle | None = None
        self._wait_until_s = 0.0

    def select(self, seq: int) -> None:
        """Make an item the next one; one that is not there is ignored."""
        if seq < len(self._store.items):
            self.restart(seq)

    def restart(self, seq: int = 0) -> None:
        """Begin at an item, with a mission that may be another one."""
        self.current, self.is_complete = seq, False

    def interrupt(self) -> None:
        """Begin the current item anew when the mission is flown again."""
        self._circle = None
        self._wait_until_s = 0.0

    def advance(self) -> None:
        """Go on to the next item, or be complete."""
        if self.current + 1 < len(self._store.items):
            self.current += 1
        else:
            self.is_complete = True

    def fly(  # noqa: C901  # a case per command of an item
        self, camera: Camera | None
    ) -> ItemEnd | None:
        """Fly the current item for one step; gives how it has ended, if it has."""
        items = self._store.items
        if self.is_complete or self.current >= len(items):
            return None
        self.current = max(self.current, self._autopilot.first_item)
        item, truth = items[self.current], self._flight.truth
        is_done = True
        match item.command:
            case mavlink.MAV_CMD_NAV_TAKEOFF:
                truth.place_e7 = None
                is_done = self._flight.approach((truth.north_m, truth.east_m, item.z))
            case mavlink.MAV_CMD_NAV_WAYPOINT:
                is_done = self._fly_to(item)
            case mavlink.MAV_CMD_NAV_DELAY:
                is_done = self._has_waited(item.param1)
            case mavlink.MAV_CMD_IMAGE_START_CAPTURE if camera is not None:
                camera.start(item.param2, int(item.param3), item.param4)
            case mavlink.MAV_CMD_NAV_LOITER_TURNS:
                is_done = self._fly_round(item)
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH if self._autopilot.returns_in_mission:
                return ItemEnd.LANDED if self._flight.come_home() else None
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                return ItemEnd.RETURNS
            case mavlink.MAV_CMD_NAV_LAND:
                return ItemEnd.LANDED if self._flight.descend() else None
            case mavlink.MAV_CMD_DO_CHANGE_SPEED:
                self._flight.speed_m_s = item.param2 if item.param2 > 0.0 else SPEED_M_S
            case _:
                pass
        return ItemEnd.DONE if is_done else None

    def _fly_to(self, item: Any) -> bool:
        north_m, east_m = offset_m(item.x / 1e7, item.y / 1e7)
        is_there = self._flight.approach((north_m, east_m, item.z))
        if not is_there or not self._has_waited(item.param1):
            return False
        truth = self._flight.truth
        truth.place_e7 = item.x, item.y
        truth.reached.append(Reached(self._scheduler.now_s, item.x, item.y))
        return True

    def _fly_round(self, item: Any) -> bool:
        if self._circle is None:
            self._circle = circle_of(item, item.param3, _TURN_M_S)
        if not self._flight.turn(self._circle):
            return False
        self._circle = None
        return True

    def _has_waited(self, hold_s: float) -> bool:
        if not hold_s > 0.0:
            return True
        now_s = self._scheduler.now_s
        if not self._wait_until_s:
            self._wait_until_s = now_s + hold_s
        if now_s < self._wait_until_s:
            return False
        self._wait_until_s = 0.0
        return True

    def message(self, *, is_flown: bool, is_armed: bool) -> Any:
        """MISSION_CURRENT; `is_flown` if the vehicle is in its mission mode."""
        count = max(0, len(self._store.items) - self._autopilot.first_item)
        if not count:
            state = mavlink.MISSION_STATE_NO_MISSION
        elif self.is_complete:
            state = mavlink.MISSION_STATE_COMPLETE
        elif is_flown and is_armed:
            state = mavlink.MISSION_STATE_ACTIVE
        else:
            state = mavlink.MISSION_STATE_NOT_STARTED
        mode = 1 if is_flown else 2
        return mavlink.MAVLink_mission_current_message(self.current, count, state, mode)


def circle_of(message: Any, radius_m: float, speed_m_s: float) -> Circle:
    """Give the circle of an item or a command, its altitude relative to home."""
    north_m, east_m = offset_m(message.x / 1e7, message.y / 1e7)
    height_m = message.z - HOME[2] if message.z > HOME[2] / 2.0 else message.z
    place_e7 = message.x, message.y
    return Circle(north_m, east_m, height_m, radius_m, speed_m_s, *place_e7)
