"""A survey request turned into plans: lines, route, parts, flights, commands. Pure.

NoSurveyError  the request is well-formed and cannot be flown; names the field
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

from afarcloud.faults import Fault
from afarcloud.fence_check import FenceCheck
from afarcloud.plan import Polygon
from afarcloud.route import Spot
from edge_server.survey import lines, route, sorties
from edge_server.survey.home_paths import HomePaths
from edge_server.survey.plane import SMALLEST_M2, Area, Frame, Point
from edge_server.survey.request import Home, SurveyRequest
from edge_server.survey.route import Stop

MARGIN_M: Final = 0.3
"""Places keep this far from the edge: a fence is exact, a vehicle is not."""
HOME_CLEARANCES_M: Final = (2.0, MARGIN_M, 0.05)
"""How far the paths from home and back keep from a no-fly area, the first that a path has: a
vehicle may start some metres beside home, and any path is better than one across the area."""
LANE_M: Final = 4.0
LEVEL_M: Final = 3.0
"""Vehicles that go round the same corner at the same time each have a lane farther from it than
the one before, and a level above it."""
HIGHEST_M: Final = 120.0
"""Where the law of most countries ends; levels that would be above it are below the survey."""
PLACE_NAMES: Final = ("latitude", "longitude", "altitude")
MOST_CORNERS: Final = 500
MOST_PLACES: Final = 20_000
MOST_ANGLES: Final = 36
CLOSEST_M: Final = 0.05


class NoSurveyError(Exception):
    """The request cannot be flown; `field` names what to change."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message)
        self.field = field


class _Part(NamedTuple):
    """What one vehicle flies: each flight without the bends on its paths from home and back."""

    vehicle_id: int
    home: Home
    flight: sorties.Flight
    flights: list[list[Stop]]


class Survey(NamedTuple):
    """Plans as documents, in the order in which they are to be flown, figures and warnings."""

    plans: list[dict[str, Any]]
    figures: dict[str, Any]
    warnings: tuple[Fault, ...] = ()


def survey(request: SurveyRequest, homes: Sequence[Home], first_mission_id: int) -> Survey:
    """Plan a survey whose vehicles start from these places, in the order of the vehicles.

    Raises:
        NoSurveyError: if the field cannot be covered so.
    """
    _check_size(request)
    _check_work(request)
    bearing_deg = request.angle if request.angle is not None else _best_bearing(request)
    frame, area = _laid_out(request, bearing_deg)
    rows = lines.lines_of(area, request.footprint, MARGIN_M)
    if sum(len(line.places) for row in rows for line in row) > MOST_PLACES:
        raise NoSurveyError("boundary", f"gives more than {MOST_PLACES} places; split the field")
    entry = None if request.entry is None else frame.to_plane(request.entry)
    stops = _stops(area, rows, entry)
    parts = _parts(request.vehicles, homes, [*_flights(request, homes, frame, area)], stops)
    plans = list(_plans(request, frame, parts, first_mission_id))
    figures = _figures(request, area, rows, parts, bearing_deg)
    return Survey(plans, figures, tuple(_warnings(parts)))


def _check_size(request: SurveyRequest) -> None:
    rings = [request.boundary, *request.holes, *request.exclusions]
    if sum(len(ring) for ring in rings) > MOST_CORNERS:
        raise NoSurveyError("boundary", f"and its holes have more than {MOST_CORNERS} corners")


def _check_work(request: SurveyRequest) -> None:
    """Refuse a request that covers nothing or would take too long, before it is planned."""
    _, area = _laid_out(request, 0.0)
    if area.square_metres < SMALLEST_M2:
        raise NoSurveyError("boundary", "has less than one square metre to cover")
    footprint = request.footprint
    xs, ys = zip(*area.outer, strict=True)
    lines_at_most = math.hypot(max(xs) - min(xs), max(ys) - min(ys)) / footprint.line_spacing_m
    pictures = 0.0
    if footprint.place_spacing_m:
        pictures = area.square_metres / footprint.line_spacing_m / footprint.place_spacing_m
    if max(lines_at_most, pictures) > MOST_PLACES / 4:
        raise NoSurveyError("boundary", "is too large for lines this narrow; split the field")


def _laid_out(request: SurveyRequest, bearing_deg: float) -> tuple[Frame, Area]:
    frame = Frame(*request.boundary[0], bearing_deg)
    outer = _ring(frame, request.boundary)
    if len(outer) < 3:
        raise NoSurveyError("boundary", "has no area")
    holes = [ring for one in (*request.holes, *request.exclusions) if (ring := _ring(frame, one))]
    return frame, Area(outer, holes)


