"""The one judge of geofences, held against thousands of sampled points of the flown path.

The oracle knows nothing of the judge: it walks each mission in steps on a plane of its own, and
looks at every step by the angle that an outline turns through as seen from there.
"""

import math
import random
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import Any, Final

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from afarcloud import area, rules
from afarcloud.fence_check import FenceCheck
from afarcloud.flyable import VehicleLimits
from afarcloud.plan import Geofence, Plan
from afarcloud.route import Spot
from tests.support.polygons import Metres, clearance_m

LATITUDE, LONGITUDE = 40.4434, -3.7382
STEP_M: Final = 0.5
SURE_M: Final = 0.5
START: Metres = (0.0, 0.0)


def per_degree() -> Metres:
    """Metres of a degree of longitude and of latitude there, on the WGS-84 ellipsoid."""
    axis, flattening = 6_378_137.0, 1.0 / 298.257223563
    squared = flattening * (2.0 - flattening)
    sine = math.sin(math.radians(LATITUDE))
    root = math.sqrt(1.0 - squared * sine * sine)
    normal, meridian = axis / root, axis * (1.0 - squared) / root**3
    return math.radians(normal * math.cos(math.radians(LATITUDE))), math.radians(meridian)


EAST_M, NORTH_M = per_degree()


def at(point: Metres) -> dict[str, float]:
    return {"latitude": LATITUDE + point[1] / NORTH_M, "longitude": LONGITUDE + point[0] / EAST_M}


def outline(shape: Sequence[Metres]) -> list[list[float]]:
    return [list(at(corner).values()) for corner in shape]


def star(seed: int, corners: int, middle: Metres, reach_m: float) -> list[Metres]:
    """A polygon of any shape; it may cross itself where half of the angles have no corner."""
    dice = random.Random(seed)
    angles = sorted(dice.uniform(0.0, math.tau) for _ in range(corners))
    return [
        (middle[0] + r * math.sin(a), middle[1] + r * math.cos(a))
        for a, r in ((a, dice.uniform(0.2, 1.0) * reach_m) for a in angles)
    ]


def straight(start: Metres, end: Metres) -> Iterator[Metres]:
    number = max(1, math.ceil(math.dist(start, end) / STEP_M))
    for k in range(number + 1):
        share = k / number
        yield start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


Stop = tuple[str, Metres, float, int]
"""Kind, place, radius [m] and start point of a command."""
_BEARINGS: Final = {0: 0.0, 1: 180.0, 2: 270.0, 3: 90.0}  # North, south, west, east


def flown(stops: Sequence[Stop], start: Metres | None, home: Metres | None) -> Iterator[Metres]:
    """Every half metre of a mission; from an unknown start only the first place is known."""
    here = start
    for kind, place, radius_m, begin in stops:
        if kind != "orbit":
            yield from straight(here or place, place)
            here = place
            continue
        if begin in _BEARINGS:
            bearing = math.radians(_BEARINGS[begin])
            named = place[0] + radius_m * math.sin(bearing), place[1] + radius_m * math.cos(bearing)
            yield from straight(here or named, named)
            here = named
        here = here or place
        away_m = math.dist(here, place) or 1.0
        entry = (
            place[0] + (here[0] - place[0]) / away_m * radius_m,
            place[1] + (here[1] - place[1]) / away_m * radius_m,
        )
        yield from straight(here, entry)
        for k in range(math.ceil(math.tau * radius_m / STEP_M)):
            angle = k * STEP_M / radius_m
            yield place[0] + radius_m * math.cos(angle), place[1] + radius_m * math.sin(angle)
        here = entry
    if home is not None and here is not None:
        yield from straight(here, home)


