"""The check of a mission: what is refused, with which number, and what is not."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.cases import failures
from tests.support.toy_vehicle import HOME, at, item, takeoff, waypoint
from uav_firmware.lib.mission_rules import DistanceLimits, check
from uav_firmware.modules.navigator.params import NavigatorParams
from uav_firmware.msg.mission import MissionCommand, MissionItem, MissionResult
from uav_firmware.msg.status import HomePosition

PARAMS = NavigatorParams()
LIMITS = DistanceLimits(PARAMS.farthest_first_position, PARAMS.longest_leg)
HOME_POSITION = HomePosition(0, *HOME, (0.0, 0.0, 0.0), 0.0)
NAN = math.nan
LAND = {"param4": NAN}


def result_of(
    *items: MissionItem, home: HomePosition | None = HOME_POSITION
) -> MissionResult | None:
    rejection = check(items, home, LIMITS)
    if rejection is None:
        return None
    assert f"item {rejection.seq}" in rejection.reason
    return MissionResult(rejection.result)


GOOD = [
    (takeoff(), waypoint(1, 10, 0), item(2, 20)),
    (takeoff(), waypoint(1, 10, 0), item(2, 21, **LAND, **at(3, 3))),
    (takeoff(param1=15.0, param4=90.0, **at(3, 0)), item(1, 17, z=5.0, **at(1, 1))),
    (waypoint(0, 10, 0), waypoint(1, 20, 0)),
    (item(0, 93, param1=2.0, param2=-1.0, param3=-1.0, param4=-1.0), takeoff(1)),
    (item(0, 178, param1=1.0, param2=3.0, param3=-1.0), takeoff(1), item(2, 19, z=5.0, **at(1, 1))),
    (takeoff(), item(1, 21, **LAND), takeoff(2), item(3, 21, **LAND)),
    (takeoff(), waypoint(1, 9, 0), item(2, 177, param1=1.0, param2=-1.0)),
    (waypoint(0, 10, 0, height=HOME[2] + 5.0, frame=0), item(1, 20)),
    (takeoff(), item(1, 21, param1=4.0, **LAND)),
    (),
]


@pytest.mark.parametrize("mission", GOOD)
def test_a_good_mission_is_accepted_with_and_without_home(mission: tuple[MissionItem, ...]) -> None:
    assert result_of(*mission) is None
    assert result_of(*mission, home=None) is None


BAD = [
    (item(0, 2004), MissionResult.UNSUPPORTED),
    (item(0, 2800), MissionResult.UNSUPPORTED),
    (item(0, 2000, param1=4.0), MissionResult.INVALID_PARAM1),
    (item(0, 2000, param2=0.1, param3=3.0), MissionResult.INVALID_PARAM2),
    (item(0, 206, param1=10.0, param2=50.0), MissionResult.INVALID_PARAM2),
    (item(0, 530, param2=7.0), MissionResult.INVALID_PARAM2),
    (item(0, 1000, param1=45.0), MissionResult.INVALID_PARAM1),
    (item(0, 205, param1=-45.0, z=3.0), MissionResult.INVALID_PARAM7),
    (item(0, 2500, param1=2.0), MissionResult.INVALID_PARAM1),
    (item(0, 197, param1=4.0), MissionResult.INVALID_PARAM1),
    (item(0, 34), MissionResult.UNSUPPORTED),
    (waypoint(0, 1, 1, frame=2), MissionResult.UNSUPPORTED_FRAME),
    (waypoint(0, 1, 1, frame=10), MissionResult.UNSUPPORTED_FRAME),
    (waypoint(0, 1, 1, param3=1.0), MissionResult.INVALID_PARAM3),
    (waypoint(0, 1, 1, param1=-1.0), MissionResult.INVALID_PARAM1),
    (waypoint(0, 1, 1, param2=-1.0), MissionResult.INVALID_PARAM2),
    (waypoint(0, 1, 1, param1=math.inf), MissionResult.INVALID_PARAM1),
    (waypoint(0, 1, 1, param4=math.inf), MissionResult.INVALID_PARAM4),
    (waypoint(0, 1, 1, x=91.0), MissionResult.INVALID_PARAM5_X),
    (waypoint(0, 1, 1, x=NAN), MissionResult.INVALID_PARAM5_X),
    (waypoint(0, 1, 1, x=-math.inf), MissionResult.INVALID_PARAM5_X),
    (waypoint(0, 1, 1, y=181.0), MissionResult.INVALID_PARAM6_Y),
    (waypoint(0, 1, 1, y=NAN), MissionResult.INVALID_PARAM6_Y),
    (waypoint(0, 1, 1, x=0.0, y=0.0), MissionResult.INVALID_PARAM5_X),
    (waypoint(0, 1, 1, height=-101.0), MissionResult.INVALID_PARAM7),
    (waypoint(0, 5000.0, 0.0), MissionResult.INVALID_PARAM5_X),
    (waypoint(0, 1, 1, height=NAN), MissionResult.INVALID_PARAM7),
    (waypoint(0, 1, 1, height=6000.0), MissionResult.INVALID_PARAM7),
    (takeoff(param2=1.0), MissionResult.INVALID_PARAM2),
    (takeoff(height=0.2), MissionResult.INVALID_PARAM7),
    (takeoff(height=NAN), MissionResult.INVALID_PARAM7),
    (item(0, 20, param1=1.0), MissionResult.INVALID_PARAM1),
    (item(0, 21, param2=2.0, **LAND), MissionResult.INVALID_PARAM2),
    (item(0, 21, param1=1e38, **LAND), MissionResult.INVALID_PARAM1),
    (item(0, 93, param1=1.0, x=42.0), MissionResult.INVALID_PARAM5_X),
    (item(0, 93, param1=-1.0, param2=12.0), MissionResult.INVALID_PARAM2),
    (item(0, 93, param1=-1.0), MissionResult.INVALID_PARAM1),
    (item(0, 178, param1=5.0, param2=3.0), MissionResult.INVALID_PARAM1),
    (item(0, 178, param1=1.0, param2=0.0), MissionResult.INVALID_PARAM2),
    (item(0, 178, param1=1.0, param2=3.0, param3=50.0), MissionResult.INVALID_PARAM3),
    (item(0, 177, param1=4.0, param2=1.0), MissionResult.INVALID_PARAM1),
    (item(0, 177, param1=0.0, param2=1.0), MissionResult.INVALID_PARAM1),
    (item(0, 177, param1=0.5, param2=1.0), MissionResult.INVALID_PARAM1),
]


def check_bad_item(bad: MissionItem, result: MissionResult) -> None:
    assert result_of(bad) is result


def test_a_bad_item_is_refused_with_its_parameter() -> None:
    assert failures(check_bad_item, BAD) == []


def test_the_first_bad_item_is_named() -> None:
    rejection = check((takeoff(), waypoint(1, 1, 1, param3=1.0), item(2, 2000)), None, LIMITS)
    assert rejection is not None
    assert rejection.seq == 1
    assert "NAV_WAYPOINT" in rejection.reason
    assert "parameter 3" in rejection.reason


def test_a_take_off_behind_a_waypoint_is_refused() -> None:
    assert result_of(waypoint(0, 1, 1), takeoff(1)) is MissionResult.INVALID


def test_items_out_of_order_are_refused() -> None:
    assert result_of(takeoff(), waypoint(2, 1, 1)) is MissionResult.INVALID_SEQUENCE


def test_an_altitude_above_sea_level_is_checked_against_home() -> None:
    low = waypoint(0, 1, 1, height=HOME[2] - 110.0, frame=0)
    assert result_of(low) is MissionResult.INVALID_PARAM7
    assert result_of(low, home=None) is None


def test_a_return_item_may_carry_coordinates() -> None:
    assert result_of(item(0, 20, frame=3, z=5.0, **at(30.0, 0.0))) is None


@pytest.mark.parametrize("height", [-1.0, -60.0])
def test_a_waypoint_may_lie_below_home_on_a_hillside(height: float) -> None:
    assert result_of(waypoint(0, 1, 1, height=height)) is None


def test_the_first_position_and_each_leg_have_a_limit_of_their_own() -> None:
    """MIS_DIST_1WP from home, MIS_DIST_WPS from one position to the next; 0 is no limit."""
    far = [waypoint(seq, 800.0 * (seq + 1), 0.0) for seq in range(5)]
    home = HomePosition(0, *HOME, (0.0, 0.0, 0.0), 0.0)
    assert check(far, home, LIMITS) is None
    leg = [*far[:2], waypoint(2, 3000.0, 0.0)]
    rejection = check(leg, home, LIMITS)
    assert rejection is not None
    assert (rejection.seq, "MIS_DIST_WPS" in rejection.reason) == (2, True)
    first = check([waypoint(0, 1000.0, 0.0)], home, LIMITS)
    assert first is not None
    assert "MIS_DIST_1WP" in first.reason
    boundless = DistanceLimits()
    assert check(leg, home, boundless) is None
    assert check([waypoint(0, 11_000.0, 0.0)], home, boundless) is not None


numbers = st.floats(allow_nan=True, allow_infinity=True)
any_items = st.builds(
    MissionItem,
    seq=st.integers(0, 2),
    command=st.sampled_from([*MissionCommand, 34, 2000]),
    frame=st.sampled_from([0, 2, 3, 10]),
    current=st.booleans(),
    autocontinue=st.booleans(),
    param1=numbers,
    param2=numbers,
    param3=numbers,
    param4=numbers,
    x=numbers,
    y=numbers,
    z=numbers,
)


@given(st.lists(any_items, max_size=3))
def test_no_item_whatever_it_holds_upsets_the_check(items: list[MissionItem]) -> None:
    numbered = tuple(entry._replace(seq=index) for index, entry in enumerate(items))
    rejection = check(numbered, HOME_POSITION, LIMITS)
    if rejection is not None:
        assert rejection.reason
        assert rejection.result in set(MissionResult)
    for entry in numbered:
        if rejection is None:
            assert not any(map(math.isinf, entry[5:]))
