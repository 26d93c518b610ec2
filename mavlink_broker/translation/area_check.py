"""Holds a mission against its plan's geofence before anything is uploaded. Pure.

Vehicles judge too little and too late: some look at the items alone and let a circle or a leg
cross what is forbidden, others say so when they are to take off.
"""

from typing import Final

from afarcloud.plan import Geofence, Mission
from mavlink_broker.translation.area import Area, Vertex
from mavlink_broker.translation.mission import Itinerary
from mavlink_broker.translation.route import Part, Way, altitude_name, place_name, route_of
from mavlink_broker.translation.situation import Home, Refusal, RefusedError, Spot

ALTITUDE_TOLERANCE_M: Final = 0.01
_PLACE: Final = "latitude, longitude"


class AreaCheck:
    """One geofence, which missions, places and ways are held against."""

    def __init__(self, geofence: Geofence) -> None:
        self._area = Area(geofence)
        self._height_m = geofence.max_altitude

    def check(
        self,
        mission: Mission,
        itinerary: Itinerary,
        *,
        start: Spot | None,
        home: Home | None,
        rally: tuple[Spot, ...] = (),
        own_limit_m: float | None = None,
    ) -> None:
        """Follow the vehicle through its mission from where it stands.

        What is not known yet (`start`, `home`) is not judged. `own_limit_m` is a height that the
        vehicle keeps below by itself.

        Raises:
            RefusedError: for the first command that leads out.
        """
        commands = mission.command_array
        refusal = self._fault_of_beginning(start, home)
        if refusal is not None:
            raise RefusedError(0, commands[0], refusal)
        for part in route_of(commands, itinerary, start, home, rally):
            command = commands[part.command]
            name = place_name(command) if isinstance(part, Way) else f"{_PLACE}, radius"
            fault = self._fault_of(part)
            if fault is None:
                name = altitude_name(command)
                height_m = _spot_of(part).relative_altitude_m
                fault = self._height_fault(height_m) or _own_fault(height_m, own_limit_m)
            if fault is not None:
                raise RefusedError(part.command, command, Refusal(name, fault))

    def fault_of_order(self, start: Vertex | None, target: Spot) -> str | None:
        """Say why a vehicle must not be sent somewhere, or None.

        One that is where it must not be may come from there any way.
        """
        height_m = target.relative_altitude_m
        strayed = start is not None and self._area.fault_at(start) is not None
        here = None if start is None or strayed else Spot(*start, height_m)
        return self._fault_of(Way(0, here, target)) or self._height_fault(height_m)

    def _fault_of_beginning(self, start: Spot | None, home: Home | None) -> Refusal | None:
        beginnings = {"the vehicle": start and start[:2], "home": home and home[:2]}
        for name, place in beginnings.items():
            fault = self._area.fault_at(place) if place else None
            if fault is not None:
                return Refusal(_PLACE, f"{name} {fault}")
        fault = None if start is None else self._height_fault(start.relative_altitude_m)
        return Refusal("altitude", f"the vehicle is too high: {fault}") if fault else None

    def _fault_of(self, part: Part) -> str | None:
        place = _spot_of(part)[:2]
        if not isinstance(part, Way):
            fault = self._area.fault_on_circle(place, part.radius_m)
            return fault and f"the circle {fault}"
        fault = self._area.fault_at(place)
        if fault is not None:
            return f"the place {fault}"
        fault = None if part.start is None else self._area.fault_on_way(part.start[:2], place)
        return fault and f"the way there {fault}"

    def _height_fault(self, height_m: float) -> str | None:
        if self._height_m is None or height_m <= self._height_m + ALTITUDE_TOLERANCE_M:
            return None
        return f"{height_m:g} m is above geofence.max_altitude, {self._height_m:g} m"


def _own_fault(height_m: float, own_limit_m: float | None) -> str | None:
    if own_limit_m is None or height_m <= own_limit_m + ALTITUDE_TOLERANCE_M:
        return None
    return f"{height_m:g} m is above the vehicle's own limit, {own_limit_m:g} m"


def _spot_of(part: Part) -> Spot:
    return part.end if isinstance(part, Way) else part.centre