def plan_of(stops: Sequence[Stop], fence: dict[str, Any]) -> Plan:
    commands: list[dict[str, Any]] = []
    for kind, place, radius_m, begin in stops:
        where: dict[str, Any] = at(place)
        if kind == "orbit":
            shape = {"orbit_altitude": 10, "radius": radius_m, "angular_velocity": 0.5}
            where |= shape | {"start_point": begin}
        else:
            where["altitude"] = 10.0
        number = {"takeoff": 1, "waypoint": 3, "orbit": 7}[kind]
        commands.append({"command_type_id": number, "parameters": where})
    commands.append({"command_type_id": 11, "parameters": {"landing": True}})
    numbered = [{"command_id": i, **one} for i, one in enumerate(commands, 1)]
    mission = {"mission_id": 1, "vehicle_id": 1, "command_array": numbered}
    return Plan.model_validate({"missions": [mission], "geofence": fence})


metres = st.tuples(st.floats(-120.0, 120.0), st.floats(-120.0, 120.0))
exclusions = st.builds(
    star, st.integers(0, 10**9), st.integers(3, 10), metres, st.floats(10.0, 60.0)
)
inclusions = st.builds(
    star, st.integers(0, 10**9), st.integers(5, 12), st.just(START), st.floats(150.0, 400.0)
)
waypoints = st.tuples(st.just("waypoint"), metres, st.just(0.0), st.just(4))
orbits = st.tuples(st.just("orbit"), metres, st.floats(5.0, 60.0), st.integers(0, 4))
missions = st.lists(st.one_of(waypoints, orbits), min_size=1, max_size=5)


@pytest.mark.thorough
@settings(max_examples=60, deadline=None)
@given(
    takeoff=metres,
    stops=missions,
    inside=st.lists(inclusions, max_size=1),
    out=st.lists(exclusions, max_size=2),
    knows_start=st.booleans(),
)
def test_a_mission_is_refused_just_when_a_point_of_its_path_is_forbidden(
    takeoff: Metres,
    stops: list[Stop],
    inside: list[list[Metres]],
    out: list[list[Metres]],
    knows_start: bool,
) -> None:
    whole: list[Stop] = [("takeoff", takeoff, 0.0, 4), *stops]
    start = START if knows_start else None
    points = list(flown(whole, start, start))
    clearance = clearance_m(points, inside, out)
    assume(abs(clearance) > SURE_M)
    fence = {"inclusion": [outline(s) for s in inside], "exclusion": [outline(s) for s in out]}
    plan = plan_of(whole, fence)
    spot = Spot(LATITUDE, LONGITUDE, 0.0) if knows_start else None
    check = FenceCheck(Geofence.model_validate(fence))
    faults = list(check.faults(plan.missions[0].command_array, start=spot, home=spot))
    assert bool(faults) == (clearance < 0.0)
    if not knows_start and not check.outline_faults:
        verdict = rules.check(plan, {1: VehicleLimits()}, datetime(2026, 11, 21, tzinfo=UTC))
        assert bool(verdict.faults) == (clearance < 0.0)


@settings(max_examples=60)
@given(heights=st.lists(st.floats(2.0, 100.0), min_size=1, max_size=6), limit=st.floats(3.0, 100.0))
def test_every_height_above_the_fence_is_named(heights: list[float], limit: float) -> None:
    assume(all(abs(height - limit) > 0.1 for height in heights))
    plan = plan_of(
        [("takeoff", START, 0.0, 4), *[("waypoint", START, 0.0, 4) for _ in heights]], {}
    )
    document = plan.model_dump()
    for command, height in zip(
        document["missions"][0]["command_array"], [2.0, *heights], strict=False
    ):
        command["parameters"]["altitude"] = height
    document["geofence"] = {"max_altitude": limit}
    verdict = rules.check(
        Plan.model_validate(document), {1: VehicleLimits()}, datetime(2026, 11, 21, tzinfo=UTC)
    )
    assert [fault.path for fault in verdict.faults] == [
        f"missions.0.command_array.{index}.parameters.altitude"
        for index, height in enumerate(heights, 1)
        if height > limit
    ]


SQUARE = [(20.0, -10.0), (40.0, -10.0), (40.0, 10.0), (20.0, 10.0)]


