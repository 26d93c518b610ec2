"""Mission mode: carries out the items in their order; the table of commands is at the end."""

import math
from collections.abc import Callable, Mapping

from uav_firmware.lib.mission_rules import HOVERING, PAYLOAD, altitude_amsl
from uav_firmware.lib.payload_rules import unset
from uav_firmware.lib.resets import EstimateStep
from uav_firmware.modules.navigator.circle import Circle
from uav_firmware.modules.navigator.flight import Flight, Speeds
from uav_firmware.modules.navigator.mission.cursor import MissionCursor
from uav_firmware.modules.navigator.mission.route import (
    AHEAD,
    Route,
    awaited_before,
    build,
    following,
    from_the_ground,
    speeds_after,
    stop_pictures,
    target_of,
)
from uav_firmware.modules.navigator.mission.tasks import (
    DelayTask,
    DistanceTask,
    Task,
    ToAltitudeTask,
    TurnTask,
    WaypointTask,
)
from uav_firmware.modules.navigator.modes.land import Land
from uav_firmware.modules.navigator.modes.navigator_mode import NavigatorMode
from uav_firmware.modules.navigator.modes.orbit import Orbit
from uav_firmware.modules.navigator.modes.return_to_launch import ReturnToLaunch
from uav_firmware.modules.navigator.modes.takeoff import Takeoff
from uav_firmware.modules.navigator.modes.yaw_commands import apply_region_of_interest
from uav_firmware.msg.guidance import RegionOfInterest
from uav_firmware.msg.mission import (
    Mission,
    MissionCommand,
    MissionItem,
    ModeTarget,
)

_NO_ROUTE = Route((), ())


