"""Missions of all eleven commands, by the vocabulary's own ranges; and items of files."""

from typing import Any

from hypothesis import strategies as st

from afarcloud.plan import Mission
from afarcloud.wire import read_as

HOME = (40.4434, -3.7382)


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers as people write them: six digits behind the point."""
    return st.integers(round(low * 1e6), round(high * 1e6)).map(lambda whole: whole / 1e6)


yaws = st.none() | numbers(0.0, 359.0)
heights = numbers(2.0, 120.0)
places = st.fixed_dictionaries(
    {"latitude": numbers(40.44, 40.45), "longitude": numbers(-3.74, -3.73)}
)


def with_place(**others: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    return st.builds(lambda place, rest: place | rest, places, st.fixed_dictionaries(others))


@st.composite
def corners(draw: st.DrawFn) -> list[list[float]]:
    (left, right), (top, bottom) = [
        sorted(draw(st.lists(numbers(0, 1), min_size=2, max_size=2, unique=True))) for _ in range(2)
    ]
    return [[left, top], [right, bottom]]


def pictures() -> st.SearchStrategy[dict[str, Any]]:
    several = {"photo_count": st.integers(2, 255), "time_interval": st.integers(1, 255)}
    one = {"photo_count": st.just(1), "time_interval": st.integers(0, 255)}
    angles = {"yaw_angle": yaws, "pitch_angle": numbers(-90, 90)}
    return st.fixed_dictionaries(angles | several) | st.fixed_dictionaries(angles | one)


PARAMETERS: dict[int, st.SearchStrategy[dict[str, Any]]] = {
    1: with_place(minimum_pitch=numbers(0, 45), yaw_angle=yaws, altitude=heights),
    2: with_place(
        minimum_target_altitude=numbers(0, 120),
        precision_land_mode=st.integers(0, 2),
        desired_yaw_angle=yaws,
        landing_altitude=numbers(-50, 120),
    ),
    3: with_place(
        hold_time=numbers(0, 3600),
        acceptance_radius=numbers(0.1, 50),
        trajectory_control=numbers(-50, 50),
        desired_yaw_angle=yaws,
        altitude=numbers(0, 120),
    ),
    4: pictures(),
    5: st.fixed_dictionaries({"video_stream_id": st.integers(0, 255), "freq": numbers(0, 5)}),
    6: st.fixed_dictionaries({"video_stream_id": st.integers(0, 255)}),
    7: with_place(
        orbit_altitude=heights,
        radius=numbers(5, 500),
        angular_velocity=numbers(0.01, 60),
        is_clockwise=st.booleans(),
        start_point=st.integers(0, 4),
        orbit_type=st.integers(0, 5),
    ),
    8: with_place(altitude=numbers(0, 120), heading=st.integers(0, 1)),
    9: st.fixed_dictionaries({"corners": corners(), "track_mode": st.integers(0, 4)}),
    10: st.fixed_dictionaries({"panorama_mode": st.integers(0, 1)}),
    11: st.fixed_dictionaries({"landing": st.booleans()}),
}


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Any commands after a take-off."""
    kinds = [1, *draw(st.lists(st.integers(1, 11), max_size=12))]
    commands = [
        {"command_id": index, "command_type_id": kind, "parameters": draw(PARAMETERS[kind])}
        for index, kind in enumerate(kinds, start=1)
    ]
    speed = draw(numbers(0.5, 12.0))
    document = {"mission_id": 5, "vehicle_id": 1, "maximum_speed": speed}
    return read_as(Mission, document | {"command_array": commands})


def simple(
    command: int, *parameters: float | None, frame: int = 3, **fields: Any
) -> dict[str, Any]:
    """A simple item of a `.plan`."""
    filled = [*parameters, *[0] * (7 - len(parameters))]
    item = {"type": "SimpleItem", "autoContinue": True, "command": command, "doJumpId": 1}
    return item | {"frame": frame, "params": filled} | fields


def at(command: int, *first: float | None, altitude: float = 10, **fields: Any) -> dict[str, Any]:
    """A simple item with a place some metres north of home."""
    four = [*first, *[0] * (4 - len(first))]
    return simple(command, *four, 40.4435, -3.7382, altitude, **fields)


def plan_file(*items: dict[str, Any], **mission: Any) -> dict[str, Any]:
    """A `.plan`."""
    return {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": 12,
            "vehicleType": 2,
            "cruiseSpeed": 15,
            "hoverSpeed": 5,
            "globalPlanAltitudeMode": 1,
            "plannedHomePosition": [*HOME, 650],
            "items": list(items),
        }
        | mission,
        "geoFence": {"version": 2, "circles": [], "polygons": []},
        "rallyPoints": {"version": 2, "points": []},
    }


TAKEOFF = simple(22, 0, 0, 0, None, *HOME, 10)
"""Of a file."""
