"""Mission mode: carries out the items one after the other; the table of kinds stands at its end."""

import math
from collections.abc import Callable, Mapping
from typing import ClassVar

from uav_firmware.modules.navigator.flight import Flight, Speeds
from uav_firmware.modules.navigator.land import Land
from uav_firmware.modules.navigator.mission_cursor import MissionCursor
from uav_firmware.modules.navigator.mission_route import (
    HOVERING,
    Route,
    build,
    from_the_ground,
    speeds_after,
    target_of,
)
from uav_firmware.modules.navigator.mission_tasks import DelayTask, Task, WaypointTask
from uav_firmware.modules.navigator.mode import NavigatorMode
from uav_firmware.modules.navigator.return_home import ReturnHome
from uav_firmware.modules.navigator.takeoff import Takeoff
from uav_firmware.msg.mission import (
    Mission,
    MissionCommand,
    MissionItem,
    ModeTarget,
)

_NO_ROUTE = Route((), ())


class MissionMode(NavigatorMode):
    """AUTO_MISSION; finished when the last item is reached. Goes on where it was left."""

    def __init__(self) -> None:
        self.cursor = MissionCursor()
        self._task: Task | None = None
        self._route = _NO_ROUTE
        self._held = False  # The item is reached and waits to be told to go on
        self._speeds = Speeds()

    def load(self, mission: Mission) -> None:
        """Replace the mission; a mode that is active must be activated again."""
        self.cursor.load(mission)
        self._held, self._speeds = False, Speeds()

    def select(self, seq: int, *, reset: bool) -> bool:
        """Choose the item to fly next; whether an active mode must be activated again."""
        before = self.cursor.seq
        self.cursor.select(seq, reset=reset)
        if reset:
            self._speeds = Speeds()
        if seq < 0 and not reset and self.cursor.seq == before:
            return False
        self._held = False
        return True

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Go on at the current item; after one that waited, at the next."""
        del target  # a mission brings its own
        self.finished = False
        if self._held:
            self.cursor.advance()
        self._task, self._route, self._held = None, _NO_ROUTE, False
        flight.speeds = self._speeds
        flight.yaw_target = flight.yaw.yaw
        flight.hold()

    def on_inactivation(self, flight: Flight) -> None:
        """Keep what was commanded for the mission."""
        super().on_inactivation(flight)
        self._speeds = flight.speeds
        self._task = None

    def on_active(self, flight: Flight) -> None:
        """Begin the current item or see whether it is reached: one item a step."""
        item = self.cursor.item
        self.finished = self.cursor.complete
        if item is None:
            return
        self.cursor.begun = True
        if self._task is None:
            self._task = self._BEGIN[MissionCommand(item.command)](self, item, flight)
        elif self._held:
            return
        if isinstance(self._task, WaypointTask) and self._task.missed(flight):
            self._task = self._fly_to(item, flight, stopping=True)
        if self._task is None or self._task.step(flight):
            self._reach(item, flight)

    def on_speeds(self, flight: Flight) -> None:
        """Fly the rest of the route with the speeds commanded."""
        item = self.cursor.item
        if item is None or item.seq not in self._route.seqs:
            super().on_speeds(flight)
            return
        behind = self._route.waypoints[: self._route.seqs.index(item.seq)]
        rest = build(self.cursor.items, item.seq, flight).waypoints
        self._route = self._route._replace(waypoints=(*behind, *rest))
        flight.path.reshape(self._route.waypoints)

    def sits(self, flight: Flight) -> bool:
        """On the ground only items that fly leave it."""
        item = self.cursor.item
        flying = item is not None and (
            item.command in HOVERING or item.command == MissionCommand.NAV_TAKEOFF
        )
        return flight.landed and (not flying or self._held)

    def _reach(self, item: MissionItem, flight: Flight) -> None:
        waits = not item.autocontinue or item.command == MissionCommand.NAV_LOITER_UNLIM
        last = item.seq == len(self.cursor.items) - 1
        self.cursor.reach()
        if waits and not last:
            self._held = True
            return
        self._task = None
        self.cursor.advance()
        if self.cursor.seq <= item.seq:
            self._route = _NO_ROUTE  # a jump back: the route lies behind
        self.finished = self.cursor.complete
        if self.finished and not flight.landed:
            flight.hold()

    def _fly_to(self, item: MissionItem, flight: Flight, *, stopping: bool = False) -> Task:
        """Join the route being flown, or begin one."""
        if item.seq not in self._route.seqs or stopping:
            route = build(self.cursor.items, item.seq, flight)
            if stopping:
                first = route.waypoints[0]._replace(tolerance=0.0)
                route = route._replace(waypoints=(first, *route.waypoints[1:]))
            self._route = from_the_ground(route, flight) if flight.landed else route
            flight.fly(*self._route.waypoints)
        flight.abort_down = math.nan
        flight.face(item.param4 if item.command != MissionCommand.NAV_LOITER_TIME else math.nan)
        return WaypointTask(item, self._route)

    def _take_off(self, item: MissionItem, flight: Flight) -> Task:
        self._route = _NO_ROUTE
        radius = flight.params.acceptance_radius
        return Takeoff(flight, target_of(item, flight), item.param4, radius)

    def _land(self, item: MissionItem, flight: Flight) -> Task:
        self._route = _NO_ROUTE
        target = target_of(item, flight)
        if math.isnan(item.z):
            target = (target[0], target[1], flight.home_down(0.0))
        flight.abort_down = target[2] - item.param1 if item.param1 > 0.0 else math.nan
        return Land(flight, target, item.param4)

    def _return(self, item: MissionItem, flight: Flight) -> Task:
        del item  # it has no parameters
        self._route = _NO_ROUTE
        return ReturnHome(flight)

    def _delay(self, item: MissionItem, flight: Flight) -> Task:
        self._route = _NO_ROUTE
        return DelayTask(item, flight)

    def _change_speed(self, item: MissionItem, flight: Flight) -> None:
        flight.speeds = speeds_after(item, flight.speeds)

    _BEGIN: ClassVar[
        Mapping[MissionCommand, Callable[["MissionMode", MissionItem, Flight], Task | None]]
    ] = {
        MissionCommand.NAV_WAYPOINT: _fly_to,
        MissionCommand.NAV_LOITER_UNLIM: _fly_to,
        MissionCommand.NAV_LOITER_TIME: _fly_to,
        MissionCommand.NAV_TAKEOFF: _take_off,
        MissionCommand.NAV_LAND: _land,
        MissionCommand.NAV_RETURN_TO_LAUNCH: _return,
        MissionCommand.NAV_DELAY: _delay,
        MissionCommand.DO_CHANGE_SPEED: _change_speed,
    }