class MissionMode(NavigatorMode):
    """AUTO_MISSION; finished when the last item is reached. Resumes at the current item."""

    def __init__(self) -> None:
        self.cursor = MissionCursor()
        self._task: Task | None = None
        self._route = _NO_ROUTE
        self._held = False  # The item is reached and waits for a command to continue
        self._speeds = Speeds()
        self._keeps_yaw = False  # The next leg keeps the heading of a CONDITION_YAW
        self._begin: Mapping[MissionCommand, Callable[[MissionItem, Flight], Task | None]] = {
            MissionCommand.NAV_WAYPOINT: self._fly_to,
            MissionCommand.NAV_LOITER_UNLIM: self._fly_to,
            MissionCommand.NAV_LOITER_TIME: self._fly_to,
            MissionCommand.NAV_SPLINE_WAYPOINT: self._fly_to,
            MissionCommand.NAV_LOITER_TURNS: self._orbit,
            MissionCommand.NAV_LOITER_TO_ALT: self._to_altitude,
            MissionCommand.NAV_TAKEOFF: self._take_off,
            MissionCommand.NAV_LAND: self._land,
            MissionCommand.NAV_RETURN_TO_LAUNCH: self._return,
            MissionCommand.NAV_DELAY: self._delay,
            MissionCommand.CONDITION_DELAY: self._delay_on_the_leg,
            MissionCommand.CONDITION_DISTANCE: self._wait_for_distance,
            MissionCommand.CONDITION_YAW: self._turn,
            MissionCommand.DO_CHANGE_SPEED: self._change_speed,
            MissionCommand.DO_SET_HOME: self._set_home,
            MissionCommand.DO_LAND_START: self._ignore,
            MissionCommand.DO_FENCE_ENABLE: self._switch_fence,
            MissionCommand.DO_SET_ROI: self._set_region_of_interest,
            MissionCommand.DO_SET_ROI_LOCATION: self._set_region_of_interest,
            MissionCommand.DO_SET_ROI_NONE: self._set_region_of_interest,
            **dict.fromkeys(PAYLOAD, self._command_payload),
        }

    def load(self, mission: Mission) -> None:
        """Replace the mission; a mode that is active must be activated again."""
        self.cursor.load(mission)
        self._held, self._speeds = False, Speeds()

    def select(self, seq: int, *, reset: bool) -> bool:
        """Set the current item; whether an active mode must be activated again."""
        before = self.cursor.seq
        self.cursor.select(seq, reset=reset)
        if reset:
            self._speeds = Speeds()
        if seq < 0 and not reset and self.cursor.seq == before:
            return False
        self._held = False
        return True

    def on_activation(self, flight: Flight, target: ModeTarget | None) -> None:
        """Resume at the current item, or at the next after an item that waited."""
        del target  # A mission has its own targets
        self.finished = False
        if self._held:
            self.cursor.advance()
        self._task, self._route, self._held = None, _NO_ROUTE, False
        flight.speeds = self._speeds
        flight.yaw_target = flight.yaw.yaw
        flight.hold()

    def on_inactivation(self, flight: Flight) -> None:
        """Keep the speeds that were commanded for the mission."""
        super().on_inactivation(flight)
        self._speeds = flight.speeds
        self._task = None

    def on_active(self, flight: Flight) -> None:
        """Begin the current item or check whether it is reached: one item a step."""
        item = self.cursor.item
        self.finished = self.cursor.complete
        if item is None:
            return
        self.cursor.begun = True
        self._extend_route(flight)
        if self._task is None:
            self._task = self._begin[MissionCommand(item.command)](item, flight)
        elif self._held:
            return
        if isinstance(self._task, WaypointTask) and self._task.missed(flight):
            self._task = self._fly_to(item, flight, stopping=True)
        if self._task is None or self._task.step(flight):
            self._reach(item, flight)

    def on_speeds(self, flight: Flight) -> None:
        """Fly the rest of the route with the commanded speeds."""
        item = self.cursor.item
        if item is None or item.seq not in self._route.seqs:
            super().on_speeds(flight)
            return
        passed = self._route.seqs.index(item.seq)
        seqs, waypoints = self._route.seqs[:passed], self._route.waypoints[:passed]
        rest = build(self.cursor.items, item.seq, flight, self.cursor.item_after_jumps)
        self._route = Route(seqs, waypoints).followed_by(rest)
        flight.path.reshape(self._route.waypoints)

    def _extend_route(self, flight: Flight) -> None:
        """Extend the route when the vehicle comes near its end."""
        route = self._route
        if route.rest is None or len(route.waypoints) - flight.path.passed >= AHEAD:
            return
        items, landing = self.cursor.items, self.cursor.item_after_jumps
        more = build(items, route.rest, flight, landing, route.speeds)
        self._route = route.followed_by(more)
        flight.path.extend(more.waypoints)

    def stays_on_ground(self, flight: Flight) -> bool:
        """Only a take-off or a waypoint leaves the ground."""
        item = self.cursor.item
        flying = item is not None and (
            item.command in HOVERING or item.command == MissionCommand.NAV_TAKEOFF
        )
        return flight.landed and (not flying or self._held)

    def on_reset(self, flight: Flight, step: EstimateStep) -> None:
        """Continue a circle or a climb at the present position; items stay fixed to the earth."""
        match self._task:
            case Orbit() as orbit:
                orbit.follow_reset(flight)
            case Takeoff() as takeoff:
                takeoff.follow_reset(flight, step)

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
            self._route = _NO_ROUTE  # A jump back ends the route
        self.finished = self.cursor.complete
        if self.finished and not flight.landed:
            flight.hold()

    def _fly_to(self, item: MissionItem, flight: Flight, *, stopping: bool = False) -> Task:
        """Join the route being flown, or begin one."""
        if item.seq not in self._route.seqs or stopping:
            route = build(self.cursor.items, item.seq, flight, self.cursor.item_after_jumps)
            if stopping:
                first = route.waypoints[0]._replace(tolerance=0.0)
                route = route._replace(waypoints=(first, *route.waypoints[1:]))
            self._route = from_the_ground(route, flight) if flight.landed else route
            flight.fly(*self._route.waypoints)
        flight.abort_down = math.nan
        own = item.command in {MissionCommand.NAV_WAYPOINT, MissionCommand.NAV_LOITER_UNLIM}
        yaw = item.param4 if own else math.nan
        if not (self._keeps_yaw and math.isnan(yaw)):
            flight.face(yaw)
        self._keeps_yaw = False
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
        flight.payload_commands.append(stop_pictures(item))
        self._route = _NO_ROUTE
        return ReturnToLaunch(flight)

    def _delay(self, item: MissionItem, flight: Flight) -> Task:
        self._route = _NO_ROUTE
        return DelayTask(item, flight)

    def _change_speed(self, item: MissionItem, flight: Flight) -> None:
        flight.speeds = speeds_after(item, flight.speeds)
        if awaited_before(self.cursor.items, item.seq):
            flight.path.relimit(flight.limits())

    def _orbit(self, item: MissionItem, flight: Flight) -> Task:
        self._route = _NO_ROUTE
        radius = flight.params.orbit_radius if unset(item.param3) else item.param3
        return Orbit(
            flight,
            Circle(target_of(item, flight), radius),
            speed=math.nan,
            angle=item.param1 * math.tau,
            heading=None,
        )

    def _to_altitude(self, item: MissionItem, flight: Flight) -> Task:
        self._route = _NO_ROUTE
        flight.face(math.nan)
        return ToAltitudeTask(flight, target_of(item, flight))

    def _fly_to_next(self, item: MissionItem, flight: Flight) -> MissionItem | None:
        """Fly to the next position during a condition; None when no position follows."""
        goal = following(self.cursor.items, item.seq, self.cursor.item_after_jumps)
        if goal is None or goal.command not in HOVERING or flight.landed:
            return None
        if goal.seq not in self._route.seqs:
            self._fly_to(goal, flight)
        return goal

    def _delay_on_the_leg(self, item: MissionItem, flight: Flight) -> Task:
        self._fly_to_next(item, flight)
        return DelayTask(item, flight)

    def _wait_for_distance(self, item: MissionItem, flight: Flight) -> Task | None:
        goal = self._fly_to_next(item, flight)
        return None if goal is None else DistanceTask(item, target_of(goal, flight))

    def _turn(self, item: MissionItem, flight: Flight) -> Task:
        self._route = _NO_ROUTE
        self._keeps_yaw = True
        return TurnTask(item, flight)

    def _set_home(self, item: MissionItem, flight: Flight) -> None:
        flight.home_commands.append(item)

    def _switch_fence(self, item: MissionItem, flight: Flight) -> None:
        flight.switch_fence(enabled=item.param1 == 1.0)

    def _ignore(self, item: MissionItem, flight: Flight) -> None:
        """DO_LAND_START only marks where the approach to a landing begins."""

    def _command_payload(self, item: MissionItem, flight: Flight) -> None:
        flight.payload_commands.append(item)

    def _set_region_of_interest(self, item: MissionItem, flight: Flight) -> None:
        none = item.command == MissionCommand.DO_SET_ROI_NONE or (
            item.command == MissionCommand.DO_SET_ROI and unset(item.param1)
        )
        home = flight.home.altitude_amsl_m if flight.home is not None else 0.0
        place = (item.x, item.y, altitude_amsl(item, home))
        region = (math.nan, math.nan, math.nan) if none else place
        apply_region_of_interest(flight, RegionOfInterest(flight.now_us, *region))
