"""Any plan that AFarCloud's vocabulary allows, for property tests.

What is drawn is a document, as a client would post it; whether the rules let it pass is for the
reader to judge.
"""

import math
from collections.abc import Mapping
from typing import Any

from hypothesis import strategies as st

from afarcloud.enumerations import CommandType, Profile

Drawn = st.SearchStrategy[dict[str, Any]]

_PLACE: dict[str, st.SearchStrategy[Any]] = {
    "latitude": st.floats(-89.0, 89.0),
    "longitude": st.floats(-180.0, 180.0),
}
"""Not the poles themselves, where a longitude means nothing."""
_OPEN_YAW = st.none() | st.floats(-180.0, 359.9)
_HALF_YAW = st.none() | st.floats(0.0, 180.0)
_FRACTION = st.floats(0.0, 1.0)


def _limited(profile: Profile) -> tuple[st.SearchStrategy[Any], float, float, float]:
    """Yaws, and the largest heights of take-off, waypoint and landing."""
    if profile is Profile.ANNEX:
        return _HALF_YAW, 10.0, 5.0, 5.0
    return _OPEN_YAW, 120.0, 120.0, 120.0


def parameters(profile: Profile = Profile.FIELD) -> Mapping[CommandType, Drawn]:
    """What each kind of command may ask for."""
    yaw, takeoff_m, waypoint_m, landing_m = _limited(profile)
    annex = profile is Profile.ANNEX
    return {
        CommandType.NAV_TAKEOFF: st.fixed_dictionaries(
            {**_PLACE, "altitude": st.floats(1.0, takeoff_m)},
            optional={"yaw_angle": yaw, "minimum_pitch": st.floats(0.0, 45.0)},
        ),
        CommandType.NAV_LAND: st.fixed_dictionaries(
            dict(_PLACE),
            optional={
                "desired_yaw_angle": yaw,
                "landing_altitude": st.floats(0.0 if annex else -50.0, landing_m),
                "minimum_target_altitude": st.floats(0.0, takeoff_m),
                "precision_land_mode": st.integers(0, 2),
            },
        ),
        CommandType.NAV_WAYPOINT: st.fixed_dictionaries(
            {**_PLACE, "altitude": st.floats(0.0, waypoint_m)},
            optional={
                "desired_yaw_angle": yaw,
                "hold_time": st.floats(0.0, 3.0 if annex else 3600.0),
                "acceptance_radius": st.floats(0.1, 3.0 if annex else 50.0),
                "trajectory_control": st.floats(0.0 if annex else -50.0, 3.0 if annex else 50.0),
            },
        ),
        CommandType.CAMERA_IMAGE: st.fixed_dictionaries(
            {"pitch_angle": st.floats(-90.0, 90.0), "time_interval": st.integers(1, 255)},
            optional={"yaw_angle": yaw, "photo_count": st.integers(1, 255)},
        ),
        CommandType.VIDEO_START_CAPTURE: st.fixed_dictionaries(
            {}, optional={"video_stream_id": st.integers(0, 255), "freq": st.floats(0.0, 5.0)}
        ),
        CommandType.VIDEO_STOP_CAPTURE: st.fixed_dictionaries(
            {}, optional={"video_stream_id": st.integers(0, 255)}
        ),
        CommandType.NAV_HOTPOINT: st.builds(
            _slow_enough,
            st.fixed_dictionaries(
                {
                    **_PLACE,
                    "orbit_altitude": st.floats(2.0, 120.0),
                    "radius": st.floats(5.0, 500.0),
                    "angular_velocity": st.floats(0.01, 60.0),
                },
                optional={
                    "is_clockwise": st.booleans(),
                    "start_point": st.integers(0, 4),
                    "orbit_type": st.integers(0, 5),
                },
            ),
        ),
        CommandType.NAV_FOLLOW_TARGET: st.fixed_dictionaries(
            {**_PLACE, "altitude": st.floats(0.0, takeoff_m)},
            optional={"heading": st.integers(0, 1)},
        ),
        CommandType.NAV_TRACK_SUBJECT: st.builds(
            _rectangle, _FRACTION, _FRACTION, _FRACTION, _FRACTION, st.integers(0, 4)
        ),
        CommandType.CAMERA_PANORAMA: st.fixed_dictionaries(
            {}, optional={"panorama_mode": st.integers(0, 1)}
        ),
        CommandType.NAV_HOME: st.fixed_dictionaries({}, optional={"landing": st.booleans()}),
    }


def _slow_enough(hotpoint: dict[str, Any]) -> dict[str, Any]:
    """Keep below 12 m/s on the circle: what is faster no plan may ask for."""
    fastest = math.degrees(11.9 / hotpoint["radius"])
    return hotpoint | {"angular_velocity": min(hotpoint["angular_velocity"], fastest)}


def _rectangle(x1: float, y1: float, x2: float, y2: float, mode: int) -> dict[str, Any]:
    left, top = min(x1, x2) * 0.9, min(y1, y2) * 0.9
    right, bottom = max(x1, x2, left + 0.01), max(y1, y2, top + 0.01)
    return {"corners": [[left, top], [right, bottom]], "track_mode": mode}


@st.composite
def missions(
    draw: st.DrawFn,
    profile: Profile = Profile.FIELD,
    *,
    vehicle_id: int = 1,
    longest: int = 10,
    in_any_order: bool = False,
) -> dict[str, Any]:
    """One mission; it takes off before it flies, and again behind a landing."""
    drawn = parameters(profile)
    kinds = draw(st.lists(st.sampled_from(sorted(drawn)), min_size=1, max_size=longest))
    commands: list[dict[str, Any]] = []
    stands = not in_any_order
    for kind in kinds:
        if kind is CommandType.NAV_TAKEOFF and not (stands or in_any_order):
            continue  # It flies already
        if stands and kind is not CommandType.NAV_TAKEOFF:
            commands.append(draw(_command(CommandType.NAV_TAKEOFF, len(commands), profile)))
        commands.append(draw(_command(kind, len(commands), profile)))
        lands = kind is CommandType.NAV_HOME and commands[-1]["parameters"].get("landing", True)
        stands = not in_any_order and (lands or kind is CommandType.NAV_LAND)
    return {
        "mission_id": 1200 + vehicle_id,
        "vehicle_id": vehicle_id,
        "maximum_speed": 12.0,
        "command_array": commands,
    }


@st.composite
def _command(draw: st.DrawFn, kind: CommandType, index: int, profile: Profile) -> dict[str, Any]:
    return {
        "command_id": 3 * index + draw(st.integers(0, 2)),
        "command_type_id": int(kind),
        "parameters": draw(parameters(profile)[kind]),
    }


@st.composite
def plans(
    draw: st.DrawFn, profile: Profile = Profile.FIELD, *, in_any_order: bool = False
) -> dict[str, Any]:
    """One mission each for a few vehicles."""
    vehicles = range(1, draw(st.integers(2, 3)))
    drawn = [
        draw(missions(profile, vehicle_id=number, in_any_order=in_any_order)) for number in vehicles
    ]
    return {"plan": {"profile": profile.value, "missions": drawn}}
