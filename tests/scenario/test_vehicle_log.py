"""The log of a flight reaches the flight archive, through real programs and what befalls them."""

import contextlib
import io
from pathlib import Path
from typing import Any

import pytest
import requests
from pyulog import ULog  # type: ignore[import-untyped]  # pyulog has no annotations

from tests.support.system import FarmSystem, running, short_plan, wait_for
from tests.support.truth import read_track

pytestmark = [pytest.mark.scenario, pytest.mark.thorough]


def download(system: FarmSystem, path: str, **headers: str) -> requests.Response:
    url = system.settings.edge_url + path
    return requests.get(url, headers=system.headers("farmer") | headers, timeout=30)


def listed(system: FarmSystem) -> list[dict[str, Any]]:
    """The logs that the vehicle itself has written, beside which the broker's frame log stands."""
    logs: list[dict[str, Any]] = system.get("/flights/1/logs")
    return [log for log in logs if log["format"] == "ulg"]


def wait_until_complete(system: FarmSystem) -> dict[str, Any]:
    """Wait until the log of the only flight is complete."""
    found: dict[str, Any] = wait_for(
        lambda: next((log for log in listed(system) if log["is_complete"]), None), "the log"
    )
    return found


def own_file(system: FarmSystem) -> bytes:
    """The vehicle's own file of its only flight."""
    (path,) = (system.state_dir / "vehicle-1" / "log").glob("*/*.ulg")
    return path.read_bytes()


def test_the_log_of_a_flight_is_downloaded_and_read(tmp_path: Path) -> None:
    with running(tmp_path / "var") as system:
        system.fly(short_plan())
        log = wait_until_complete(system)
        whole = download(system, "/flights/1/log")
        assert whole.status_code == 200
        assert whole.headers["Content-Disposition"].endswith('.ulg"')
        assert whole.content == own_file(system)
        assert log["size_bytes"] == len(whole.content)
        half = len(whole.content) // 2
        parts = [
            download(system, log["url"], Range=f"bytes={half}-"),
            download(system, log["url"], Range=f"bytes=0-{half - 1}"),
        ]
        assert [part.status_code for part in parts] == [206, 206]
        assert parts[1].content + parts[0].content == whole.content
        track = system.get("/flights/1/track")
        truth = read_track(system.state_dir / "vehicle-1" / "truth.csv")
    with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what it thinks
        read = ULog(io.BytesIO(whole.content))
    assert not read.file_corruption
    data = {one.name: one.data for one in read.data_list}
    log_m = -data["vehicle_local_position"]["z"].min()
    assert log_m == pytest.approx(max(one.height_above_home_m for one in truth), abs=0.5)
    highest_m = max(place[2] for place in track["geometry"]["coordinates"])
    assert log_m == pytest.approx(highest_m, abs=1.0)  # It has a place every second
    began_s, ended_s = read.start_timestamp * 1e-6, read.last_timestamp * 1e-6
    flown = [one.time_s for one in truth if one.height_above_home_m > 1.0]
    assert began_s < flown[0]
    assert flown[-1] < ended_s < flown[-1] + 30.0


@pytest.mark.parametrize("victim", ["broker", "edge", "vehicle-1"])
def test_a_log_goes_on_behind_the_kill_of_any_program(tmp_path: Path, victim: str) -> None:
    with running(tmp_path / "var") as system:
        system.fly(short_plan())
        wait_for(lambda: any(log["received_bytes"] for log in listed(system)), "a part of the log")
        system.kill(victim)
        system.start(victim).wait_until_connected()
        wait_until_complete(system)
        assert download(system, "/flights/1/log").content == own_file(system)
        assert len(listed(system)) == 1
