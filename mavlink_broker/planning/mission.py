"""A mission to what a vehicle flies: stretches of mission items, and live actions between them.

Everything is one stretch where the vehicle's family takes it all as items, so that a link that
is lost after the start costs nothing. A stretch that does not end on the ground ends in a hold.
"""

from dataclasses import dataclass, field, replace
from typing import Final, Self, TypeAlias

from afarcloud.commands import FLYING, CameraImage, Command, NavWaypoint
from afarcloud.enumerations import CommandType
from afarcloud.plan import Mission
from mavlink_broker.autopilots.families import Family
from mavlink_broker.mavlink import mission_item
from mavlink_broker.mavlink.dialect import Message, mavlink
from mavlink_broker.mavlink.mission_item import MissionItem
from mavlink_broker.microservices.borrowed_parameters import Loan
from mavlink_broker.planning.commands import translate_command
from mavlink_broker.planning.live_actions import LiveAction
from mavlink_broker.planning.situation import Home, Items, Refusal, RefusedError, Situation
from mavlink_broker.planning.speed_items import with_speed

__all__ = ["FlightPlan", "Home", "Itinerary", "LiveCommand", "RefusedError", "translate"]

_NOTHING_TO_HOLD_AT = Refusal(
    "command_type_id", "nothing before it says where the vehicle is to be when the mission ends"
)
_ON_THE_GROUND = Refusal("command_type_id", "it follows a landing: a take-off has to come first")


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPlan:
    """The items of one stretch and what they belong to.

    Commands are told by their place in the mission's `command_array`. Items that serve the whole
    stretch (home, the speed, the hold at its end) belong to the command next to them.
    """

    items: tuple[MissionItem, ...]
    command_of_item: tuple[int, ...]
    done_item: tuple[int, ...]  # Per command of the stretch: the item that finishes it
    notes: tuple[tuple[str, ...], ...]  # Per command: what was left out, for its report
    first_item: int  # At which the mission begins: 1 behind home, else 0
    ends_on_ground: bool  # The last command lands: it ends on the ground and disarmed
    first_command: int = 0
    loans: tuple[tuple[int, Loan], ...] = ()  # Parameters borrowed, each with its command

    @classmethod
    def empty(cls) -> Self:
        """Give the plan of nothing, before there is one."""
        return cls(
            items=(), command_of_item=(), done_item=(), notes=(), first_item=0, ends_on_ground=True
        )

    @property
    def first_leg(self) -> int:
        """The first item, from where the mission begins, that a vehicle navigates by."""
        legs = (
            seq
            for seq, item in enumerate(self.items)
            if seq >= self.first_item and item.command <= mavlink.MAV_CMD_NAV_LAST
        )
        return next(legs, self.first_item)

    @property
    def comes_down_at_once(self) -> bool:
        """Whether its only leg is a landing or a return, so that it may end in the mode of one."""
        legs = [
            item
            for item in self.items[self.first_leg :]
            if item.command <= mavlink.MAV_CMD_NAV_LAST
        ]
        return self.ends_on_ground and len(legs) == 1

    @property
    def commands(self) -> range:
        """The commands that it flies."""
        return range(self.first_command, self.first_command + len(self.done_item))

    def first_item_of(self, command: int) -> int:
        """Give the first item that belongs to a command."""
        return self.command_of_item.index(command)

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
    """A whole mission, in the order of its flight."""

    segments: tuple[Segment, ...]

    @property
    def ends_on_ground(self) -> bool:
        """Whether the vehicle stands at the end; pictures and video change nothing about that."""
        moving = [
            segment.ends_on_ground if isinstance(segment, FlightPlan) else False
            for segment in self.segments
            if isinstance(segment, FlightPlan) or segment.action.moves
        ]
        return bool(moving) and moving[-1]

    @property
    def notes(self) -> tuple[tuple[str, ...], ...]:
        """Per command: what was left out or is done in another way."""
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
"""Of a stretch: home, its speed, which some are told three times, and the hold at its end."""


