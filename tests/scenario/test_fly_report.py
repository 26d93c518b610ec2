"""`make fly`: the report's figures are those of the simulator's truth and of pyulog."""

import json
import math
import os
import re
import subprocess
import sys
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from PIL import Image
from pyulog import ULog  # type: ignore[import-untyped]  # pyulog has no annotations

from sim.camera.picture import Shot, render
from sim.camera.scene.lens import Lens, Pose
from sim.mosaic.georeference import georeference
from sim.physics.truth import quaternion_from_euler
from sim.world.farm import Farm
from sim.world.sun import day_shift_s
from tests.support.system import ROOT, short_plan
from tests.support.truth import closest_approach_m, horizontal_distance_m, read_track

pytestmark = pytest.mark.scenario

SEED = 3
WAYPOINT = (40.44349, -3.73820, 4.0)


class Run(NamedTuple):
    out: Path
    printed: str
    html: str


def photographed(plan: dict[str, Any]) -> dict[str, Any]:
    """The plan with a picture at its waypoint, straight down, north up.

    It lands where it began: a return home would climb first, for half of the flight.
    """
    commands = plan["missions"][0]["command_array"]
    place = {name: commands[0]["parameters"][name] for name in ("latitude", "longitude")}
    commands[2] = {"command_id": 3, "command_type_id": 2, "parameters": place}
    picture = {"pitch_angle": -90, "yaw_angle": 0, "photo_count": 1}
    commands.insert(2, {"command_id": 4, "command_type_id": 4, "parameters": picture})
    return plan


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("fly")
    plan = folder / "plan.json"
    plan.write_text(json.dumps(photographed(short_plan())))
    environment = {
        **os.environ,
        "PLAN": str(plan),
        "OUT": str(folder / "out"),
        "SPEED": "0",
        "SEED": str(SEED),
        "WIND": "0",
        "GPS": "rtk",  # The report's figures are judged, not the receiver's wander
        "VEHICLES": "1",
        "STATE_DIR": str(folder / "not-used"),
    }
    run = subprocess.run(
        [sys.executable, "-m", "sim", "fly"],
        check=False,
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]
    assert not (folder / "not-used").exists()
    html = (folder / "out" / "report.html").read_text()
    return Run(folder / "out", run.stdout, html)


def cells(html: str, first: str, count: int = 2) -> list[str]:
    """Cells of the table row of so many that begins with a text."""
    for row in re.findall(r"<tr>(.*?)</tr>", html):
        found: list[str] = re.findall(r"<td[^>]*>(.*?)</td>", row)
        if len(found) == count and found[0] == first:
            return found
    raise AssertionError(f"no row {first!r}")


def log_of(flown: Run) -> Any:
    (path,) = (flown.out / "vehicle-1").glob("*.ulg")
    return ULog(str(path))


@pytest.mark.promise
def test_everything_is_there(flown: Run) -> None:
    assert (flown.out / "report.png").read_bytes().startswith(b"\x89PNG")
    assert f"report: {flown.out / 'report.html'}" in flown.printed
    assert "WARNING" not in flown.printed
    assert flown.html.count("FINISHED") >= 4


def test_the_distance_at_the_waypoint_is_the_true_one(flown: Run) -> None:
    track = read_track(flown.out / "vehicle-1" / "truth.csv")
    _, _, distance_m, _, _, inside = cells(flown.html, "2", 6)
    assert float(distance_m) == pytest.approx(closest_approach_m(track, *WAYPOINT), abs=0.02)
    assert float(distance_m) < 1.0
    assert inside == "yes"


def test_the_landing_error_is_the_true_one(flown: Run) -> None:
    track = read_track(flown.out / "vehicle-1" / "truth.csv")
    first, last = track[0], track[-1]
    error_m = horizontal_distance_m(last, first.latitude_deg, first.longitude_deg)
    reported = float(cells(flown.html, "Landing point error")[1].removesuffix(" m"))
    assert reported == pytest.approx(error_m, abs=0.02)
    assert reported < 1.0


def test_the_picture_shows_the_world_as_it_is_there(flown: Run) -> None:
    """What the farm's maps and the true track say that the camera must have seen."""
    (path,) = (flown.out / "vehicle-1" / "image").glob("*.jpg")
    reported = georeference(path)
    north, east = reported.offset_m(WAYPOINT[0], WAYPOINT[1])
    assert math.hypot(north, east) < 1.5
    assert reported.height_m == pytest.approx(WAYPOINT[2], abs=1.0)
    gps = log_of(flown).get_dataset("vehicle_gps_position").data
    boot_utc_s = (
        float((gps["time_utc_usec"] - gps["timestamp"])[gps["time_utc_usec"] > 0][0]) * 1e-6
    )
    with Image.open(path) as picture:
        details = picture.getexif().get_ifd(0x8769)
        small = np.asarray(picture.convert("L").resize((128, 96), Image.Resampling.BOX))
    taken = datetime.strptime(details[0x9003] + "+0000", "%Y:%m:%d %H:%M:%S%z")
    time_s = taken.timestamp() + int(details[0x9291]) * 1e-3 - boot_utc_s
    track = read_track(flown.out / "vehicle-1" / "truth.csv")
    true = min(track, key=lambda row: abs(row.time_s - time_s))
    farm = Farm(SEED)
    place = (farm.plane.latitude_deg, farm.plane.longitude_deg)
    seen = render(
        Shot(
            farm,
            Pose(
                true.latitude_deg,
                true.longitude_deg,
                650.0 + true.height_above_home_m,
                quaternion_from_euler(0.0, math.radians(-90.0), 0.0),
            ),
            Lens(4.5, 6.3, 4.725, 512, 384),
            boot_utc_s + time_s + day_shift_s(*place, boot_utc_s),
        )
    )
    expected = Image.fromarray(seen.colour).convert("L").resize((128, 96), Image.Resampling.BOX)
    assert np.corrcoef(small.ravel(), np.asarray(expected).ravel())[0, 1] > 0.9
    assert "1 picture, " in flown.html
    assert "of the North field" in flown.html


def test_the_log_spans_the_armed_time_and_a_moment_on_each_side(flown: Run) -> None:
    log = log_of(flown)
    status = log.get_dataset("vehicle_status").data
    armed = [t for t, s in zip(status["timestamp"], status["arming_state"], strict=True) if s == 2]
    attitude = log.get_dataset("vehicle_attitude").data["timestamp"]
    assert 1.0 <= (armed[0] - attitude[0]) * 1e-6 <= 2.6
    assert 0.4 <= (attitude[-1] - armed[-1]) * 1e-6 <= 2.0
    assert not log.file_corruption
    assert log.dropouts == []


def test_every_topic_of_the_flight_is_in_the_log(flown: Run) -> None:
    log = log_of(flown)
    assert set(log.message_formats) == {data.name for data in log.data_list}
    assert "Armed" in {message.message for message in log.logged_messages}
    assert log.initial_parameters["MPC_XY_CRUISE"] == 5.0


def test_the_estimate_in_the_log_is_near_the_truth(flown: Run) -> None:
    reported = cells(flown.html, "Estimate error, level")[1]
    assert 0.0 < float(reported.split(" m RMS")[0]) < 0.6
    height = cells(flown.html, "3-D distance flown; greatest height")[1]
    track = read_track(flown.out / "vehicle-1" / "truth.csv")
    highest_m = max(position.height_above_home_m for position in track)
    assert float(height.split("; ")[1].removesuffix(" m")) == pytest.approx(highest_m, abs=0.02)
