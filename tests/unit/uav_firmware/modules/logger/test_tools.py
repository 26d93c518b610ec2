"""The command lines of PX4's developers on a log in a folder."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from tests.unit.uav_firmware.modules.logger.harness import UTC_US, LoggerHarness
from uav_firmware.drivers.log_folder import LogFolder
from uav_firmware.msg.status import StatusText


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = LogFolder(tmp_path_factory.mktemp("vehicle") / "log")
    harness = LoggerHarness(folder)
    harness.run(5.0)
    harness.topics.status_text.publish(StatusText(harness.time_us, 6, "Armed"))
    harness.fly(3.0)
    (path,) = folder.files()
    return path


def output(tool: str, *arguments: str) -> str:
    run = subprocess.run(
        [str(Path(sys.executable).parent / tool), *arguments],
        check=True,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.stderr == ""
    return run.stdout


def test_the_file_name_is_utc_time(log: Path) -> None:
    began_us = UTC_US + 3_000_000
    assert abs(log.stat().st_size - 20_000) < 15_000
    assert log.parent.name == "2026-02-25"
    assert log.name == f"06_13_{began_us // 1_000_000 % 60:02d}.ulg"


def test_ulog_info_reads_it(log: Path) -> None:
    text = output("ulog_info", str(log))
    assert "sys_name: PX4" in text
    assert "No Dropouts" in text
    assert "vehicle_attitude (0, 24)" in text


def test_ulog2csv_writes_the_columns(log: Path, tmp_path: Path) -> None:
    output("ulog2csv", "-o", str(tmp_path), str(log))
    with next(tmp_path.glob("*_actuator_motors_0.csv")).open(newline="") as table:
        row = next(csv.DictReader(table))
    assert float(row["control[2]"]) == pytest.approx(0.3)


def test_ulog_messages_and_ulog_params_read_it(log: Path) -> None:
    assert "INFO: Armed" in output("ulog_messages", str(log))
    assert "SDLOG_MODE" in output("ulog_params", str(log))
