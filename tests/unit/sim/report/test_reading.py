"""Plan, truth log and ULog as they are found."""

import json
from pathlib import Path

import numpy as np
import pytest

from sim.physics.truth_log import COLUMNS
from sim.report.arrays import ReportError
from sim.report.events import armed_times, events, mode_spans
from sim.report.flight_log import read_logs
from sim.report.plan import planned_for
from sim.report.truth_track import read_truth
from tests.unit.sim.report import synthetic
from uav_firmware.modules.logger import ulog

ROOT = Path(__file__).parents[4]


def truth_row(time_s: float, latitude_deg: float, height_m: float) -> str:
    values = dict.fromkeys(COLUMNS, 0.0) | {
        "time_s": time_s,
        "latitude_deg": latitude_deg,
        "longitude_deg": -3.7,
        "altitude_amsl_m": 650.0 + height_m,
        "height_above_home_m": height_m,
        "q_w": 1.0,
    }
    return ",".join(str(value) for value in values.values())


def truth_log(path: Path, *rows: str) -> Path:
    path.write_text("\n".join((",".join(COLUMNS), *rows)))
    return path


def test_the_track_lies_about_where_the_vehicle_stood_first(tmp_path: Path) -> None:
    log = truth_log(tmp_path / "t.csv", truth_row(0.0, 40.0, 0.151), truth_row(0.02, 40.00001, 1.5))
    track = read_truth(log)
    assert track.position[0] == pytest.approx([0.0, 0.0, 0.151])
    assert track.position[1] == pytest.approx([1.110, 0.0, 1.5], abs=0.002)
    assert track.plane.altitude_amsl_m == 650.0


def test_a_last_row_that_was_cut_off_is_left_out(tmp_path: Path) -> None:
    rows = [truth_row(0.02 * number, 40.0, 1.0) for number in range(5)]
    log = truth_log(tmp_path / "t.csv", *rows[:-1], rows[-1][:30])
    assert len(read_truth(log).time_s) == 4


@pytest.mark.parametrize("text", [None, "", "time_s\n1", ",".join(COLUMNS)])
def test_a_truth_log_that_is_none_is_refused(tmp_path: Path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "t.csv").write_text(text)
    with pytest.raises(ReportError, match=r"t\.csv holds no"):
        read_truth(tmp_path / "t.csv")


def flight_log(path: Path, *times_us: int) -> Path:
    fields = ulog.fields("uint64_t timestamp; float x; float[2] y")
    layout = ulog.record_layout(fields)
    path.write_bytes(
        b"".join(
            (
                ulog.header(times_us[0]),
                ulog.format_definition("thing", fields),
                ulog.subscription(0, "thing"),
                *(layout.pack(layout.size - 3, ord("D"), 0, t, 1.5, 2.5, 3.5) for t in times_us),
                ulog.text(4, times_us[0], "Wind"),
            )
        )
    )
    return path


def test_the_logs_of_two_flights_are_one_log(tmp_path: Path) -> None:
    log = read_logs([flight_log(tmp_path / "1", 1_000_000), flight_log(tmp_path / "2", 9_000_000)])
    assert log.time_s("thing").tolist() == pytest.approx([1.0, 9.0])
    assert log.array("thing", "y", 2).tolist() == [[2.5, 3.5]] * 2
    assert [(text.severity, text.text) for text in log.texts] == [(4, "Wind")] * 2
    assert [text.time_s for text in log.texts] == pytest.approx([1.0, 9.0])


def test_what_is_no_flight_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.ulg").write_bytes(b"nothing of the kind")
    with pytest.raises(ReportError, match=r"x\.ulg holds no flight log"):
        read_logs([tmp_path / "x.ulg"])
    with pytest.raises(ReportError, match="has logged no flight"):
        read_logs([])


def test_the_example_plan_is_read_with_its_points_and_fence() -> None:
    document = json.loads((ROOT / "examples/plans/first_flight.json").read_text())
    planned = planned_for(document, 1, synthetic.PLANE)
    assert [point.label for point in planned.points] == ["1", "2", "3", "4", "5"]
    assert planned.points[1].position == pytest.approx([20.0, 0.0, 8.0], abs=0.1)
    assert planned.points[1].acceptance_m == 1.0
    assert planned.landing is not None
    assert planned.landing.tolist() == [0.0, 0.0]
    assert planned.inclusions[0].shape == (4, 2)
    assert planned.commands[2].summary == "10 m up, 1 m acceptance, 2 s hold"


def test_only_the_vehicles_own_mission_is_its_plan() -> None:
    document = synthetic.plan()
    document["missions"].append({"mission_id": 2, "vehicle_id": 2, "command_array": []})
    assert len(planned_for(document, 1, synthetic.PLANE).commands) == 3
    assert planned_for(document, 2, synthetic.PLANE).commands == []


def test_modes_arming_and_warnings_are_events() -> None:
    log = synthetic.log()
    ((begin_s, end_s),) = armed_times(log)
    assert (begin_s, end_s) == pytest.approx((synthetic.BOOT_S, synthetic.BOOT_S + 25.0), abs=0.11)
    assert [span.mode for span in mode_spans(log)] == ["HOLD", "MISSION", "HOLD"]
    found = [(event.kind, event.text) for event in events(log)]
    assert found[0] == ("mode", "mode HOLD")
    assert ("warning", "Battery low") in found
    times = [event.time_s for event in events(log)]
    assert times == sorted(times)


def test_a_log_that_ends_in_the_air_ends_the_armed_time() -> None:
    log = synthetic.log()
    log.topics["vehicle_status"]["arming_state"][-12:] = 2.0
    ((_, end_s),) = armed_times(log)
    assert end_s == log.time_s("vehicle_status")[-1]


def test_landing_states_and_items_are_events() -> None:
    log = synthetic.log()
    log.topics["vehicle_land_detected"] = {
        "time_s": np.array([1.0, 2.0, 3.0]),
        "landed_state": np.array([1.0, 3.0, 2.0]),
    }
    log.topics["mission_result"] = {
        "time_s": np.array([1.0, 4.0, 5.0]),
        "seq_reached": np.array([-1.0, 0.0, 1.0]),
        "finished": np.array([0.0, 0.0, 1.0]),
    }
    found = {event.text: event.time_s for event in events(log)}
    assert found["taking off"] == 2.0
    assert found["in the air"] == 3.0
    assert found["item 1 reached"] == 5.0
    assert found["mission complete"] == 5.0
