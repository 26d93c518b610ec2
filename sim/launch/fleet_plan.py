"""Makes one vehicle's plan a plan for several: the same flight beside and above each other."""

import copy
import math
from typing import Any

EAST_SPACING_M = 3.0
"""Distance between the homes of two neighbours."""

UP_SPACING_M = 2.0
"""Difference of their altitudes, so that no two are ever at one point."""

_METRES_PER_DEGREE = 111_319.49


def for_vehicles(document: dict[str, Any], vehicles: int) -> dict[str, Any]:
    """Give a plan with one mission for each of `vehicles` vehicles.

    A plan that already has several missions, or a single vehicle, leaves it as it is. The
    document may be bare, in its envelope, or a single mission.
    """
    plan = document.get("plan", document)
    missions = plan.get("missions", [plan])
    if len(missions) > 1 or vehicles == 1:
        return document
    return {
        "name": plan.get("name", "fleet"),
        "missions": [_shifted(missions[0], number) for number in range(vehicles)],
    }


def _shifted(mission: dict[str, Any], number: int) -> dict[str, Any]:
    shifted = copy.deepcopy(mission)
    shifted["vehicle_id"] += number
    shifted["mission_id"] += number
    shifted["sequence_number"] = number
    for command in shifted["command_array"]:
        parameters = command.get("parameters", {})
        if "longitude" in parameters:
            metres = _METRES_PER_DEGREE * math.cos(math.radians(parameters["latitude"]))
            parameters["longitude"] += number * EAST_SPACING_M / metres
        for name in ("altitude", "orbit_altitude"):
            if name in parameters:
                parameters[name] += number * UP_SPACING_M
    return shifted
