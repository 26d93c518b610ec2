"""The truth log: complete, regular, and on disk before a kill."""

import csv
from pathlib import Path

import pytest

from sim.physics.truth_log import COLUMNS, TruthLog, format_row
from tests.unit.sim.truths import truth


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="ascii", newline="") as file:
        return list(csv.DictReader(file))


def record_seconds(log: TruthLog, seconds: float) -> None:
    for step in range(round(seconds * 250) + 1):
        log.record(truth(step * 4000))


def test_the_header_names_every_column_with_its_unit(tmp_path: Path) -> None:
    log = TruthLog(tmp_path / "vehicle-1" / "truth.csv")
    log.close()
    header = (tmp_path / "vehicle-1" / "truth.csv").read_text(encoding="ascii").strip()
    assert header.split(",") == [
        "time_s", "latitude_deg", "longitude_deg", "altitude_amsl_m", "height_above_home_m",
        "velocity_north_m_s", "velocity_east_m_s", "velocity_down_m_s",
        "q_w", "q_x", "q_y", "q_z", "roll_deg", "pitch_deg", "yaw_deg",
        "rotor_1_rpm", "rotor_2_rpm", "rotor_3_rpm", "rotor_4_rpm",
    ]  # fmt: skip


FULL_DEVICE = Path("/dev/full")


@pytest.mark.skipif(not FULL_DEVICE.exists(), reason="no device that is always full")
def test_a_full_medium_ends_the_log_and_not_the_flight(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = TruthLog(tmp_path / "truth.csv")
    log.close()
    log._file = FULL_DEVICE.open("w", encoding="ascii")
    record_seconds(log, 20.0)
    log.close()
    assert capsys.readouterr().err == "Truth log ended: No space left on device\n"


def test_values_stand_under_their_names() -> None:
    state = truth(
        1_020_000,
        velocity_ned=(1.0, -2.0, 3.0),
        rotor_rpm=(10.0, 20.0, 30.0, 40.0),
        roll_deg=-4.0,
        pitch_deg=5.0,
        yaw_deg=359.0,
    )
    row = dict(zip(COLUMNS, format_row(state).strip().split(","), strict=True))
    assert float(row["time_s"]) == 1.02
    assert float(row["latitude_deg"]) == 40.4434
    assert float(row["velocity_east_m_s"]) == -2.0
    assert float(row["yaw_deg"]) == 359.0
    assert float(row["rotor_3_rpm"]) == 30.0


def test_there_is_a_row_every_twenty_milliseconds(tmp_path: Path) -> None:
    log = TruthLog(tmp_path / "truth.csv")
    record_seconds(log, 2.0)
    log.close()
    times = [float(row["time_s"]) for row in read(tmp_path / "truth.csv")]
    assert times == pytest.approx([0.02 * index for index in range(101)])


def test_a_killed_process_loses_at_most_a_second(tmp_path: Path) -> None:
    log = TruthLog(tmp_path / "truth.csv")
    record_seconds(log, 10.0)
    on_disk = (tmp_path / "truth.csv").read_text(encoding="ascii")  # Nobody has closed it
    whole_rows = on_disk.splitlines()[:-1]
    assert float(whole_rows[-1].split(",")[0]) >= 9.0
    log.close()


def test_closing_twice_is_harmless(tmp_path: Path) -> None:
    log = TruthLog(tmp_path / "truth.csv")
    log.close()
    log.close()


def test_a_path_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="ascii")
    with pytest.raises(OSError, match="file"):
        TruthLog(tmp_path / "file" / "truth.csv")
