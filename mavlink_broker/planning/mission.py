"""Translates a mission to what a vehicle flies: segments of mission items, live actions between.

The mission is one segment of items if the vehicle's family supports all its commands as items, so
that a lost link after the start has no effect. A segment that does not end on the ground ends in a
hold.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, Final, Self, TypeAlias

from afarcloud.commands import FLYING, CameraImage, Command, NavWaypoint
from afarcloud.enumerations import CommandType
from afarcloud.geodesy import distance_m
from afarcloud.plan import Mission
from afarcloud.route import Spot
from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink import mission_item
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.config_overrides import ParameterOverride
from mavlink_broker.planning import camera_commands, flight_commands, target_commands
from mavlink_broker.planning.flight_commands import (
    LegSpeeds,
    horizontal_share,
    horizontal_speed_m_s,
    with_speed,
)
from mavlink_broker.planning.hotpoint import hotpoint
from mavlink_broker.planning.situation import (
    Home,
    Items,
    LiveAction,
    Refusal,
    RefusedError,
    Situation,
)

FASTEST_M_S: Final = 20.0
"""Over ground: no vehicle that is flown here is faster, with the wind behind it."""
_HOLDING: Final = frozenset({mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_DELAY})
"""Items whose first parameter is a time to wait [s]."""
Translator: TypeAlias = Callable[[Any, Situation], Items | LiveAction | Refusal]

TRANSLATORS: Final[Mapping[CommandType, Translator]] = {
    CommandType.NAV_TAKEOFF: flight_commands.takeoff,
    CommandType.NAV_LAND: flight_commands.land,
    CommandType.NAV_WAYPOINT: flight_commands.waypoint,
    CommandType.CAMERA_IMAGE: camera_commands.image,
    CommandType.VIDEO_START_CAPTURE: camera_commands.video_start,
    CommandType.VIDEO_STOP_CAPTURE: camera_commands.video_stop,
    CommandType.NAV_HOTPOINT: hotpoint,
    CommandType.NAV_FOLLOW_TARGET: target_commands.follow,
    CommandType.NAV_TRACK_SUBJECT: target_commands.track,
    CommandType.CAMERA_PANORAMA: camera_commands.panorama,
    CommandType.NAV_HOME: flight_commands.home,
}

_NOTHING_TO_HOLD_AT = Refusal(
    "command_type_id", "nothing before it says where the vehicle is to be when the mission ends"
)
_ON_THE_GROUND = Refusal("command_type_id", "it follows a landing: a take-off has to come first")


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """The items of one segment, and the command of each.

    Commands are indices of the mission's `command_array`. Items of the whole segment (home, the
    speed, the hold at its end) belong to the command next to them.
    """

    items: tuple[MissionItem, ...]
    command_of_item: tuple[int, ...]
    done_item: tuple[int, ...]  # Per command of the segment: the item that completes it
    notes: tuple[tuple[str, ...], ...]  # Per command: what was left out, for its report
    first_item: int  # The first item that is flown: 1 after home, else 0
    ends_on_ground: bool  # The last command lands: it ends on the ground and disarmed
    first_command: int = 0
    overrides: tuple[tuple[int, ParameterOverride], ...] = ()  # Each with its command's index

    @classmethod
    def empty(cls) -> Self:
        """Give an empty plan."""
        return cls(
            items=(), command_of_item=(), done_item=(), notes=(), first_item=0, ends_on_ground=True
        )

    @property
    def _legs(self) -> list[int]:
        """The navigation items that are flown."""
        own = range(self.first_item, len(self.items))
        return [seq for seq in own if self.items[seq].command <= mavlink.MAV_CMD_NAV_LAST]

    @property
    def first_leg(self) -> int:
        """The first navigation item that is flown; the first item if there is none."""
        return next(iter(self._legs), self.first_item)

    @property
    def last_leg(self) -> int:
        """The last navigation item that is flown; the first item if there is none."""
        return max(self._legs, default=self.first_item)

    @property
    def least_time_s(self) -> float:
        """Least time to fly its items: the legs between their places, and the holds [s]."""
        legs = [self.items[seq] for seq in self._legs]
        places = [(item.latitude_deg, item.longitude_deg) for item in legs if item.is_positional]
        way_m = sum(distance_m(*before, *after) for before, after in pairwise(places))
        holds_s = sum(max(0.0, item.parameters[0]) for item in legs if item.command in _HOLDING)
        return way_m / FASTEST_M_S + holds_s

    @property
    def comes_down_at_once(self) -> bool:
        """Whether its only leg is a landing or a return, so that it may end in that mode."""
        return self.ends_on_ground and len(self._legs) == 1

    @property
    def returns_home(self) -> bool:
        """Whether its last item returns the vehicle."""
        return bool(self.items[-1].command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)

    @property
    def commands(self) -> range:
        """The commands that it flies."""
        return range(self.first_command, self.first_command + len(self.done_item))

    def messages(self, system: int, component: int) -> tuple[Message, ...]:
        """Give the items as they are uploaded to a vehicle."""
        return tuple(
            mission_item.to_message(
                item, seq=seq, first=self.first_item, system=system, component=component
            )
            for seq, item in enumerate(self.items)
        )


@dataclass(frozen=True, slots=True)
class LiveCommand:
    """A command that is flown live."""

    command: int
    action: LiveAction

    @property
    def commands(self) -> range:
        """The commands that it flies: one."""
        return range(self.command, self.command + 1)


Segment: TypeAlias = FlightPlan | LiveCommand


@dataclass(frozen=True, slots=True)
class Itinerary:
    """A whole mission: its segments in the order of the flight."""

    segments: tuple[Segment, ...]

    @property
    def ends_on_ground(self) -> bool:
        """Whether the vehicle is landed at the end; pictures and video have no effect on that."""
        moving = [
            segment.ends_on_ground if isinstance(segment, FlightPlan) else False
            for segment in self.segments
            if isinstance(segment, FlightPlan) or segment.action.moves
        ]
        return bool(moving) and moving[-1]

    @property
    def notes(self) -> tuple[tuple[str, ...], ...]:
        """Per command: what was left out or is done differently."""
        return tuple(
            note
            for segment in self.segments
            for note in (
                segment.notes if isinstance(segment, FlightPlan) else (segment.action.notes,)
            )
        )

    def segment_of(self, command: int) -> int:
        """Give the number of the segment that flies a command; beyond the last, the last."""
        numbers = (n for n, segment in enumerate(self.segments) if command in segment.commands)
        return next(numbers, len(self.segments) - 1)


SPARE_ITEMS: Final = 6
"""Items of a segment besides its commands: home, its speed (up to three items), and the hold at its
end."""


@dataclass(slots=True)
class _Segment:
    """The items of a segment that is not complete."""

    first_command: int
    items: list[MissionItem] = field(default_factory=list)
    owners: list[int] = field(default_factory=list)
    done: list[int] = field(default_factory=list)
    notes: list[tuple[str, ...]] = field(default_factory=list)
    overrides: list[tuple[int, ParameterOverride]] = field(default_factory=list)
    ends_on_ground: bool = False
    has_speed: bool = False
    leg_speeds: LegSpeeds = field(default_factory=LegSpeeds)

    def add(self, owner: int, *more: MissionItem) -> None:
        self.items.extend(more)
        self.owners.extend([owner] * len(more))

    def contradicts(self, part: Items) -> bool:
        """Whether it overrides a parameter with another value."""
        values = {
            setting.name: setting.value for _, override in self.overrides for setting in override
        }
        return any(
            values.get(setting.name, setting.value) != setting.value
            for override in part.overrides
            for setting in override
        )

    def take(self, owner: int, part: Items) -> None:
        known = {override for _, override in self.overrides}
        self.overrides += [
            (owner, override) for override in part.overrides if override not in known
        ]
        self.done.append(len(self.items) + part.done)
        self.notes.append(part.notes)
        self.ends_on_ground = part.ends_on_ground
        self.add(owner, *part.items)


def _translate_command(index: int, command: Command, situation: Situation) -> Items | LiveAction:
    """Translate the command at `index` of a mission.

    Raises:
        RefusedError: if it cannot be flown where it stands.
    """
    translated = TRANSLATORS[command.command_type_id](command, situation)
    if isinstance(translated, Refusal):
        raise RefusedError(index, command, translated)
    return translated


class _Translation:
    """Translates the commands in order; each changes the situation of the next."""

    def __init__(self, mission: Mission, situation: Situation, most_items: int | None) -> None:
        self._most_items = most_items
        self._mission = mission
        self._situation = situation
        self._at_home = False
        self._landed = False
        self._segment: _Segment | None = None
        self.segments: list[Segment] = []

    def run(self) -> Itinerary:
        for index, command in enumerate(self._mission.command_array):
            self._refuse_on_ground(index, command)
            part = _translate_command(index, command, self._situation)
            if isinstance(part, LiveAction):
                self._close()
                self.segments.append(LiveCommand(index, self._with_approach_speed(part)))
                if part.moves:
                    self._situation = self._situation._replace(spot=part.ends_at, after_live=True)
            else:
                self._take(index, command, part)
            self._situation = self._situation._replace(aim=self._aim_behind(command, part))
        self._close()
        return Itinerary(tuple(self.segments))

    @property
    def _start(self) -> Spot | None:
        """Where the next command begins; None if that is unknown."""
        return None if self._situation.after_live else self._situation.spot

    def _with_approach_speed(self, action: LiveAction) -> LiveAction:
        """Bound the leg to the start of a live command, which may climb."""
        start, end, speed_m_s = self._start, action.approach, action.approach_speed_m_s
        if not self._situation.family.limits_horizontal_speed or speed_m_s is None:
            return action
        if start is None or end is None:
            return action
        bound_m_s = horizontal_speed_m_s(speed_m_s, horizontal_share(start, end))
        return replace(action, approach_speed_m_s=bound_m_s)

    def _aim_behind(
        self, command: Command, part: Items | LiveAction
    ) -> tuple[float, float | None] | None:
        """Give the camera's direction after a command, if it is known."""
        if isinstance(command, CameraImage):
            return command.parameters.pitch_angle, command.parameters.yaw_angle
        return None if isinstance(part, LiveAction) else self._situation.aim

    def _refuse_on_ground(self, index: int, command: Command) -> None:
        kind = command.command_type_id
        if self._landed and kind in FLYING and kind is not CommandType.NAV_TAKEOFF:
            raise RefusedError(index, command, _ON_THE_GROUND)

    def _take(self, index: int, command: Command, part: Items) -> None:
        if self._segment is not None and self._must_end(self._segment, part):
            self._close()
        if self._segment is None:
            self._segment = _Segment(index)
            if self._situation.family.home_is_item_0:
                self._segment.add(index, _home_item(self._situation.home))
        segment = self._segment
        if not segment.has_speed and command.command_type_id in FLYING:
            segment.has_speed = True
            part = with_speed(part, self._mission.maximum_speed, self._situation.family)
        if self._situation.family.limits_horizontal_speed:
            part = segment.leg_speeds.bound(part, self._start)
        segment.take(index, part)
        if part.spot is not None:
            self._at_home = part.at_home
            self._situation = self._situation._replace(
                spot=part.spot,
                relative_altitude_m=part.spot.relative_altitude_m,
                after_live=False,
            )
            self._landed = False
        if part.heading_deg is not None:
            self._situation = self._situation._replace(heading_deg=part.heading_deg)
        if part.ends_on_ground:
            self._landed = True
            self._situation = self._situation._replace(spot=None, after_live=True)
            self._close()

    def _must_end(self, segment: _Segment, part: Items) -> bool:
        """Whether a segment must end before a part, and the vehicle can wait at its end."""
        if segment.contradicts(part):
            return True
        if self._most_items is None or self._situation.spot is None:
            return False
        return len(segment.items) + len(part.items) + SPARE_ITEMS > self._most_items

    def _close(self) -> None:
        segment, self._segment = self._segment, None
        if segment is None:
            return
        if not segment.ends_on_ground:
            last = segment.owners[-1]
            segment.add(last, self._hold(last))
        self.segments.append(
            FlightPlan(
                items=tuple(segment.items),
                command_of_item=tuple(segment.owners),
                done_item=tuple(segment.done),
                notes=tuple(segment.notes),
                first_item=int(self._situation.family.home_is_item_0),
                ends_on_ground=segment.ends_on_ground,
                first_command=segment.first_command,
                overrides=tuple(segment.overrides),
            )
        )

    def _hold(self, last: int) -> MissionItem:
        """Stay at the last position; reaching this item also completes the previous one."""
        if self._situation.spot is None:
            command = self._mission.command_array[last]
            raise RefusedError(last, command, _NOTHING_TO_HOLD_AT)
        hold = mission_item.hold(
            **self._situation.spot._asdict(), yaw_deg=self._situation.family.hold_yaw_deg
        )
        return replace(hold, at_home=self._at_home)


