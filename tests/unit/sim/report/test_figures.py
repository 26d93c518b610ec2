"""The figures of a flight whose every figure is known."""

import math
from typing import Any

import numpy as np
import pytest

from sim.report.arrays import ReportError
from sim.report.figures import Flight, examine
from sim.report.flight_log import FlightLog
from sim.report.summary import summary
from tests.unit.sim.report import synthetic
from tests.unit.sim.report.synthetic import place


def flight(document: dict[str, Any] | None = None, **errors: Any) -> Flight:
    return examine(1, synthetic.planned(document), synthetic.log(**errors), synthetic.truth())


def test_times_count_from_arming() -> None:
    found = flight()
    assert found.armed_at_s == pytest.approx(synthetic.BOOT_S)
    assert found.armed_for_s == pytest.approx(25.0, abs=0.2)
    assert found.airborne_s == pytest.approx(22.735, abs=0.05)
    assert [event.text for event in found.events if event.kind == "arming"] == ["armed", "disarmed"]


def test_an_exact_estimate_has_no_error() -> None:
    errors = flight().errors
    assert np.abs(errors.position.values).max() < 1e-6
    assert np.abs(errors.velocity.values).max() < 1e-6
    assert np.abs(errors.tilt.values).max() < 1e-7
    assert np.abs(errors.heading.values).max() < 1e-7


def test_errors_are_estimate_minus_truth() -> None:
    errors = flight(position_error=(1.0, -2.0, 0.5), velocity_error=(0.1, 0.2, -0.3)).errors
    assert errors.position.values.mean(axis=0) == pytest.approx([1.0, -2.0, 0.5], abs=1e-3)
    assert errors.velocity.values.mean(axis=0) == pytest.approx([0.1, 0.2, -0.3], abs=1e-9)


def test_a_nose_too_far_right_is_a_positive_heading_error_and_no_tilt() -> None:
    half = math.radians(5.0)
    errors = flight(q=(math.cos(half), 0.0, 0.0, math.sin(half))).errors
    assert np.degrees(errors.heading.values).mean() == pytest.approx(10.0)
    assert errors.tilt.values.max() < 1e-7


def test_a_leaning_estimate_is_a_tilt_error() -> None:
    half = math.radians(1.0)
    errors = flight(q=(math.cos(half), math.sin(half), 0.0, 0.0)).errors
    assert np.degrees(errors.tilt.values).mean() == pytest.approx(2.0)


def test_tracking_is_truth_minus_setpoint_about_the_estimators_origin() -> None:
    tracking = flight(setpoint_error=(0.0, 0.4, -0.2)).tracking
    assert tracking.values.mean(axis=0) == pytest.approx([0.0, -0.4, 0.2], abs=1e-3)


def test_points_are_passed_where_the_true_track_is_closest() -> None:
    takeoff, waypoint, landing = flight().passages
    assert takeoff.distance_m == pytest.approx(0.0, abs=0.02)
    assert takeoff.time_s == pytest.approx(6.0, abs=0.05)
    assert takeoff.accepted is None
    assert waypoint.distance_m == pytest.approx(math.hypot(0.4, 0.3), abs=1e-3)
    assert waypoint.horizontal_m == pytest.approx(0.4, abs=1e-3)
    assert waypoint.vertical_m == pytest.approx(-0.3, abs=1e-3)
    assert waypoint.time_s == pytest.approx(16.0, abs=0.05)
    assert landing.time_s >= synthetic.LANDED_S - 0.05


def test_a_circle_that_the_estimate_alone_entered_was_not_entered() -> None:
    document = synthetic.plan()
    waypoint = document["missions"][0]["command_array"][1]["parameters"]
    assert flight().passages[1].accepted
    waypoint["acceptance_radius"] = 0.45
    assert flight(document, position_error=(0.0, 0.4, 0.3)).passages[1].accepted is False


def test_the_landing_error_is_that_of_the_planned_place() -> None:
    assert flight().landing.error_m == pytest.approx(0.3, abs=1e-3)
    home = synthetic.plan(command_type_id=11, parameters={"landing": True})
    assert flight(home).landing.error_m == pytest.approx(10.0, abs=1e-3)
    assert flight(home).landing.from_home_m == pytest.approx(10.0, abs=1e-3)


def test_a_plan_that_ends_in_the_air_has_no_landing_error() -> None:
    hold = synthetic.plan(command_type_id=11, parameters={"landing": False})
    assert flight(hold).landing.error_m is None
    assert ("Landing point error", "no landing planned") in summary(flight(hold))


def test_an_orbit_is_no_point_to_pass() -> None:
    orbit = synthetic.plan(
        command_type_id=7, parameters={**place(5.0, 0.0), "radius": 8.0, "orbit_altitude": 5.0}
    )
    found = flight(orbit)
    assert [passage.point.label for passage in found.passages] == ["1", "2"]
    assert found.planned.points[-1].orbit_radius_m == 8.0


def test_the_summary_tells_the_figures() -> None:
    rows = dict(summary(flight(position_error=(0.6, 0.8, 0.0))))
    assert rows["Estimate error, level"].startswith("1.000 m RMS; 1.000 m")
    assert rows["Estimate error, height"].startswith("0.000 m RMS")
    assert rows["Fastest: level; up; down"].startswith("1.00; 0.97; 0.61")
    assert rows["3-D distance flown; greatest height"].endswith("5.00 m")
    assert rows["Battery used"].startswith(f"{(25.9 + 2.0) * 12.0 / 3.6:.0f} mAh, 1.4 Wh; 90% left")


def test_a_vehicle_that_never_armed_has_no_flight() -> None:
    log = synthetic.log()
    log.topics["vehicle_status"]["arming_state"][:] = 1.0
    with pytest.raises(ReportError, match="never armed"):
        examine(1, synthetic.planned(), log, synthetic.truth())


@pytest.mark.parametrize("topic", ["vehicle_attitude", "vehicle_status", "vehicle_local_position"])
def test_a_log_that_lacks_a_topic_is_refused_by_name(topic: str) -> None:
    log = synthetic.log()
    del log.topics[topic]
    with pytest.raises(ReportError, match=f"lacks {topic}"):
        examine(1, synthetic.planned(), log, synthetic.truth())


def test_a_log_without_anything_is_refused() -> None:
    with pytest.raises(ReportError, match="lacks"):
        examine(1, synthetic.planned(), FlightLog({}), synthetic.truth())


def test_the_touch_down_is_the_fastest_descent_near_the_ground() -> None:
    assert flight().landing.touch_down_m_s == pytest.approx(4.849 / 8.0, abs=0.01)
