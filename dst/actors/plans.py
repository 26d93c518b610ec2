"""The mission plans of an operator, as a seed draws them: places, circles, pictures, subjects."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, Final, NamedTuple

from dst.faults.kinds import Fault
from dst.scheduler import Scheduler
from dst.vehicles.flight import is_same_place, place
from dst.vehicles.pictures import SINGLE, Series
from dst.vehicles.tracking import Rectangle

FENCED_SHARE: Final = 0.5
FENCE_M: Final = 60.0
"""Half the side of the square about home that plans stay within."""
HIGHEST_M: Final = 20.0
GEOFENCE: Final = {
    "inclusion": [
        [
            list(place(north_m, east_m))
            for north_m, east_m in (
                (-FENCE_M, -FENCE_M),
                (-FENCE_M, FENCE_M),
                (FENCE_M, FENCE_M),
                (FENCE_M, -FENCE_M),
            )
        ]
    ],
    "max_altitude": HIGHEST_M,
}
EXPIRING_SHARE: Final = 0.5
"""How often a plan says when it expires."""
MEAN_LIFETIME_S: Final = 20.0
LONG_SHARE: Final = 0.5
LANDING: Final = 20
"""`command_id` of the last command."""
ALTITUDE_M: Final = 5.0

WAYPOINT, IMAGE, HOTPOINT, FOLLOW, TRACK, PANORAMA = 3, 4, 7, 8, 9, 10
"""`command_type_id`."""
PICTURES_SHARE: Final = 0.4
"""How often pictures are taken at a place."""
PANORAMA_SHARE: Final = 0.2
FIRST_PICTURES: Final = 100
"""`command_id` of pictures, less that of the command before, which has the place."""
MORE_PICTURES: Final = 100
"""`command_id` of the next pictures at that place, less that of the ones before."""
MORE_PICTURES_SHARE: Final = 0.4
MOST_PICTURES: Final = 3
"""Commands of pictures at one place."""
FIRST_TRACK: Final = 400
"""`command_id` of a subject that is tracked, less that of the command before."""
TRACK_SHARE: Final = 0.1
TRACK_MODES: Final = 5
RADIUS_M: Final = 5.0
"""Of the circles."""
FIELDS: Final[dict[int, dict[str, Any]]] = {
    WAYPOINT: {"altitude": ALTITUDE_M},
    HOTPOINT: {"orbit_altitude": ALTITUDE_M, "radius": RADIUS_M, "angular_velocity": 20.0},
    FOLLOW: {"altitude": ALTITUDE_M},
}


class PlannedPictures(NamedTuple):
    """The pictures of one command."""

    place_e7: tuple[int, int]
    """Where they are taken: latitude and longitude [1e-7 deg]."""
    series: Series | None
    """No other command at this place has the same; None for a panorama."""


@dataclass
class PlannedCommands:
    """What the commands of a mission order, each by its command id."""

    waypoints: dict[int, tuple[int, int]] = field(default_factory=dict)
    """Latitude and longitude [1e-7 deg]."""
    circles: dict[int, tuple[int, int]] = field(default_factory=dict)
    """The centre, as of a waypoint."""
    pictures: dict[int, PlannedPictures] = field(default_factory=dict)
    subjects: dict[int, Rectangle] = field(default_factory=dict)
    """What the camera tracks."""


class DrawnPlan(NamedTuple):
    """A plan of one mission, as it can be posted."""

    key: str
    """Of the request: no other plan has it."""
    body: dict[str, Any]
    mission_id: int
    vehicle_id: int
    commands: PlannedCommands
    lifetime_s: float | None
    """Until it expires; None: as long as the edge server lets plans live."""


class Planner:
    """Draws plans, one after the other."""

    def __init__(
        self,
        scheduler: Scheduler,
        vehicles: Sequence[int],
        enabled: Collection[Fault],
        random: Random,
    ) -> None:
        """Plan for some of the `vehicles`; `random` is the source that the operator uses too."""
        self._vehicles = vehicles
        self._enabled = frozenset(enabled)
        self._random = random
        self._kinds = scheduler.random("live commands")
        self._numbers = scheduler.random("mission numbers")
        self._lengths = scheduler.random("long missions")
        self._views = scheduler.random("views")
        self._more_views = scheduler.random("more views")
        self._subjects = scheduler.random("subjects")
        self._lifetimes = scheduler.random("lifetimes")
        self._count = 0
        self._places_e7: list[
            tuple[int, int]
        ] = []  # That plans lead to; the laws recognise plans by them

    def draw(self) -> DrawnPlan:
        """Draw the next plan."""
        self._count += 1
        mission_id, random = self._mission_id(), self._random
        vehicle_id = random.choice(self._vehicles)
        home = place(0.0, 0.0)
        home_fields = {"latitude": home[0], "longitude": home[1]}
        commands: list[dict[str, Any]] = [_command(1, 1, home_fields | {"altitude": ALTITUDE_M})]
        planned = PlannedCommands()
        may_be_long = bool(self._enabled & {Fault.LONG_MISSIONS, Fault.POWER_CUT})
        is_long = may_be_long and self._lengths.random() < LONG_SHARE
        last = self._lengths.randint(8, 11) if is_long else random.randint(3, 5)
        if Fault.REPEATED_MISSIONS in self._enabled and not is_long:
            last = 4  # The same commands each time, of other places
        for command_id in range(2, last):
            commands += self._at_a_place(command_id, planned)
        commands.append(_command(LANDING, 11, {"landing": True}))
        speed_m_s = self._lengths.uniform(2.0, 4.0) if is_long else 5.0
        mission = {"mission_id": mission_id, "vehicle_id": vehicle_id, "maximum_speed": speed_m_s}
        missions = [mission | {"command_array": commands}]
        body: dict[str, Any] = {"name": "simulated", "missions": missions}
        if Fault.GEOFENCES in self._enabled and self._lengths.random() < FENCED_SHARE:
            body["geofence"] = GEOFENCE
        lifetime_s = self._lifetime_s()
        return DrawnPlan(f"plan-{self._count}", body, mission_id, vehicle_id, planned, lifetime_s)

    def _lifetime_s(self) -> float | None:
        """Draw a time that may end before, while and after a vehicle gets the mission."""
        if Fault.EXPIRIES not in self._enabled or self._lifetimes.random() >= EXPIRING_SHARE:
            return None
        return self._lifetimes.expovariate(1.0 / MEAN_LIFETIME_S)

    def _mission_id(self) -> int:
        """Give a number, which another plan may have had before."""
        if Fault.REPEATED_MISSIONS not in self._enabled:
            return self._count
        return self._numbers.randint(1, 2)

    def _at_a_place(self, command_id: int, planned: PlannedCommands) -> Iterator[dict[str, Any]]:
        """Give a command that flies somewhere, and those of the camera there; note them."""
        latitude, longitude = self._new_place()
        where = {"latitude": latitude, "longitude": longitude}
        kind = self._kinds.choices((WAYPOINT, HOTPOINT, FOLLOW), (7, 3, 1))[0]
        yield _command(command_id, kind, where | FIELDS[kind])
        if kind == FOLLOW:
            return
        place_e7 = round(latitude * 1e7), round(longitude * 1e7)
        targets = planned.waypoints if kind == WAYPOINT else planned.circles
        targets[command_id] = place_e7
        if Fault.PICTURES in self._enabled:
            yield from self._camera_work(command_id, place_e7, planned)

    def _new_place(self) -> tuple[float, float]:
        """Draw a place that no other command of any plan leads to."""
        while True:
            found = place(*place_in_field(self._random))
            found_e7 = round(found[0] * 1e7), round(found[1] * 1e7)
            if not any(is_same_place(found_e7, one) for one in self._places_e7):
                self._places_e7.append(found_e7)
                return found

    def _camera_work(
        self, before: int, place_e7: tuple[int, int], planned: PlannedCommands
    ) -> Iterator[dict[str, Any]]:
        """Give commands of a camera behind another command, whose place this is, and note them."""
        if self._views.random() < PICTURES_SHARE:
            for pictures, command in self._views_at(place_e7, FIRST_PICTURES + before):
                planned.pictures[command["command_id"]] = pictures
                yield command
        # A vehicle that follows its subject has no geofence here
        is_free = Fault.GEOFENCES not in self._enabled
        if is_free and self._subjects.random() < TRACK_SHARE:
            planned.subjects[FIRST_TRACK + before] = rectangle = self._rectangle()
            yield self._track(FIRST_TRACK + before, rectangle)

    def _views_at(
        self, place_e7: tuple[int, int], first: int
    ) -> Iterator[tuple[PlannedPictures, dict[str, Any]]]:
        """Give the commands that take pictures at a place; the first has the id `first`."""
        views, taken = self._views, set[Series]()
        for command_id in range(first, first + MOST_PICTURES * MORE_PICTURES, MORE_PICTURES):
            planned, command = _view(views, place_e7, command_id)
            series = planned.series or SINGLE  # By turns, a panorama is single pictures
            if series not in taken:
                taken.add(series)
                yield planned, command
            views = self._more_views
            if views.random() >= MORE_PICTURES_SHARE:
                break

    def _rectangle(self) -> Rectangle:
        """Draw what is tracked; its corners are numbers that a float has."""
        left, top = (self._subjects.randint(0, 127) / 256.0 for _ in range(2))
        return Rectangle(left, top, left + 0.25, top + 0.25)

    def _track(self, command_id: int, rectangle: Rectangle) -> dict[str, Any]:
        """Give a command that tracks a subject."""
        corners = [list(rectangle[:2]), list(rectangle[2:])]
        mode = self._subjects.randrange(TRACK_MODES)
        return _command(command_id, TRACK, {"corners": corners, "track_mode": mode})


def place_in_field(random: Random) -> tuple[float, float]:
    """Draw a place that no fence forbids: north and east of home [m]."""
    return random.uniform(5.0, 30.0), random.uniform(-30.0, 30.0)


def _view(
    views: Random, place_e7: tuple[int, int], command_id: int
) -> tuple[PlannedPictures, dict[str, Any]]:
    """Draw a command that takes pictures where the vehicle is."""
    if views.random() < PANORAMA_SHARE:
        panorama = {"panorama_mode": views.randint(0, 1)}
        return PlannedPictures(place_e7, None), _command(command_id, PANORAMA, panorama)
    count = views.randint(1, 3)
    interval_s = 0 if count == 1 else views.randint(1, 3)
    pitch_deg = views.choice((-90.0, -45.0))
    shots = {"photo_count": count, "time_interval": interval_s, "pitch_angle": pitch_deg}
    planned = PlannedPictures(place_e7, Series(float(interval_s), count))
    return planned, _command(command_id, IMAGE, shots)


def _command(command_id: int, kind: int, parameters: dict[str, Any]) -> dict[str, Any]:
    return {"command_id": command_id, "command_type_id": kind, "parameters": parameters}