def _flights(
    request: SurveyRequest, homes: Sequence[Home], frame: Frame, area: Area
) -> Iterator[sorties.Flight]:
    """Give what bounds the flights of each vehicle."""
    widest_m = HOME_CLEARANCES_M[0]
    for number, home in enumerate(homes):
        at = frame.to_plane((home.place.latitude, home.place.longitude))
        outlines = (*request.beyond, *home.beyond)
        beyond = [ring for one in outlines if (ring := _ring(frame, one))]
        lane_m = widest_m + number * LANE_M
        clearances_m = (lane_m, *HOME_CLEARANCES_M) if number else HOME_CLEARANCES_M
        bend_m = sorties.STOP_S * request.maximum_speed
        yield sorties.Flight(
            home_paths=HomePaths(at, [*area.holes, *beyond], clearances_m, bend_m),
            height_m=request.altitude,
            bend_height_m=_bend_height_m(request, number),
            speed_m_s=request.maximum_speed,
            endurance_s=request.endurance,
            takes_pictures=request.camera is not None,
            most_commands=request.most_commands,
        )


def _bend_height_m(request: SurveyRequest, number: int) -> float:
    """Height of a vehicle's bends between home and the field; the same for all without room."""
    fence_m = request.geofence.max_altitude if request.geofence is not None else None
    above_m = request.altitude + number * LEVEL_M
    below_m = request.altitude - number * LEVEL_M
    if above_m <= min(HIGHEST_M, fence_m or HIGHEST_M):
        return above_m
    return below_m if below_m >= LEVEL_M else request.altitude


def _warnings(parts: Sequence[_Part]) -> Iterator[Fault]:
    ends = (
        (part.flight.home_paths, stop.point)
        for part in parts
        for stops in part.flights
        for stop in (stops[0], stops[-1])
    )
    if not all(paths.leads_to(end) for paths, end in ends):
        yield Fault("home", "is enclosed by no-fly areas: a flight crosses them there or back")


def _ring(frame: Frame, polygon: Polygon) -> list[Point]:
    """Corners on the plane, without repeated ones."""
    ring: list[Point] = []
    for vertex in polygon:
        point = frame.to_plane(vertex)
        if not ring or math.dist(ring[-1], point) > CLOSEST_M:
            ring.append(point)
    while len(ring) > 1 and math.dist(ring[0], ring[-1]) <= CLOSEST_M:
        ring.pop()
    return ring


def _best_bearing(request: SurveyRequest) -> float:
    """Along the edge that results in the fewest lines, each of which costs a turn."""
    _, area = _laid_out(request, 0.0)
    edges = sorted(area.edges, key=lambda edge: -math.dist(*edge))[:MOST_ANGLES]
    bearings = {
        round(math.degrees(math.atan2(end[1] - start[1], end[0] - start[0])) % 180.0, 2)
        for start, end in edges
    }
    spacing = request.footprint.line_spacing_m
    return min(
        sorted(bearings),
        key=lambda bearing: lines.count_lines(_laid_out(request, bearing)[1], spacing),
    )


def _stops(area: Area, rows: Sequence[Sequence[lines.Line]], entry: Point | None) -> list[Stop]:
    try:
        stops = route.route(area, route.order(rows, entry), MARGIN_M)
    except route.NoPathError as error:
        raise NoSurveyError("exclusions", str(error)) from None
    if not stops:
        raise NoSurveyError("boundary", "has no room for a line")
    return stops


def _parts(
    vehicles: Sequence[int],
    homes: Sequence[Home],
    flights: Sequence[sorties.Flight],
    stops: Sequence[Stop],
) -> list[_Part]:
    """Share the route among the vehicles, near shares to each; some may get none of a short one.

    The parts are in the order of the vehicles.
    """
    shares = sorties.split(stops, len(homes), flights[0])
    chosen = sorties.assign(shares, [flight.home_paths.home for flight in flights])
    try:
        return [
            _Part(
                vehicles[index],
                homes[index],
                flights[index],
                sorties.flights(share, flights[index]),
            )
            for index, share in sorted(zip(chosen, shares, strict=True), key=lambda pair: pair[0])
        ]
    except sorties.TooFarError as error:
        raise NoSurveyError("endurance", str(error)) from None
    except sorties.TooManyCommandsError as error:
        raise NoSurveyError("most_commands", str(error)) from None


