"""Every range of the `field` profile: both bounds in, just outside refused."""

import base64
import math
from typing import Any, NamedTuple

import pytest

from afarcloud import wire
from afarcloud.faults import InvalidError
from afarcloud.numbers import LAST_SECOND
from afarcloud.state import ObservationList
from tests.support.cases import failures
from tests.unit.afarcloud import documents


class Range(NamedTuple):
    command_type: int
    parameter: str
    low: float
    high: float
    low_is_open: bool = False
    high_is_open: bool = False
    is_integer: bool = False


RANGES = [
    Range(1, "minimum_pitch", 0, 45),
    Range(1, "yaw_angle", -180, 360, high_is_open=True),
    Range(1, "latitude", -90, 90),
    Range(1, "longitude", -180, 180),
    Range(1, "altitude", 0, 120, low_is_open=True),
    Range(2, "minimum_target_altitude", 0, 120),
    Range(2, "precision_land_mode", 0, 2, is_integer=True),
    Range(2, "desired_yaw_angle", -180, 360, high_is_open=True),
    Range(2, "latitude", -90, 90),
    Range(2, "longitude", -180, 180),
    Range(2, "landing_altitude", -50, 120),
    Range(3, "hold_time", 0, 3600),
    Range(3, "acceptance_radius", 0.1, 50),
    Range(3, "trajectory_control", -50, 50),
    Range(3, "desired_yaw_angle", -180, 360, high_is_open=True),
    Range(3, "latitude", -90, 90),
    Range(3, "longitude", -180, 180),
    Range(3, "altitude", 0, 120),
    Range(4, "yaw_angle", -180, 360, high_is_open=True),
    Range(4, "pitch_angle", -90, 90),
    Range(4, "photo_count", 1, 255, is_integer=True),
    Range(4, "time_interval", 0, 255, is_integer=True),
    Range(5, "video_stream_id", 0, 255, is_integer=True),
    Range(5, "freq", 0, 5),
    Range(6, "video_stream_id", 0, 255, is_integer=True),
    Range(7, "orbit_altitude", 2, 120),
    Range(7, "radius", 5, 500),
    Range(7, "angular_velocity", 0, 60, low_is_open=True),
    Range(7, "start_point", 0, 4, is_integer=True),
    Range(7, "orbit_type", 0, 5, is_integer=True),
    Range(8, "altitude", 0, 120),
    Range(8, "heading", 0, 1, is_integer=True),
    Range(9, "track_mode", 0, 4, is_integer=True),
    Range(10, "panorama_mode", 0, 1, is_integer=True),
]


def _below(value: float, *, is_integer: bool) -> float:
    return value - 1 if is_integer else math.nextafter(value, -math.inf)


def _above(value: float, *, is_integer: bool) -> float:
    return value + 1 if is_integer else math.nextafter(value, math.inf)


def _cases() -> list[tuple[Range, float, bool]]:
    cases = []
    for row in RANGES:
        inside_low = _above(row.low, is_integer=row.is_integer) if row.low_is_open else row.low
        inside_high = _below(row.high, is_integer=row.is_integer) if row.high_is_open else row.high
        outside_low = row.low if row.low_is_open else _below(row.low, is_integer=row.is_integer)
        outside_high = row.high if row.high_is_open else _above(row.high, is_integer=row.is_integer)
        for value, good in (
            (inside_low, True),
            (inside_high, True),
            (outside_low, False),
            (outside_high, False),
        ):
            cases.append((row, value, good))
    return cases


def check_range(row: Range, value: float, good: bool) -> None:
    parameters = {**documents.PARAMETERS[row.command_type], row.parameter: value}
    if row.parameter == "photo_count":
        parameters["time_interval"] = 1
    mission = documents.mission_of((row.command_type, parameters))
    if good:
        wire.read(wire.Kind.PLAN, mission)
    else:
        with pytest.raises(InvalidError) as caught:
            wire.read(wire.Kind.PLAN, mission)
        assert [f.path for f in caught.value.faults] == [
            f"command_array.0.parameters.{row.parameter}"
        ]


def test_both_bounds_are_accepted_and_values_just_outside_are_refused() -> None:
    assert failures(check_range, _cases()) == []


def test_the_table_covers_every_number_of_every_command() -> None:
    covered = {(row.command_type, row.parameter) for row in RANGES}
    places = {(7, "latitude"), (7, "longitude"), (8, "latitude"), (8, "longitude")}
    booleans_and_pairs = {(7, "is_clockwise"), (9, "corners"), (11, "landing")}
    every = {(kind, name) for kind, ps in documents.PARAMETERS.items() for name in ps}
    assert every == covered | places | booleans_and_pairs


