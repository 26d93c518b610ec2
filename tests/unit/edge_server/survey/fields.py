"""Fields of many shapes, and how much of one a survey covers."""

import itertools
import math
import random
from typing import Any, NamedTuple

from hypothesis import strategies as st

from edge_server.survey.plane import Area, Point
from edge_server.survey.planner import Survey, _laid_out, survey
from edge_server.survey.request import Home, Place, SurveyRequest
from tests.support.geodesy import LocalGround

LATITUDE_DEG, LONGITUDE_DEG = 40.4434, -3.7382
HOME = Place(latitude=LATITUDE_DEG, longitude=LONGITUDE_DEG)
CAMERA = {"sensor_width_mm": 13.2, "sensor_height_mm": 8.8, "focal_length_mm": 8.8}
SAMPLES = 1500


def place(east_m: float, north_m: float) -> tuple[float, float]:
    """A place some metres from the middle of the field."""
    return LocalGround(LATITUDE_DEG, LONGITUDE_DEG).place(north_m, east_m)


SQUARE = [place(-60, -40), place(60, -40), place(60, 40), place(-60, 40)]


def asked(**changes: Any) -> SurveyRequest:
    """A survey of the square in lines 10 m apart, with other terms where they are given."""
    body: dict[str, Any] = {
        "boundary": SQUARE,
        "swath_width": 10.0,
        "altitude": 10.0,
        "vehicles": [1],
        "side_overlap": 0.0,
        **changes,
    }
    return SurveyRequest.model_validate(body)


def planned_from(home: Place, request: SurveyRequest) -> Survey:
    """The survey of vehicles that all start from one place."""
    return survey(request, [Home(home)] * len(request.vehicles), 1)


def star(
    centre_m: Point, radius_m: float, corners: int, roughness: float, random_: random.Random
) -> list[tuple[float, float]]:
    """A polygon whose corners lie around a centre, the nearer the rougher."""
    turn = 2.0 * math.pi / corners
    start = random_.uniform(0.0, turn)
    polygon = []
    for index in range(corners):
        angle = start + (index + random_.uniform(-0.3, 0.3)) * turn
        distance = radius_m * random_.uniform(1.0 - roughness, 1.0)
        polygon.append(
            place(
                centre_m[0] + distance * math.cos(angle), centre_m[1] + distance * math.sin(angle)
            )
        )
    return polygon


@st.composite
def requests(draw: st.DrawFn) -> SurveyRequest:
    """A survey of a field with an inlet here and a pond there, by camera or by swath."""
    random_ = random.Random(draw(st.integers(0, 2**32)))
    body: dict[str, Any] = {
        "boundary": star(
            (0, 0),
            random_.uniform(50, 120),
            random_.randint(3, 12),
            random_.uniform(0, 0.6),
            random_,
        ),
        "altitude": random_.uniform(8, 30),
        "side_overlap": random_.uniform(0.2, 0.8),
        "front_overlap": random_.uniform(0.2, 0.8),
        "vehicles": [1],
        "endurance": 86_400,
        "most_commands": 700,
    }
    if draw(st.booleans()):
        centre = (random_.uniform(-15, 15), random_.uniform(-15, 15))
        body["holes"] = [star(centre, random_.uniform(3, 10), random_.randint(3, 6), 0.3, random_)]
    if draw(st.booleans()):
        body["camera"] = CAMERA
    else:
        body["swath_width"] = random_.uniform(4, 15)
    if draw(st.booleans()):
        body["angle"] = random_.uniform(0, 180)
    return SurveyRequest.model_validate(body)


class Flown(NamedTuple):
    """A survey on the plane: the area, the points of each flight, and where pictures are taken."""

    area: Area
    flights: list[list[Point]]
    pictures: list[Point]


def fly(request: SurveyRequest, survey: Survey) -> Flown:
    """Read the plans of a survey as a vehicle would."""
    frame, area = _laid_out(request, survey.figures["angle_deg"])
    flights: list[list[Point]] = []
    pictures: list[Point] = []
    for mission in (mission for plan in survey.plans for mission in plan["missions"]):
        points: list[Point] = []
        for command in mission["command_array"]:
            parameters = command["parameters"]
            if command["command_type_id"] == 3:
                points.append(frame.to_plane((parameters["latitude"], parameters["longitude"])))
            elif command["command_type_id"] == 4:
                pictures.append(points[-1])
        flights.append(points)
    return Flown(area, flights, pictures)


def coverage(request: SurveyRequest, flown: Flown, seed: int = 0) -> float:
    """Share of the area inside some picture, or inside the swath; by sampling."""
    random_ = random.Random(seed)
    xs, ys = zip(*flown.area.outer, strict=True)
    seen = covered = 0
    while seen < SAMPLES:
        point = random_.uniform(min(xs), max(xs)), random_.uniform(min(ys), max(ys))
        if flown.area.holds(point):
            seen += 1
            covered += _is_covered(request, flown, point)
    return covered / seen


def _is_covered(request: SurveyRequest, flown: Flown, point: Point) -> bool:
    footprint = request.footprint
    if request.camera is not None:
        return any(
            abs(point[0] - x) <= footprint.along_m / 2
            and abs(point[1] - y) <= footprint.across_m / 2
            for x, y in flown.pictures
        )
    legs = (leg for points in flown.flights for leg in itertools.pairwise(points))
    return any(_is_beside(point, leg, footprint.across_m / 2) for leg in legs)


def _is_beside(point: Point, leg: tuple[Point, Point], reach_m: float) -> bool:
    start, end = leg
    length = math.dist(start, end)
    if length == 0.0:
        return False
    along_x, along_y = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    x, y = point[0] - start[0], point[1] - start[1]
    return 0.0 <= x * along_x + y * along_y <= length and abs(x * along_y - y * along_x) <= reach_m
