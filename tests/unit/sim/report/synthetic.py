"""A flight whose every figure is known: up to 5 m, 10 m north, down again."""

from typing import Any

import numpy as np

from sim.physics.earth import degrees_per_metre
from sim.report.arrays import Array
from sim.report.flight_log import FlightLog, Text
from sim.report.plan import Planned, planned_for
from sim.report.truth_track import Plane, TruthTrack

PLANE = Plane(latitude_deg=40.4434, longitude_deg=-3.7382, altitude_amsl_m=650.0)
BOOT_S = 100.0
"""Time since boot at which it arms."""
LANDED_S = 24.0
DISARMED_S = 25.0


def place(north_m: float, east_m: float) -> dict[str, float]:
    """Latitude and longitude of a place, as a plan gives it."""
    scale = degrees_per_metre(PLANE.latitude_deg, PLANE.altitude_amsl_m)
    return {
        "latitude": PLANE.latitude_deg + north_m * scale.north,
        "longitude": PLANE.longitude_deg + east_m * scale.east,
    }


def plan(**last: Any) -> dict[str, Any]:
    """Take-off, one waypoint, and what comes last."""
    end = last or {"command_type_id": 2, "parameters": place(10.0, 0.3)}
    return {
        "name": "known",
        "geofence": {"inclusion": [[[40.0, -4.0], [41.0, -4.0], [41.0, -3.0]]], "max_altitude": 50},
        "missions": [
            {
                "mission_id": 1,
                "vehicle_id": 1,
                "mission_status_id": 3,
                "command_array": [
                    {
                        "command_id": 1,
                        "command_type_id": 1,
                        "command_status_id": 3,
                        "parameters": {**place(0.0, 0.0), "altitude": 5.0},
                    },
                    {
                        "command_id": 2,
                        "command_type_id": 3,
                        "command_status_id": 3,
                        "parameters": {
                            **place(10.0, 0.4),
                            "altitude": 5.3,
                            "acceptance_radius": 0.6,
                            "hold_time": 0,
                        },
                    },
                    {"command_id": 3, "command_status_id": 3, **end},
                ],
            }
        ],
    }


def planned(document: dict[str, Any] | None = None) -> Planned:
    return planned_for(document or plan(), 1, PLANE)


def position(time_s: Array) -> Array:
    """North, east, up [m]: up 5 m in 5 s, north 10 m in 10 s, down in 8 s."""
    north = np.interp(time_s, [6.0, 16.0], [0.0, 10.0])
    up = np.interp(time_s, [1.0, 6.0, 16.0, LANDED_S], [0.151, 5.0, 5.0, 0.151])
    return np.column_stack((north, np.zeros_like(time_s), up))


def truth() -> TruthTrack:
    """At rest in attitude, 50 Hz from boot to ten seconds after the end."""
    time_s = np.arange(0.0, 40.0, 0.02) - 5.0
    place_m = position(time_s)
    up_m_s = np.gradient(place_m[:, 2], time_s)
    north_m_s = np.gradient(place_m[:, 0], time_s)
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(time_s), 1))
    return TruthTrack(
        plane=PLANE,
        time_s=time_s + BOOT_S,
        position=place_m,
        velocity_ned=np.column_stack((north_m_s, np.zeros_like(up_m_s), -up_m_s)),
        q_ned_frd=q,
    )


def log(
    *,
    position_error: tuple[float, float, float] = (0.0, 0.0, 0.0),
    velocity_error: tuple[float, float, float] = (0.0, 0.0, 0.0),
    q: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
    setpoint_error: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> FlightLog:
    """What a vehicle with these constant errors (north, east, up; NED) would log."""
    time_s = np.arange(-2.0, DISARMED_S + 1.0, 0.1)
    real = truth()
    believed = position(time_s) + position_error
    wanted = position(time_s) + setpoint_error
    scale = degrees_per_metre(PLANE.latitude_deg, PLANE.altitude_amsl_m)
    velocity = np.stack(
        [np.interp(time_s + BOOT_S, real.time_s, column) for column in real.velocity_ned.T], axis=1
    ) + np.array(velocity_error)
    armed = (time_s >= 0.0) & (time_s < DISARMED_S)
    topics: dict[str, dict[str, Array]] = {
        "vehicle_global_position": {
            "lat": PLANE.latitude_deg + believed[:, 0] * scale.north,
            "lon": PLANE.longitude_deg + believed[:, 1] * scale.east,
            "alt": PLANE.altitude_amsl_m + believed[:, 2],
            "eph": np.full_like(time_s, 0.1),
        },
        "vehicle_local_position": {
            "ref_lat": np.full_like(time_s, PLANE.latitude_deg + 3.0 * scale.north),
            "ref_lon": np.full_like(time_s, PLANE.longitude_deg),
            "ref_alt": np.full_like(time_s, PLANE.altitude_amsl_m + 2.0),
            **dict(zip(("vx", "vy", "vz"), velocity.T, strict=True)),
        },
        "vehicle_local_position_setpoint": {
            "x": wanted[:, 0] - 3.0,
            "y": wanted[:, 1],
            "z": 2.0 - wanted[:, 2],
            **dict(zip(("vx", "vy", "vz"), velocity.T, strict=True)),
        },
        "vehicle_attitude": _array("q", np.tile(q, (len(time_s), 1))),
        "vehicle_attitude_setpoint": _array("q_d", np.tile(q, (len(time_s), 1))),
        "actuator_motors": _array("control", np.tile([0.4] * 4, (len(time_s), 1))),
        "battery_status": {
            "voltage_v": np.full_like(time_s, 15.0),
            "current_a": np.full_like(time_s, 12.0),
            "discharged_mah": 100.0 + time_s * 12.0 / 3.6,
            "remaining": np.full_like(time_s, 0.9),
        },
        "vehicle_status": {
            "arming_state": np.where(armed, 2.0, 1.0),
            "nav_state": np.where(armed, 3.0, 4.0),
            "failsafe": np.zeros_like(time_s),
        },
    }
    for table in topics.values():
        table["time_s"] = time_s + BOOT_S
    return FlightLog(topics, [Text(BOOT_S + 20.0, 4, "Battery low")])


def _array(name: str, values: Array) -> dict[str, Array]:
    return {f"{name}[{index}]": column for index, column in enumerate(values.T)}
