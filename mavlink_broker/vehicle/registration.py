"""What the edge server is told of a vehicle: the body of `PUT /vehicles/<vehicle_id>`; pure.

What is old looks old: the position has its age in seconds, and `stale` names what has not been
told for some time, or is told by a vehicle whose link is not connected. Nothing is left out for
its age, for the last known place of a lost vehicle is what one looks for.
"""

from typing import Any, Final

from mavlink_broker.microservices.heartbeat import LinkState
from mavlink_broker.vehicle.vehicle import Vehicle

STALE_AFTER_S: Final = 5.0
"""Several periods of everything that is asked for."""
_TELLS: Final = {
    "position": "GLOBAL_POSITION_INT",
    "attitude": "ATTITUDE",
    "battery": "BATTERY_STATUS",
}


def description(vehicle: Vehicle, mission_id: int | None, now: float) -> dict[str, Any]:
    """Say what is known of a vehicle, and how fresh that is."""
    snapshot = vehicle.snapshot
    body: dict[str, Any] = {
        "link_state": vehicle.link_state(now).value,
        "autopilot": vehicle.family.autopilot,
        "family": vehicle.family.name,
        "version": vehicle.version,
        "mission_id": mission_id,
        "stale": stale(vehicle, now),
        "warning": vehicle.warning,
    }
    if snapshot.armed is not None:
        body |= {"armed": snapshot.armed, "mode": vehicle.mode}
    if snapshot.position is not None:
        age_s = vehicle.age_s("GLOBAL_POSITION_INT", now)
        body |= {
            "latitude": snapshot.position.latitude_deg,
            "longitude": snapshot.position.longitude_deg,
            "altitude": snapshot.position.altitude_m,
            "position_age": None if age_s is None else round(max(0.0, age_s), 1),
        }
    if snapshot.battery_fraction is not None:
        body["battery_percentage"] = snapshot.battery_fraction
    return body


def stale(vehicle: Vehicle, now: float) -> list[str]:
    """Name what was told once and has not been told again for some time."""
    is_connected = vehicle.link_state(now) is LinkState.CONNECTED
    ages = {name: vehicle.age_s(kind, now) for name, kind in _TELLS.items()}
    return [
        name
        for name, age_s in ages.items()
        if age_s is not None and (age_s > STALE_AFTER_S or not is_connected)
    ]
