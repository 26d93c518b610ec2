"""Where a moving target is at any time, and how fast it goes."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mavlink_broker.planning.target_track import (
    TargetFileError,
    TargetState,
    VehicleTrack,
    read_track,
)
from tests.support.geodesy import LocalGround

HEADER = "time_s,latitude_deg,longitude_deg\n"
NORTHWARD = HEADER + "0,40.0,-3.0\n10,40.001,-3.0\n30,40.001,-2.999\n"


def test_it_moves_straight_from_mark_to_mark() -> None:
    seen = read_track(NORTHWARD).at(5.0)
    assert (seen.latitude_deg, seen.longitude_deg) == pytest.approx((40.0005, -3.0))
    north, east, down = seen.velocity_ned_m_s
    assert north == pytest.approx(11.1, abs=0.1)
    assert (east, down) == (0.0, 0.0)


def test_it_stands_before_and_after_its_track() -> None:
    track = read_track(NORTHWARD)
    assert track.at(-5.0) == TargetState(40.0, -3.0)
    assert track.at(31.0) == TargetState(40.001, -2.999)


def test_it_crosses_the_date_line_by_the_shorter_path() -> None:
    track = read_track(HEADER + "0,0.0,179.999\n10,0.0,-179.999\n")
    assert abs(track.at(5.0).longitude_deg) == pytest.approx(180.0)
    assert track.at(5.0).velocity_ned_m_s[1] == pytest.approx(22.3, abs=0.1)


@given(st.floats(0.0, 29.0), st.floats(0.01, 0.9))
def test_its_velocity_leads_to_where_it_is_a_little_later(time: float, step: float) -> None:
    track = read_track(NORTHWARD)
    if (time < 10.0) != (time + step < 10.0):
        return
    here, there = track.at(time), track.at(time + step)
    offset_m = LocalGround(*here[:2]).north_east_m(*there[:2])[:2]
    expected = (here.velocity_ned_m_s[0] * step, here.velocity_ned_m_s[1] * step)
    assert math.dist(offset_m, expected) < 0.01


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "the first line must be"),
        ("latitude,longitude\n", "the first line must be"),
        (HEADER, "it contains no position"),
        (HEADER + "0,40,north\n", "line 2: it must have three numbers"),
        (HEADER + "0,40\n", "line 2: it must have three numbers"),
        (HEADER + "nan,40,-3\n", "line 2: it is not a position"),
        (HEADER + "0,91,-3\n", "line 2: it is not a position"),
        (HEADER + "0,40,-3\n0,41,-3\n", "line 3: time_s must increase"),
    ],
)
def test_the_error_names_the_invalid_line(text: str, reason: str) -> None:
    with pytest.raises(TargetFileError, match=reason):
        read_track(text)


def test_another_vehicle_moves_on_from_its_last_report() -> None:
    track = VehicleTrack()
    for second in range(4):
        track.take(float(second), 40.0 + second * 9e-6, -3.0)
    seen = track.at(3.2)
    assert seen is not None
    assert seen.latitude_deg == pytest.approx(40.000027)
    assert seen.velocity_ned_m_s[0] == pytest.approx(1.0, abs=0.01)


def test_another_vehicle_that_is_silent_is_nowhere() -> None:
    track = VehicleTrack()
    assert track.at(0.0) is None
    track.take(0.0, 40.0, -3.0)
    assert track.at(0.5) is not None
    assert track.at(1.5) is None