def fault_paths(*stops: Stop, exclusion: Sequence[Metres] = SQUARE) -> list[str]:
    plan = plan_of([("takeoff", START, 0.0, 4), *stops], {"exclusion": [outline(exclusion)]})
    verdict = rules.check(plan, {1: VehicleLimits()}, datetime(2026, 11, 21, tzinfo=UTC))
    return [f"{fault.path}: {fault.message}" for fault in verdict.faults]


def test_a_leg_across_an_exclusion_is_refused_at_post() -> None:
    assert fault_paths(("waypoint", (60.0, 0.0), 0.0, 4)) == [
        "missions.0.command_array.1.parameters: the leg there enters geofence.exclusion.0"
    ]


def test_a_circle_round_an_exclusion_is_taken_at_post() -> None:
    assert fault_paths(("orbit", (30.0, 0.0), 20.0, 4)) == []


@pytest.mark.parametrize(("radius_m", "is_taken"), [(14.0, False), (14.3, True)])
def test_a_circle_that_touches_an_exclusion_is_refused(radius_m: float, is_taken: bool) -> None:
    assert (fault_paths(("orbit", (30.0, 0.0), radius_m, 4)) == []) == is_taken


def test_each_command_is_named_once() -> None:
    stops: list[Stop] = [("waypoint", (30.0, 0.0), 0.0, 4), ("waypoint", (60.0, 0.0), 0.0, 4)]
    assert [fault.split(":")[0] for fault in fault_paths(*stops)] == [
        "missions.0.command_array.1.parameters",
        "missions.0.command_array.2.parameters",
    ]


def thin_corners(number: int) -> list[list[Metres]]:
    """Nested exclusions like an L, thinner than the tolerance: every circle may cross them."""
    shapes = []
    for k in range(number):
        here, there = -60.0 + 2.0 * k, -59.95 + 2.0 * k
        corner = [(here, here), (200.0, here), (200.0, there), (there, there)]
        shapes.append([*corner, (there, 200.0), (here, 200.0)])
    return shapes


@pytest.mark.parametrize(("apart_m", "is_judged"), [(0.0, True), (0.5, False)])
def test_what_is_flown_again_is_judged_once_and_what_is_judged_has_an_end(
    monkeypatch: pytest.MonkeyPatch, apart_m: float, *, is_judged: bool
) -> None:
    monkeypatch.setattr(area, "MOST_COMPARISONS", 5_000)
    circles: list[Stop] = [("orbit", (apart_m * k, 0.0), 50.0, 0) for k in range(60)]
    fence = {"exclusion": [outline(shape) for shape in thin_corners(12)]}
    plan = plan_of([("takeoff", (0.0, 50.0), 0.0, 4), *circles], fence)
    verdict = rules.check(plan, {1: VehicleLimits()}, datetime(2026, 11, 21, tzinfo=UTC))
    assert [fault.path for fault in verdict.faults] == ([] if is_judged else ["geofence.exclusion"])


def test_a_thin_exclusion_is_seen_wherever_a_circle_crosses_it() -> None:
    """Beside and across the line; the one in the circle and the one behind it do not matter."""
    for angle_deg in range(0, 360, 7):
        angle = math.radians(angle_deg)
        along = math.cos(angle), math.sin(angle)
        across = -along[1], along[0]
        for near_m, far_m, is_hit in ((45, 55, True), (20, 49.5, False), (50.5, 80, False)):
            bar = [
                (a_m * along[0] + c_m * across[0], a_m * along[1] + c_m * across[1])
                for a_m, c_m in ((near_m, -0.3), (far_m, -0.3), (far_m, 0.3), (near_m, 0.3))
            ]
            check = FenceCheck(Geofence.model_validate({"exclusion": [outline(bar)]}))
            mission = plan_of([("orbit", (0.0, 0.0), 50.0, 0)], {}).missions[0]
            circle = [f for f in check.faults(mission.command_array) if "circle" in f.text]
            assert bool(circle) == is_hit, (angle_deg, near_m)