def _plans(
    request: SurveyRequest, frame: Frame, parts: Sequence[_Part], first: int
) -> Iterator[dict[str, Any]]:
    """One plan for each round of batteries: the n-th flight of every vehicle.

    With `plan_per_vehicle` each of these flights is a plan, so that each is dispatched by itself.
    """
    mission_id = first
    fence = None if request.geofence is None else FenceCheck(request.geofence)
    for number in range(max(len(part.flights) for part in parts)):
        missions = []
        for part in parts:
            if number < len(part.flights):
                places = _places(frame, sorties.flown(part.flights[number], part.flight))
                start = _takeoff_place(part.home, places[0][0], fence)
                missions.append(_mission(request, start, places, mission_id, part.vehicle_id))
                mission_id += 1
        if not request.plan_per_vehicle:
            yield _plan(request, missions, f"{number + 1}")
            continue
        for mission in missions:
            yield _plan(request, [mission], f"{number + 1}, vehicle {mission['vehicle_id']}")


def _plan(
    request: SurveyRequest, missions: Sequence[dict[str, Any]], suffix: str
) -> dict[str, Any]:
    plan: dict[str, Any] = {"missions": [*missions], "dispatch": request.dispatch}
    if request.name is not None:
        plan["name"] = f"{request.name} {suffix}"[:255]
    if request.geofence is not None:
        plan["geofence"] = request.geofence.model_dump(mode="json", exclude_none=True)
    if request.expires_at is not None:
        plan["expires_at"] = request.expires_at.isoformat()
    return plan


def _places(
    frame: Frame, flown: Sequence[tuple[Stop, float]]
) -> list[tuple[dict[str, float], bool]]:
    """The places of a flight as parameters, and whether there is a picture to take at each."""
    places = []
    for stop, height_m in flown:
        latitude, longitude = frame.to_globe(stop.point)
        place = {
            "latitude": round(latitude, 8),
            "longitude": round(longitude, 8),
            "altitude": height_m,
        }
        places.append((place, stop.is_work))
    return places


def _takeoff_place(
    home: Home, first: dict[str, float], fence: FenceCheck | None
) -> dict[str, float]:
    """Home, at the height of the first place; the latter if the fence forbids the leg to it."""
    if not home.is_takeoff:
        return first
    place = first | {"latitude": home.place.latitude, "longitude": home.place.longitude}
    if fence is None:
        return place
    start, end = (Spot(*(one[name] for name in PLACE_NAMES)) for one in (place, first))
    is_outside = any(fence.faults_of_place(start))
    return first if is_outside or fence.fault_of_order(start[:2], end) is not None else place


def _mission(
    request: SurveyRequest,
    start: dict[str, float],
    places: Sequence[tuple[dict[str, float], bool]],
    mission_id: int,
    vehicle_id: int,
) -> dict[str, Any]:
    commands: list[tuple[int, dict[str, Any]]] = [(1, start)]
    for place, is_work in places:
        commands.append((3, place))
        if is_work and request.camera is not None:
            commands.append((4, {"pitch_angle": -90}))
    commands.append((11, {"landing": True}))
    return {
        "mission_id": mission_id,
        "vehicle_id": vehicle_id,
        "maximum_speed": request.maximum_speed,
        "command_array": [
            {"command_id": index, "command_type_id": kind, "parameters": parameters}
            for index, (kind, parameters) in enumerate(commands, start=1)
        ],
    }


def _figures(
    request: SurveyRequest,
    area: Area,
    rows: Sequence[Sequence[lines.Line]],
    parts: Sequence[_Part],
    bearing_deg: float,
) -> dict[str, Any]:
    footprint = request.footprint
    flown = [stops for part in parts for stops in part.flights]
    seconds = (sorties.seconds_of(stops, part.flight) for part in parts for stops in part.flights)
    length = sum(sorties.length_m(stops, part.flight) for part in parts for stops in part.flights)
    pictures = sum(stop.is_work for stops in flown for stop in stops)
    return {
        "area_m2": round(area.square_metres, 1),
        "angle_deg": round(bearing_deg, 2),
        "lines": sum(len(row) for row in rows),
        "line_spacing_m": round(footprint.line_spacing_m, 3),
        "picture_spacing_m": round(footprint.place_spacing_m, 3) if request.camera else None,
        "pictures": pictures if request.camera else 0,
        "flights": len(flown),
        "length_m": round(length, 1),
        "duration_s": round(sum(seconds), 1),
    }
