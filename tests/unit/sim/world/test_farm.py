"""The farm's maps: the same for everybody, smooth, and of sensible figures."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.world.farm import Farm
from sim.world.layout import Cover
from sim.world.plane import Place, Plane
from sim.world.smooth_map import Layer, SmoothMap

HOME = (40.44340, -3.73820)
MORNING_S = 1_780_300_800.0  # 2026-06-01 08:00 UTC
NEAR_DEG = st.tuples(st.floats(-0.002, 0.002), st.floats(-0.0025, 0.0025))


def at(east_m: float, north_m: float) -> tuple[float, float]:
    return Farm().plane.geodetic((east_m, north_m))


def readings(farm: Farm, place: tuple[float, float], time_s: float) -> tuple[float, ...]:
    return (
        farm.soil_moisture(*place, time_s),
        farm.air_temperature(*place, time_s),
        farm.soil_temperature(*place, time_s),
        farm.relative_humidity(*place, time_s),
        farm.vegetation_index(*place, time_s),
        farm.elevation_amsl_m(*place),
    )


def test_one_seed_is_one_farm_and_another_seed_another() -> None:
    place = at(30.0, 40.0)
    assert readings(Farm(3), place, MORNING_S) == readings(Farm(3), place, MORNING_S)
    assert readings(Farm(3), place, MORNING_S) != readings(Farm(4), place, MORNING_S)


@given(NEAR_DEG, st.floats(0.0, 86_400.0 * 365.0))
def test_everything_is_within_what_a_farm_can_be(
    offset: tuple[float, float], time_s: float
) -> None:
    place = (HOME[0] + offset[0], HOME[1] + offset[1])
    moisture, air, soil, humidity, vigour, elevation = readings(Farm(2), place, time_s)
    assert 0.02 < moisture < 0.5
    assert -15.0 < air < 45.0
    assert -15.0 < soil < 45.0
    assert 1.0 <= humidity <= 100.0
    assert 0.0 < vigour < 1.0
    assert 649.0 < elevation < 700.0


@given(NEAR_DEG)
def test_the_maps_are_smooth(offset: tuple[float, float]) -> None:
    farm, step_deg = Farm(), 1e-6  # A decimetre
    place = (HOME[0] + offset[0], HOME[1] + offset[1])
    here = readings(farm, place, MORNING_S)
    there = readings(farm, (place[0] + step_deg, place[1]), MORNING_S)
    changes = [abs(a - b) for a, b in zip(here, there, strict=True)]
    assert all(c < most for c, most in zip(changes, (0.02, 0.1, 0.1, 1.0, 0.04, 0.1), strict=True))


def test_afternoons_are_warm_and_dry_and_the_soil_follows_the_air() -> None:
    farm, place = Farm(), at(20.0, 50.0)
    hours = [MORNING_S - 8.0 * 3600.0 + 600.0 * i for i in range(144)]
    air = [farm.air_temperature(*place, time) for time in hours]
    soil = [farm.soil_temperature(*place, time) for time in hours]
    humidity = [farm.relative_humidity(*place, time) for time in hours]
    moisture = [farm.soil_moisture(*place, time) for time in hours]
    assert 14.0 < air.index(max(air)) / 6.0 < 16.5
    assert soil.index(max(soil)) > air.index(max(air))
    assert max(soil) - min(soil) < max(air) - min(air)
    assert humidity.index(min(humidity)) == pytest.approx(air.index(max(air)), abs=6)
    assert max(moisture) > min(moisture)


def test_it_is_cooler_higher_up() -> None:
    farm = Farm()
    low, high = (farm.air_temperature(*HOME, MORNING_S, height) for height in (2.0, 102.0))
    assert low - high == pytest.approx(0.65)


def test_an_irrigated_field_is_wetter_and_greener_than_the_wild_ground() -> None:
    farm = Farm()
    places = [at(10.0 + 9.0 * i, 20.0 + 10.0 * i) for i in range(9)]
    wild = [at(-240.0 + 5.0 * i, -200.0) for i in range(9)]
    for read in (farm.soil_moisture, farm.vegetation_index):
        field_mean = np.mean([read(*place, MORNING_S) for place in places])
        assert field_mean > np.mean([read(*place, MORNING_S) for place in wild])


def test_the_ground_is_level_where_vehicles_fly_and_rises_beyond() -> None:
    farm = Farm()
    assert all(
        farm.elevation_amsl_m(*at(e, n)) == 650.0 for e, n in ((0, 0), (-200, 120), (230, -160))
    )
    assert farm.elevation_amsl_m(*at(0.0, 850.0)) > 660.0


def test_home_is_beside_the_north_field_of_two_hectares() -> None:
    farm = Farm()
    assert farm.field_at(*HOME) is None
    field = farm.field_at(40.44355, -3.7380)
    assert field is not None
    assert (field.name, field.cover) == ("North field", Cover.MAIZE)
    assert field.area_m2 == pytest.approx(21_000.0, rel=0.05)


def test_no_two_fields_overlap() -> None:
    farm = Farm()
    for field in farm.fields:
        middle = Place(*np.mean(field.boundary, axis=0))
        for corner in field.boundary:
            inner = [corner[i] + 0.01 * (middle[i] - corner[i]) for i in (0, 1)]
            found = farm.field_at(*at(inner[0], inner[1]))
            assert found is field


def test_the_tractor_drives_where_it_looks_at_its_speed() -> None:
    farm = Farm()
    for second in range(0, 600, 7):
        now, soon = (farm.subjects(MORNING_S + second + dt)[0] for dt in (0.0, 0.1))
        moved = math.dist(now.place, soon.place)
        if moved > 0.99 * now.speed_m_s * 0.1:  # Not round a corner
            east = soon.place.east_m - now.place.east_m
            north = soon.place.north_m - now.place.north_m
            turned = math.degrees(math.atan2(east, north)) - now.heading_deg
            assert math.cos(math.radians(turned)) > 0.999


def test_cows_stay_in_the_pasture() -> None:
    farm = Farm(5)
    for minute in range(0, 1440, 13):
        _, *cows = farm.subjects(MORNING_S + 60.0 * minute)
        assert len(cows) == 5
        for cow in cows:
            field = farm.field_at(*at(*cow.place))
            assert field is not None
            assert field.cover is Cover.PASTURE


def test_a_farm_on_the_date_line_is_in_one_piece() -> None:
    plane = Plane(-16.85500, 179.99990, 60.0)
    latitude, longitude = plane.geodetic((50.0, 20.0))
    assert longitude < -179.0
    assert plane.place(latitude, longitude) == pytest.approx((50.0, 20.0), abs=1e-6)


@given(st.floats(-500.0, 500.0), st.floats(-500.0, 500.0))
def test_a_map_gives_one_place_the_same_value_as_a_picture(east_m: float, north_m: float) -> None:
    drawn = SmoothMap(1, Layer.VIGOUR)
    over = drawn.over(np.array([east_m]), np.array([north_m]))
    assert over[0] == pytest.approx(drawn.at(east_m, north_m), abs=1e-9)
    assert abs(over[0]) < 5.0
