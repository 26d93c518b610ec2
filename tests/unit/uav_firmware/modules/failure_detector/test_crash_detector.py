"""Crashes distinguished from flight by inertial sensor, rotors and attitude."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_firmware.modules.failure_detector.crash_detector import (
    ADRIFT_TIME_S,
    FALL_TIME_S,
    FALLS_WITHIN_S,
    REST_TIME_S,
    SILENT_TIME_S,
    STANDS_TIME_S,
    CrashDetector,
    FallDetector,
    ImpactDetector,
    Moment,
)

DT = 0.02
NAN = math.nan
SILENT = (NAN, NAN, NAN)
HOVER = Moment((0.0, 0.0, 0.0), (0.0, 0.0, -9.8), 0.0, 0)
ON_ITS_BACK = HOVER._replace(specific_force_frd=(1.0, 0.0, 9.7))
ON_ITS_SIDE = HOVER._replace(specific_force_frd=(0.0, 9.0, -3.9))


def detect(moment: Moment, seconds: float, former: CrashDetector | None = None) -> CrashDetector:
    seen = former or CrashDetector()
    for _ in range(round(seconds / DT)):
        seen.update(moment, DT)
    return seen


@pytest.mark.parametrize(
    ("moment", "after_s"),
    [
        (ON_ITS_BACK, REST_TIME_S),
        (ON_ITS_SIDE, REST_TIME_S),
        (ON_ITS_SIDE._replace(rate_frd=SILENT), REST_TIME_S),
        (HOVER._replace(rate_frd=SILENT), REST_TIME_S),
        (HOVER._replace(failed_motors=2), REST_TIME_S),
        (HOVER._replace(failed_motors=4, specific_force_frd=SILENT), REST_TIME_S),
        (HOVER._replace(thrust_axis_error=0.6), ADRIFT_TIME_S),
        (HOVER._replace(thrust_axis_error=1.0, rate_frd=(3.0, 0.0, 0.0)), ADRIFT_TIME_S),
        (Moment(SILENT, SILENT, 0.0, 0), SILENT_TIME_S),
        (HOVER._replace(thrust_share=0.5, height_m=655.0), STANDS_TIME_S),
        (  # Nothing of the inertial sensor is right
            Moment((3.5, 0.0, 0.0), (0.0, 20.0, -9.8), NAN, 0, 0.2, 655.0),
            STANDS_TIME_S,
        ),
    ],
)
def test_a_crash_is_found_when_its_signs_have_held(moment: Moment, after_s: float) -> None:
    assert detect(moment, after_s - 0.1).cause == ""
    assert detect(moment, after_s + 0.1).cause != ""


@pytest.mark.parametrize(
    "moment",
    [
        HOVER,
        HOVER._replace(failed_motors=1),
        HOVER._replace(specific_force_frd=(4.0, 0.0, -9.0)),  # Drag of a fast flight
        HOVER._replace(specific_force_frd=(0.0, 0.0, -25.0)),
        HOVER._replace(failed_motors=2, rate_frd=(0.0, 0.0, 15.0)),  # Comes down spinning
        HOVER._replace(specific_force_frd=SILENT),
        HOVER._replace(specific_force_frd=(0.1, 0.0, 0.2), failed_motors=4),  # Falls
        HOVER._replace(thrust_axis_error=0.4),
        HOVER._replace(thrust_axis_error=1.0, specific_force_frd=(0.0, 0.0, -20.0)),
        HOVER._replace(thrust_axis_error=NAN),
        HOVER._replace(thrust_share=0.9, height_m=655.0),
        HOVER._replace(thrust_share=NAN, height_m=655.0),
        HOVER._replace(thrust_share=0.1, height_m=NAN),
    ],
)
def test_a_flight_is_no_crash(moment: Moment) -> None:
    assert detect(moment, 30.0).cause == ""


@pytest.mark.parametrize("rise_m_s", [0.0, 12.0])
def test_a_fall_and_a_toss_without_thrust_are_no_crash(rise_m_s: float) -> None:
    """From 100 m down, and 7 m up and down again: height changes as nothing that stands does."""
    seen = CrashDetector()
    for number in range(round(3.6 / DT)):
        t = number * DT
        height_m = 755.0 + rise_m_s * t - 4.9 * t * t
        moment = HOVER._replace(specific_force_frd=(0.0, 0.0, -0.3), thrust_share=0.0)
        seen.update(moment._replace(height_m=height_m), DT)
    assert seen.cause == ""


def test_a_blow_is_what_neither_rotors_nor_a_controller_can_do() -> None:
    blow = ImpactDetector()
    for number in range(250):  # A flip at 10 rad/s, begun within 0.1 s, in vibration
        rate = min(10.0, 100.0 * number * 0.008)
        force = -9.8 - 3.0 * math.sin(number)
        assert not blow.update((rate, 0.0, 0.0), (0.0, 0.0, force), 0.008)
    assert blow.update((0.0, 0.0, 0.0), (0.0, 0.0, -9.8), 0.008)
    assert [blow.update((0.0, 0.0, 0.0), HOVER[1], dt) for dt in (0.9, 0.2)] == [True, False]
    assert blow.update((0.0, 0.0, 0.0), (0.0, 0.0, -30.0), 0.008)
    assert not ImpactDetector().update(SILENT, SILENT, 0.008)


def test_what_was_found_stays_until_it_is_reset() -> None:
    found = detect(ON_ITS_BACK, 2.0)
    assert detect(HOVER, 5.0, found).cause != ""
    found.reset()
    assert detect(HOVER, 5.0, found).cause == ""


@given(
    st.lists(
        st.tuples(
            st.floats(-8.0, 8.0),  # Drag along the body's axes
            st.floats(-8.0, 8.0),
            st.floats(-40.0, 0.0),  # Thrust
            st.floats(-30.0, 30.0),
            st.integers(0, 1),
        ),
        min_size=1,
        max_size=30,
    )
)
def test_no_thrust_along_the_rotors_looks_like_a_crash(
    flight: list[tuple[float, float, float, float, int]],
) -> None:
    """Whatever a healthy vehicle flies without an attitude order, as in acro."""
    seen = CrashDetector()
    for x, y, thrust, rate, failed in flight:
        drag = min(abs(thrust), 8.0) / 8.0  # Beside the thrust only as far as it is small
        force = (0.6 * drag * x, 0.6 * drag * y, thrust)
        detect(Moment((rate, 0.0, 0.0), force, NAN, failed), 0.5, seen)
    assert seen.cause == ""


FALLING = (0.4, 0.0, -0.7)
STANDING = (0.0, 0.0, -9.8)


def disarmed(*, in_air: bool) -> FallDetector:
    detector = FallDetector()
    detector.note_armed(in_air=in_air)
    return detector


def falls(detector: FallDetector, force: tuple[float, float, float], seconds: float) -> bool:
    return any(detector.update(force, DT) for _ in range(round(seconds / DT)))


def test_a_vehicle_that_is_disarmed_in_the_air_falls() -> None:
    detector = disarmed(in_air=True)
    assert not falls(detector, FALLING, FALL_TIME_S - 2 * DT)
    assert falls(detector, FALLING, 3 * DT)


def test_one_that_is_disarmed_on_the_ground_may_be_dropped() -> None:
    assert not falls(disarmed(in_air=False), FALLING, 2.0)


def test_one_that_is_disarmed_as_it_touches_down_does_not_fall() -> None:
    detector = disarmed(in_air=True)
    for _ in range(5):  # It bounces
        assert not falls(detector, FALLING, 0.1)
        assert not falls(detector, STANDING, 0.1)
    assert not falls(detector, STANDING, FALLS_WITHIN_S)
    assert not falls(detector, FALLING, 2.0), "it is carried away"


def test_without_an_accelerometer_no_fall_is_seen() -> None:
    assert not falls(disarmed(in_air=True), SILENT, 2.0)