@dataclass(slots=True)
class _Stretch:
    """Items that are being put together."""

    first_command: int
    items: list[MissionItem] = field(default_factory=list)
    owners: list[int] = field(default_factory=list)
    done: list[int] = field(default_factory=list)
    notes: list[tuple[str, ...]] = field(default_factory=list)
    loans: list[tuple[int, Loan]] = field(default_factory=list)
    ends_on_ground: bool = False
    has_speed: bool = False

    def add(self, owner: int, *more: MissionItem) -> None:
        self.items.extend(more)
        self.owners.extend([owner] * len(more))

    def contradicts(self, part: Items) -> bool:
        """Whether it borrows a parameter at another value."""
        values = {setting.name: setting.value for _, loan in self.loans for setting in loan}
        return any(
            values.get(setting.name, setting.value) != setting.value
            for loan in part.loans
            for setting in loan
        )

    def take(self, owner: int, part: Items) -> None:
        known = {loan for _, loan in self.loans}
        self.loans += [(owner, loan) for loan in part.loans if loan not in known]
        self.done.append(len(self.items) + part.done)
        self.notes.append(part.notes)
        self.ends_on_ground = part.ends_on_ground
        self.add(owner, *part.items)


class _Translation:
    """Goes through the commands and keeps what the next one has to know."""

    def __init__(
        self, mission: Mission, situation: Situation, most_items: int | None = None
    ) -> None:
        self._most_items = most_items
        self._mission = mission
        self._situation = situation
        self._at_home = False
        self._landed = False
        self._stretch: _Stretch | None = None
        self.segments: list[Segment] = []

    def go(self) -> Itinerary:
        for index, command in enumerate(self._mission.command_array):
            self._refuse_on_ground(index, command)
            part = translate_command(index, command, self._situation)
            if isinstance(part, LiveAction):
                self._close()
                self.segments.append(LiveCommand(index, part))
                if part.moves:
                    self._situation = self._situation._replace(spot=part.ends_at, after_live=True)
            else:
                self._take(index, command, part)
            self._situation = self._situation._replace(aim=self._aim_behind(command, part))
        self._close()
        return Itinerary(tuple(self.segments))

    def _aim_behind(
        self, command: Command, part: Items | LiveAction
    ) -> tuple[float, float | None] | None:
        """Where the camera looks behind a command, as far as that is known."""
        if isinstance(command, CameraImage):
            return command.parameters.pitch_angle, command.parameters.yaw_angle
        return None if isinstance(part, LiveAction) else self._situation.aim

    def _refuse_on_ground(self, index: int, command: Command) -> None:
        kind = command.command_type_id
        if self._landed and kind in FLYING and kind is not CommandType.NAV_TAKEOFF:
            raise RefusedError(index, command, _ON_THE_GROUND)

    def _take(self, index: int, command: Command, part: Items) -> None:
        if self._stretch is not None and self._must_end(self._stretch, part):
            self._close()
        if self._stretch is None:
            self._stretch = _Stretch(index)
            if self._situation.family.home_is_item_0:
                self._stretch.add(index, _home_item(self._situation.home))
        stretch = self._stretch
        if not stretch.has_speed and command.command_type_id in FLYING:
            stretch.has_speed = True
            part = with_speed(part, self._mission.maximum_speed, self._situation.family)
        stretch.take(index, part)
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

    def _must_end(self, stretch: _Stretch, part: Items) -> bool:
        """Whether a stretch cannot take one more part, and the vehicle can wait where it ends."""
        if stretch.contradicts(part):
            return True
        if self._most_items is None or self._situation.spot is None:
            return False
        return len(stretch.items) + len(part.items) + SPARE_ITEMS > self._most_items

    def _close(self) -> None:
        stretch, self._stretch = self._stretch, None
        if stretch is None:
            return
        if not stretch.ends_on_ground:
            last = stretch.owners[-1]
            stretch.add(last, self._hold(last))
        self.segments.append(
            FlightPlan(
                items=tuple(stretch.items),
                command_of_item=tuple(stretch.owners),
                done_item=tuple(stretch.done),
                notes=tuple(stretch.notes),
                first_item=int(self._situation.family.home_is_item_0),
                ends_on_ground=stretch.ends_on_ground,
                first_command=stretch.first_command,
                loans=tuple(stretch.loans),
            )
        )

    def _hold(self, last: int) -> MissionItem:
        """Stay at the last place; arriving at this item also proves the one before."""
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
) -> Itinerary:
    """Translate a whole mission for one family of autopilots.

    The same mission, family, home and refusals always give the same items. `refused` are the
    MAV_CMDs that the vehicle has refused as mission items; a stretch of more than `most_items` is
    flown in parts, between which the vehicle holds.

    Raises:
        RefusedError: for the first command that cannot be flown.
    """
    situation = Situation(
        family,
        home,
        mission_id=mission.mission_id,
        own_system=own_system,
        refused=refused,
        maximum_speed_m_s=mission.maximum_speed,
        common_radius_m=_common_radius_m(mission),
        after_live=not any(one.command_type_id in FLYING for one in mission.command_array),
    )
    return _Translation(mission, situation, most_items).go()


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
