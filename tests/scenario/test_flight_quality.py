"""The bench's most important bars on a few seeds each, with a margin for other dice.

`make bench` measures the same flights on ten seeds.
"""

import pytest

from tests.bench.flight_consistency import QUANTITIES
from tests.bench.flight_courses import (
    hover_and_land,
    return_from_afar,
    square_with_stops,
    two_laps,
)
from tests.bench.flight_failures import battery_emergency, gps_lost_for_good, gps_outage
from tests.bench.flight_track import rms

pytestmark = pytest.mark.scenario


def test_a_minute_at_a_point_and_a_landing_there() -> None:
    flight = hover_and_land(1, gps="rtk", wind=0.0)
    assert flight["horizontal"] <= 0.10
    assert flight["vertical"] <= 0.10
    assert flight["landing"] <= 0.20
    assert flight["touch-down"] <= 0.6
    assert flight["disarmed"] <= 4.5


def test_in_gusty_wind_a_vehicle_with_rtk_stays_at_its_point() -> None:
    flight = hover_and_land(7, gps="rtk", wind=6.0)
    assert flight["horizontal"] <= 0.25
    assert flight["vertical"] <= 0.20
    assert flight["landing"] <= 0.5
    assert flight["unharmed"]


def test_with_a_receiver_of_one_band_the_receiver_sets_the_limit() -> None:
    flights = [hover_and_land(seed, gps="m9n", wind=6.0) for seed in (2, 7)]
    assert rms(flight["horizontal"] for flight in flights) <= 3.0  # Two draws of 1.4 m RMS
    assert rms(flight["by estimate"] for flight in flights) <= 0.25
    assert rms(flight["vertical"] for flight in flights) <= 0.40
    for flight in flights:
        assert flight["unharmed"]
        for quantity in QUANTITIES:
            assert flight[quantity] >= 95.0, quantity


def test_a_square_flown_through_and_one_with_stops() -> None:
    assert two_laps(3, speed=2.5, gps="rtk")["cross-track"] <= 0.12
    stops = square_with_stops(3, speed=5.0, gps="rtk")
    assert stops["cross-track"] <= 0.13
    assert stops["mid-leg"] <= 0.10
    assert stops["overshoot"] <= 0.5


def test_the_estimator_knows_its_errors_on_fast_laps() -> None:
    flight = two_laps(4, speed=5.0, gps="rtk")
    assert flight["time"] <= 40.15
    assert flight["cross-track"] <= 0.15
    for quantity in QUANTITIES:
        assert flight[quantity] >= 90.0, quantity


def test_from_100_m_away_it_comes_home_through_strong_wind_and_stays_upright() -> None:
    flight = return_from_afar(1, wind=8.0)
    assert flight["landing"] <= 0.7
    assert flight["touch-down"] <= 0.7
    assert flight["disarmed"] <= 4.5
    assert flight["unharmed"]


def test_four_seconds_without_gps_do_not_end_a_mission() -> None:
    flight = gps_outage(3)
    assert flight["estimate"] <= 5.0
    assert flight["track"] <= 5.0


def test_without_gps_for_good_it_lands() -> None:
    flight = gps_lost_for_good(4)
    assert flight["time"] <= 60.0
    assert flight["unharmed"]


def test_an_empty_battery_finds_it_on_the_ground() -> None:
    flight = battery_emergency(5)
    assert flight["charge"] >= 1.0
    assert flight["unharmed"]
