"""Surveys: planned over a field, and stored as plans; all of them or none."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

from afarcloud.faults import Fault, InvalidError
from afarcloud.geodesy import distance_m
from afarcloud.geometry import contains
from afarcloud.numbers import INT32_MAX
from afarcloud.plan import Plan, Polygon
from afarcloud.rules import name_faults
from afarcloud.wire import read_as, write
from edge_server.geodata.field import Field
from edge_server.services.context import Caller, Context
from edge_server.services.fleet.vehicle_holds import AIRBORNE_M
from edge_server.services.planning import fields, plan_checks, plans
from edge_server.store.rows import vehicles
from edge_server.survey import part
from edge_server.survey.planner import NoSurveyError, Survey, survey
from edge_server.survey.request import Home, Place, SurveyOrder, SurveyRequest, SurveyTerms

NEAR_M: Final = 2000.0
"""From home: what is farther away is on no path of a survey."""
MOST_CORNERS_ELSEWHERE: Final = 500


def preview(context: Context, order: SurveyOrder) -> dict[str, Any]:
    """Plan a survey and store nothing.

    Raises:
        InvalidError, ConflictError: as `create`: what is shown can be stored.
    """
    planned = _planned(context, order, _field_of(context, order))
    documents = [Plan.model_validate(plan) for plan in planned.plans]
    plan_checks.check_all(context, documents, numbered_here=order.first_mission_id is None)
    return {**planned.figures, "plans": planned.plans}


def create(context: Context, order: SurveyOrder, caller: Caller) -> dict[str, Any]:
    """Plan a survey and store its plans, in the order of flight.

    Raises:
        InvalidError: if it cannot be flown, or a plan breaks a rule.
        ConflictError: as for a plan.
        KeyReusedError: if the idempotency key belongs to another request.
    """
    field = _field_of(context, order)
    planned = _planned(context, order, field)
    documents = [Plan.model_validate(plan) for plan in planned.plans]
    source = {**write(order), "field": None if field is None else write(field)}
    kept = plans.create_all(
        context,
        documents,
        caller,
        source,
        planned.warnings,
        numbered_here=order.first_mission_id is None,
    )
    return {**planned.figures, "plans": kept}


def _field_of(context: Context, order: SurveyOrder) -> Field | None:
    """Return the field that an order names; raises InvalidError if there is none."""
    if order.field_id is None:
        return None
    field = fields.outline(context, order.field_id)
    if field is None:
        raise InvalidError((Fault("field_id", f"there is no field {order.field_id}"),))
    return field


def _planned(context: Context, order: SurveyOrder, field: Field | None) -> Survey:
    if faults := tuple(name_faults(order.name)):
        raise InvalidError(faults)
    first = order.first_mission_id
    if first is None:
        first = int(context.clock()) % INT32_MAX
    request = _request(order, field)
    try:
        homes, warnings = _homes(context, request)
        areas = fields.no_fly_areas(context)
        rings = [one.ring for one in areas if one.field != order.field_id]
        homes = [home._replace(beyond=tuple(_elsewhere(rings, home.place))) for home in homes]
        planned = survey(request, homes, first)
    except NoSurveyError as error:
        raise InvalidError((Fault(_path_of(error, order), str(error)),)) from None
    number = sum(len(plan["missions"]) for plan in planned.plans)
    if first + number - 1 > INT32_MAX:
        text = f"is at most {INT32_MAX - number + 1}: the survey has {number} missions"
        raise InvalidError((Fault("first_mission_id", text),))
    if field is not None:
        for plan in planned.plans:
            plan["field_id"] = order.field_id
    return planned._replace(warnings=(*planned.warnings, *warnings))


def _path_of(error: NoSurveyError, order: SurveyOrder) -> str:
    """Return what of the order gave the outline, where that is what cannot be flown."""
    if order.field_id is None or error.field not in {"boundary", "holes"}:
        return error.field
    return "field_id" if order.area is None else "area"


def _request(order: SurveyOrder, field: Field | None) -> SurveyRequest:
    """Return an order with the outline of its field, or of the part that is covered.

    Raises InvalidError if that is no part of the field.
    """
    terms = {name: getattr(order, name) for name in SurveyTerms.model_fields}
    outline: dict[str, Any] = {
        "boundary": order.boundary,
        "holes": order.holes,
        "exclusions": order.exclusions,
    }
    if field is not None:
        terms["name"] = order.name or field.name
        terms["entry"] = order.entry or field.entry
        outline = {
            "boundary": field.boundary,
            "holes": (*field.holes, *order.holes),
            "exclusions": (*field.exclusions, *order.exclusions),
        }
        if order.area is not None:
            if found := tuple(part.faults(order.area, field.boundary)):
                raise InvalidError(found)
            outline = _part_of(order.area, outline["holes"], outline["exclusions"])
    return read_as(SurveyRequest, {**terms, **outline})


def _part_of(
    area: Polygon, holes: Sequence[Polygon], exclusions: Sequence[Polygon]
) -> dict[str, Any]:
    """Return the outline of a part of a field; rings elsewhere are on the way from home to it."""
    near = {
        "holes": part.touching(area, holes),
        "exclusions": part.touching(area, exclusions),
    }
    known = {*near["holes"], *near["exclusions"]}
    beyond = tuple(ring for ring in (*holes, *exclusions) if ring not in known)
    return {"boundary": area, **near, "beyond": beyond}


def _elsewhere(rings: Sequence[Polygon], home: Place) -> Iterator[Polygon]:
    """Give the no-fly areas of other fields near home, the nearest first.

    They are on the paths from home and back. One in which home lies is none for these flights: it
    may be the farmyard from which every drone of the farm takes off.
    """
    at = home.latitude, home.longitude
    distances_m = ((min(distance_m(*at, *corner) for corner in ring), ring) for ring in rings)
    near = sorted(pair for pair in distances_m if pair[0] <= NEAR_M)
    corners = 0
    for _, ring in near:
        corners += len(ring)
        if corners > MOST_CORNERS_ELSEWHERE:
            return
        if not contains(ring, at):
            yield ring


def _homes(context: Context, request: SurveyRequest) -> tuple[list[Home], tuple[Fault, ...]]:
    """Where each vehicle starts: as given, where it is, where another one is, or at the field.

    With a warning for one that flies, because it will not start from there, and for one whose place
    is not known while there are areas to go round.
    """
    homes = _given_homes(request)
    asked = [vehicle_id for vehicle_id in request.vehicles if vehicle_id not in homes]
    warnings = []
    for vehicle_id, place, flies in _present_places(context, asked):
        homes[vehicle_id] = Home(place, is_takeoff=not flies)
        if flies:
            text = f"is where vehicle {vehicle_id} flies now: give the place where it will take off"
            warnings.append(Fault("home", text))
    has_rings = bool(request.holes or request.exclusions or request.beyond)
    unknown = [vehicle_id for vehicle_id in request.vehicles if vehicle_id not in homes]
    supposed = next((Home(home.place) for home in homes.values()), None)
    for vehicle_id in unknown if has_rings else ():
        text = f"is taken to be that of the others: where vehicle {vehicle_id} stands is not known"
        if supposed is None:
            text = f"is taken to be at the field: where vehicle {vehicle_id} stands is not known"
        warnings.append(Fault("home", text))
    if supposed is None:
        latitude, longitude = request.entry or request.boundary[0]
        supposed = Home(Place(latitude=latitude, longitude=longitude))
    return [homes.get(vehicle_id, supposed) for vehicle_id in request.vehicles], tuple(warnings)


def _given_homes(request: SurveyRequest) -> dict[int, Home]:
    """By vehicle; a place that several share is where none of them takes off exactly."""
    homes = {}
    if request.home is not None:
        is_takeoff = len(request.vehicles) == 1
        homes = {one: Home(request.home, is_takeoff=is_takeoff) for one in request.vehicles}
    for own in request.homes:
        place = Place(latitude=own.latitude, longitude=own.longitude)
        homes[own.vehicle_id] = Home(place, is_takeoff=True)
    return homes


def _present_places(
    context: Context, vehicle_ids: Sequence[int]
) -> Iterator[tuple[int, Place, bool]]:
    """Give each vehicle whose place is known, with it and whether the vehicle flies."""
    with context.database.read() as connection:
        known = [(one, vehicles.get(connection, one)) for one in vehicle_ids]
    for vehicle_id, row in known:
        state = {} if row is None else row.state
        latitude, longitude = state.get("latitude"), state.get("longitude")
        if latitude is not None and longitude is not None:
            flies = bool(state.get("armed")) and (state.get("altitude") or 0.0) >= AIRBORNE_M
            yield vehicle_id, Place(latitude=latitude, longitude=longitude), flies
