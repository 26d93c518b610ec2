"""The log of a vehicle that is killed, and of one whose flight ends in order."""

import contextlib
import io
import json
import os
import signal
from pathlib import Path

import pytest
from pyulog import ULog  # type: ignore[import-untyped]  # pyulog has no annotations

from tests.support.system import run_module, wait_for

pytestmark = pytest.mark.scenario


def logs(state_dir: Path) -> list[Path]:
    return sorted((state_dir / "vehicle-7" / "log").glob("*/*.ulg"))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_log_of_a_vehicle_that_is_stopped_anyhow_is_readable(
    tmp_path: Path, number: signal.Signals
) -> None:
    folder = tmp_path / "vehicle-7"
    folder.mkdir()
    (folder / "parameters.json").write_text(json.dumps({"SDLOG_MODE": 2}))
    environment = {**os.environ, "STATE_DIR": str(tmp_path), "TRUTH": "1", "SPEED": "10"}
    vehicle = run_module("uav_firmware", "--system-id", "7", "--port", "0", environment=environment)
    try:
        wait_for(lambda: logs(tmp_path) and logs(tmp_path)[0].stat().st_size > 60_000, "a log")
    finally:
        os.killpg(vehicle.pid, number)
        vehicle.communicate()
    (path,) = logs(tmp_path)
    with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what it thinks
        log = ULog(str(path))
    assert not log.file_corruption
    last_truth_s = float((folder / "truth.csv").read_text().splitlines()[-2].split(",")[0])
    assert last_truth_s - log.last_timestamp * 1e-6 < 1.0
    assert log.initial_parameters["SDLOG_MODE"] == 2