def translate(
    mission: Mission,
    family: Family,
    home: Home,
    *,
    own_system: int = 254,
    refused: frozenset[int] = frozenset(),
    most_items: int | None = None,
    flight: str = "",
) -> Itinerary:
    """Translate a whole mission for one family of autopilots.

    The same mission, family, home, refusals and `flight` always give the same items. `flight`
    distinguishes missions of one number, which a vehicle flies one after the other. `refused` are
    the MAV_CMDs that the vehicle has refused as mission items; a segment of more than `most_items`
    is flown in parts, between which the vehicle holds.

    Raises:
        RefusedError: for the first command that cannot be flown.
    """
    situation = Situation(
        family,
        home,
        mission_id=mission.mission_id,
        flight=flight,
        own_system=own_system,
        refused=refused,
        maximum_speed_m_s=mission.maximum_speed,
        common_radius_m=_common_radius_m(mission),
        after_live=not any(one.command_type_id in FLYING for one in mission.command_array),
    )
    return _Translation(mission, situation, most_items).run()


def _common_radius_m(mission: Mission) -> float | None:
    """Acceptance radius of all its waypoints; None if they differ."""
    radii = {
        command.parameters.acceptance_radius
        for command in mission.command_array
        if isinstance(command, NavWaypoint)
    }
    return radii.pop() if len(radii) == 1 else None


def _home_item(home: Home) -> MissionItem:
    return mission_item.home(
        latitude_deg=home.latitude_deg,
        longitude_deg=home.longitude_deg,
        altitude_amsl_m=home.altitude_amsl_m,
    )
