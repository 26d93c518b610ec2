"""What the vehicle says of itself, as messages of MAVLink's common set: name and fields."""

import json
import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from sim.tester.vehicle.actions import Pose
from sim.tester.vehicle.alarms import PRESENT

_E7: Final = 1e7
OBSERVATION_IN_WORDS: Final = 0xAFC1
ALARM_PARAMETERS: Final = 0xAFC2
"""Payload types of TUNNEL that the broker reads."""
_TUNNEL_BYTES: Final = 128
_ARMED: Final = 128
"""MAV_MODE_FLAG_SAFETY_ARMED."""


class VehicleMessage(NamedTuple):
    """A message to be sent."""

    name: str
    fields: Mapping[str, Any]


class Home(NamedTuple):
    """Where altitudes begin."""

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float


def heartbeat(*, armed: bool) -> VehicleMessage:
    """HEARTBEAT as MAVSDK has it: of a generic vehicle and a generic autopilot.

    MAVSDK's own comes once a second; a change must not wait for it.
    """
    fields = {"type": 0, "autopilot": 0, "custom_mode": 0, "system_status": 0}
    return VehicleMessage(
        "HEARTBEAT", {**fields, "base_mode": _ARMED * armed, "mavlink_version": 3}
    )


def position(pose: Pose, home: Home, time_ms: int) -> VehicleMessage:
    """GLOBAL_POSITION_INT: the vehicle stands still wherever it is."""
    return VehicleMessage(
        "GLOBAL_POSITION_INT",
        {
            "time_boot_ms": time_ms,
            "lat": round(pose.latitude_deg * _E7),
            "lon": round(pose.longitude_deg * _E7),
            "alt": round((home.altitude_amsl_m + pose.relative_altitude_m) * 1e3),
            "relative_alt": round(pose.relative_altitude_m * 1e3),
            "vx": 0,
            "vy": 0,
            "vz": 0,
            "hdg": round(pose.yaw_deg % 360.0 * 1e2) % 36_000,
        },
    )


def attitude(pose: Pose, time_ms: int) -> VehicleMessage:
    """ATTITUDE."""
    angles = {"roll": pose.roll_deg, "pitch": pose.pitch_deg, "yaw": pose.yaw_deg}
    fields: dict[str, Any] = {
        name: math.radians(math.remainder(degrees, 360.0)) for name, degrees in angles.items()
    }
    rates = dict.fromkeys(("rollspeed", "pitchspeed", "yawspeed"), 0.0)
    return VehicleMessage("ATTITUDE", {"time_boot_ms": time_ms, **fields, **rates})


def home_position(home: Home) -> VehicleMessage:
    """HOME_POSITION; the plugin's own has altitude 0, whatever is passed."""
    zeros = dict.fromkeys(("x", "y", "z", "approach_x", "approach_y", "approach_z"), 0.0)
    return VehicleMessage(
        "HOME_POSITION",
        {
            "latitude": round(home.latitude_deg * _E7),
            "longitude": round(home.longitude_deg * _E7),
            "altitude": round(home.altitude_amsl_m * 1e3),
            **zeros,
            "q": [1.0, 0.0, 0.0, 0.0],
            "time_usec": 0,
        },
    )


def system_status(ill: int, percentage: int) -> VehicleMessage:
    """SYS_STATUS; `ill` are the bits of MAV_SYS_STATUS_SENSOR that are not healthy."""
    return VehicleMessage(
        "SYS_STATUS",
        {
            "onboard_control_sensors_present": PRESENT,
            "onboard_control_sensors_enabled": PRESENT,
            "onboard_control_sensors_health": PRESENT & ~ill,
            "load": 0,
            "voltage_battery": 12_000,
            "current_battery": -1,
            "battery_remaining": percentage,
        },
    )


def system_time(utc_s: float, time_ms: int) -> VehicleMessage:
    """SYSTEM_TIME."""
    return VehicleMessage(
        "SYSTEM_TIME", {"time_unix_usec": round(utc_s * 1e6), "time_boot_ms": time_ms}
    )


def observation(
    resource_id: str, observed_property: str, value: float, unit: str
) -> VehicleMessage:
    """TUNNEL with an observation as text, as the broker reads it."""
    return _tunnel(OBSERVATION_IN_WORDS, [resource_id, observed_property, value, unit])


def alarm_parameters(parameters: tuple[float, float]) -> VehicleMessage:
    """TUNNEL with the two parameters of an alarm."""
    return _tunnel(ALARM_PARAMETERS, list(parameters))


def _tunnel(kind: int, fields: list[Any]) -> VehicleMessage:
    payload = json.dumps(fields, ensure_ascii=False, separators=(",", ":")).encode()
    return VehicleMessage(
        "TUNNEL",
        {
            "target_system": 0,
            "target_component": 0,
            "payload_type": kind,
            "payload_length": len(payload),
            "payload": list(payload.ljust(_TUNNEL_BYTES, b"\0")),
        },
    )


def humidity(value_percent: float, time_ms: int) -> VehicleMessage:
    """NAMED_VALUE_FLOAT of the humidity sensor."""
    fields = {"time_boot_ms": time_ms, "name": "hum_air", "value": value_percent}
    return VehicleMessage("NAMED_VALUE_FLOAT", fields)


def mission_current(seq: int, total: int, state: int, *, in_mission: bool) -> VehicleMessage:
    """MISSION_CURRENT; the plugin's own comes on changes only, and without state."""
    return VehicleMessage(
        "MISSION_CURRENT",
        {
            "seq": seq,
            "total": total,
            "mission_state": state,
            "mission_mode": 1 if in_mission else 2,
        },
    )
