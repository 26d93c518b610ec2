"""How far a vehicle has gone round, also where an earlier run of the broker has seen it begin."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.geodesy import shifted
from mavlink_broker.live.orbit import TurnAngle
from mavlink_broker.planning.situation import Pose, Turned

CENTRE = (40.44340, -3.73820)
RADIUS_M, SPEED_M_S = 20.0, 4.0
FULL_S = 2.0 * math.pi * RADIUS_M / SPEED_M_S


def turned(*, is_clockwise: bool) -> Turned:
    return Turned(*CENTRE, RADIUS_M, 2.0 * math.pi, is_clockwise, SPEED_M_S)


def at(bearing_deg: float) -> tuple[float, float]:
    return shifted(*CENTRE, bearing_deg, RADIUS_M)


@given(
    first_deg=st.floats(0.0, 360.0),
    flown=st.floats(0.0, 3.0),
    slower=st.floats(0.9, 1.1),
    is_clockwise=st.booleans(),
)
def test_what_was_flown_meanwhile_counts(
    first_deg: float, flown: float, slower: float, is_clockwise: bool
) -> None:
    """The position gives the angle, and an approximate speed the number of turns."""
    turning = TurnAngle(turned(is_clockwise=is_clockwise))
    turning.resume(Pose(*at(first_deg), 10.0), flown * FULL_S * slower)
    sense = 1.0 if is_clockwise else -1.0
    turning.take(*at(first_deg + sense * flown * 360.0))
    assert turning.turned_rad == pytest.approx(flown * 2.0 * math.pi, abs=0.01)


def test_off_the_circle_nothing_counts() -> None:
    turning = TurnAngle(turned(is_clockwise=True))
    places = []
    for place in (CENTRE, at(0.0), at(90.0)):
        turning.take(*place)
        places.append(turning.is_on_circle)
    assert places == [False, True, True]
    assert turning.turned_rad == pytest.approx(math.pi / 2.0, abs=0.01)