MEASUREMENT = documents.REPORTS["observation"]["observation_array"][0]
INVALID_REPORTS = [
    ("pose", "vehicle_id", 0),
    ("pose", "vehicle_id", 2**31),
    ("pose", "sequence_number", -1),
    ("pose", "latitude", 90.0001),
    ("pose", "yaw", 360),
    ("pose", "roll", 180),
    ("pose", "pitch", -90.1),
    ("pose", "recorded_at", "2026-11-21T08:00:00"),
    ("pose", "recorded_at", 1718630046),
    ("pose", "session_id", "not a ulid"),
    ("battery", "percentage", 80.0),
    ("battery", "capacity", 3000.0),
    ("state_vector", "linear_speed", -0.1),
    ("state_vector", "battery_percentage", 1.1),
    ("mission_report", "mission_status_id", 0),
    ("mission_report", "mission_status_id", 6),
    ("alarm", "alarm_type_id", 3),
    ("alarm", "alarm_code_id", 50),
    ("alarm", "param_array", [0.0]),
    ("image", "frame", "not base64!"),
    ("image", "frame", "AAAA"),
    ("image", "image_size", 4),
    ("image", "name", "../etc/passwd"),
    ("image", "format", "exe"),
    ("observation", "observation_array", []),
    ("observation", "observation_array", [MEASUREMENT | {"result_time": -1}]),
    ("observation", "observation_array", [MEASUREMENT | {"result_time": LAST_SECOND + 1}]),
]


def check_invalid_report(kind: str, field: str, value: Any) -> None:
    with pytest.raises(InvalidError) as caught:
        wire.read(wire.Kind(kind), {**documents.REPORTS[kind], field: value})
    assert [f.path.split(".")[0] for f in caught.value.faults] == [field]


def test_a_report_outside_its_range_is_refused_by_name() -> None:
    assert failures(check_invalid_report, INVALID_REPORTS) == []


def test_the_time_of_a_measurement_ends_where_other_times_do() -> None:
    array = [MEASUREMENT | {"result_time": LAST_SECOND}]
    body = documents.REPORTS["observation"] | {
        "observation_array": array,
        "recorded_at": "9998-12-31T23:59:59Z",
    }
    read = wire.read(wire.Kind.OBSERVATION, body)
    assert isinstance(read, ObservationList)
    assert read.recorded_at is not None
    assert read.recorded_at.timestamp() == read.observation_array[0].result_time


def test_a_capacity_in_milliampere_hours_is_asked_about() -> None:
    with pytest.raises(InvalidError, match="mAh"):
        wire.read(wire.Kind.BATTERY, {**documents.REPORTS["battery"], "capacity": 3000.0})


def test_an_image_may_be_one_mebibyte_and_no_more() -> None:
    def image(size: int) -> dict[str, Any]:
        frame = base64.b64encode(b"\xff\xd8\xff" + bytes(size - 3)).decode()
        return {**documents.REPORTS["image"], "image_size": size, "frame": frame}

    wire.read(wire.Kind.IMAGE, image(1_048_576))
    with pytest.raises(InvalidError) as caught:
        wire.read(wire.Kind.IMAGE, image(1_048_577))
    assert [f.path for f in caught.value.faults] == ["frame"]


@pytest.mark.parametrize(
    ("change", "path"),
    [
        ({"event_type_id": 3}, "maximum_speed"),
        ({"event_type_id": 1, "maximum_speed": 2.0}, "maximum_speed"),
        ({"event_type_id": 4}, "event_type_id"),
        (
            {
                "event_type_id": 3,
                "maximum_speed": 2.0,
                "abort": {**documents.PLACE, "altitude": 5},
            },
            "abort",
        ),
        ({"event_type_id": 1, "abort": {"latitude": 40.0}}, "abort.longitude"),
    ],
)
def test_an_events_parameters_fit_its_type(change: dict[str, Any], path: str) -> None:
    with pytest.raises(InvalidError) as caught:
        wire.read(wire.Kind.EVENT, {"sequence_number": 1, "vehicle_id": 1, **change})
    assert path in [f.path for f in caught.value.faults]


@pytest.mark.parametrize(
    "corners",
    [
        [[0.75, 0.25], [0.25, 0.75]],
        [[0.25, 0.25], [0.25, 0.75]],
        [[0, 0], [1, 1.01]],
        [[0, 0]],
        [0, 1],
    ],
)
def test_track_corners_span_a_rectangle(corners: Any) -> None:
    mission = documents.mission_of((9, {"corners": corners}))
    with pytest.raises(InvalidError) as caught:
        wire.read(wire.Kind.PLAN, mission)
    assert caught.value.faults[0].path.startswith("command_array.0.parameters.corners")
