"""What a vehicle's parameters are set to for a geofence."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afarcloud.plan import Geofence
from mavlink_broker.autopilots.parameter_settings import (
    HEADROOM_M,
    NO_HEIGHT_LIMIT,
    FenceParameters,
    ardupilot_fence,
    px4_fence,
    unknown_fence,
)

SQUARE = ((40.0, -3.0), (40.0, -2.9), (40.1, -2.9), (40.1, -3.0))
LOW = Geofence(max_altitude=40.0)
AREA = Geofence(inclusion=(SQUARE,))
FACTORY = {"FENCE_ENABLE": 0.0, "FENCE_TYPE": 7.0, "FENCE_ALT_MAX": 100.0, "FENCE_OPTIONS": 1.0}
heights = st.floats(1.0, 120.0)


def settings_of(guarding: FenceParameters) -> dict[str, float]:
    return {setting.name: setting.value for setting in guarding.settings}


@given(limit_m=heights, vehicle_limit_m=st.just(0.0) | heights, highest_m=heights)
def test_px4_is_never_allowed_higher_than_before_and_always_high_enough_to_fly(
    limit_m: float, vehicle_limit_m: float, highest_m: float
) -> None:
    guarding = px4_fence(
        {"GF_MAX_VER_DIST": vehicle_limit_m}, Geofence(max_altitude=limit_m), highest_m
    )
    set_m = settings_of(guarding)["GF_MAX_VER_DIST"]
    assert vehicle_limit_m == 0.0 or set_m <= vehicle_limit_m
    assert set_m <= limit_m + HEADROOM_M
    if vehicle_limit_m == 0.0 and highest_m <= limit_m:
        assert set_m >= max(limit_m, highest_m + HEADROOM_M) or set_m == limit_m
        assert set_m > highest_m or highest_m <= limit_m - HEADROOM_M
    assert guarding.own_limit_m == (vehicle_limit_m if 0.0 < vehicle_limit_m < limit_m else None)


def test_px4_returns_no_higher_than_the_fence() -> None:
    values = {"GF_MAX_VER_DIST": 0.0, "RTL_RETURN_ALT": 60.0}
    assert settings_of(px4_fence(values, LOW, 10.0))["RTL_RETURN_ALT"] == 40.0
    low = values | {"RTL_RETURN_ALT": 20.0}
    assert "RTL_RETURN_ALT" not in settings_of(px4_fence(low, LOW, 10.0))


def test_px4_needs_nothing_for_areas_alone() -> None:
    assert px4_fence({"GF_MAX_VER_DIST": 0.0}, AREA, 10.0) == FenceParameters()


@pytest.mark.parametrize("fence_parameters", [px4_fence, unknown_fence])
def test_a_vehicle_without_a_limit_is_watched_by_the_broker_alone(fence_parameters: object) -> None:
    assert callable(fence_parameters)
    assert fence_parameters({}, LOW, 10.0) == FenceParameters(note=NO_HEIGHT_LIMIT)
    assert fence_parameters({}, AREA, 10.0) == FenceParameters()


@pytest.mark.parametrize(
    ("values", "fence", "kinds"),
    [
        (FACTORY, AREA, 4),
        (FACTORY, LOW, 1),
        (FACTORY | {"FENCE_ENABLE": 1.0}, AREA, 7),
        (FACTORY | {"FENCE_AUTOENABLE": 0.0}, AREA, 4),
        (FACTORY | {"FENCE_AUTOENABLE": 1.0}, AREA, 7),
        (FACTORY | {"FENCE_AUTOENABLE": 2.0, "FENCE_TYPE": 3.0}, AREA, 7),
        (FACTORY | {"FENCE_AUTOENABLE": 3.0, "FENCE_TYPE": 2.0}, LOW, 3),
        (FACTORY | {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 2.0}, LOW, 3),
    ],
)
def test_ardupilot_keeps_what_was_switched_on_and_adds_what_is_needed(
    values: dict[str, float], fence: Geofence, kinds: int
) -> None:
    found = settings_of(ardupilot_fence(values, fence, 10.0))
    assert found["FENCE_TYPE"] == kinds
    assert found["FENCE_ENABLE"] == 1.0


def test_ardupilots_limit_counts_only_where_it_is_switched_on() -> None:
    low = FACTORY | {"FENCE_ALT_MAX": 20.0}
    off = ardupilot_fence(low, LOW, 10.0)
    assert settings_of(off)["FENCE_ALT_MAX"] == 40.0
    assert off.own_limit_m is None
    on = ardupilot_fence(low | {"FENCE_ENABLE": 1.0}, LOW, 10.0)
    assert settings_of(on)["FENCE_ALT_MAX"] == 20.0
    assert on.own_limit_m == 20.0


def test_several_inclusions_need_a_vehicle_that_takes_any_of_them() -> None:
    two = Geofence(inclusion=(SQUARE, SQUARE))
    assert settings_of(ardupilot_fence(FACTORY, two, 10.0))["FENCE_OPTIONS"] == 3.0
    old = {name: value for name, value in FACTORY.items() if name != "FENCE_OPTIONS"}
    assert ardupilot_fence(old, two, 10.0).lacks is not None
    assert ardupilot_fence(old, AREA, 10.0).lacks is None


def test_an_ardupilot_without_a_fence_is_reported() -> None:
    assert ardupilot_fence({}, AREA, 10.0).lacks is not None
