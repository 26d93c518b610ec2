"""The frame log: readable by others, bounded, never blocking, without keys."""

import errno
import io
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from pymavlink import mavutil

from mavlink_broker.links import frame_log
from mavlink_broker.links.frame_log import FrameFiles, FrameLog, copy_frames
from mavlink_broker.mavlink.codec import Encoder, signed
from mavlink_broker.mavlink.dialect import mavlink
from tests.support.polling import wait_until

NOW = datetime(2026, 11, 21, 8, 0, tzinfo=UTC)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)


@contextmanager
def opened(folder: Path, *, file_bytes: int = 1 << 20, files: int = 3) -> Iterator[FrameLog]:
    log = FrameLog(folder, file_bytes=file_bytes, files=files)
    try:
        yield log
    finally:
        log.close()


def replayed(path: Path) -> list[Any]:
    """Messages of a file, as ground stations' library reads it."""
    log = mavutil.mavlink_connection(str(path), dialect="all")
    messages = list(iter(log.recv_msg, None))
    log.close()
    assert "BAD_DATA" not in {message.get_type() for message in messages}
    return messages


def files_of(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.tlog"), key=lambda path: (path.stat().st_mtime_ns, path.name))


def texts(messages: list[Any]) -> list[str]:
    return [message.text for message in messages]


def numbered(count: int, first: int = 0) -> Iterator[bytes]:
    encoder = Encoder(1, 1)
    for number in range(first, first + count):
        yield encoder.encode(mavlink.MAVLink_statustext_message(6, str(number).encode()))


def test_both_directions_are_replayed_with_their_times(tmp_path: Path) -> None:
    vehicle, broker = Encoder(1, 1), Encoder(254, 191)
    frames = [
        vehicle.encode(HEARTBEAT),
        broker.encode(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)),
        signed(vehicle.encode(HEARTBEAT), bytes(32), 0, 9),
    ]
    with opened(tmp_path) as log:
        for n, frame in enumerate(frames):
            log.write(frame, NOW + timedelta(seconds=n, microseconds=7))
    (path,) = files_of(tmp_path)
    messages = replayed(path)
    assert [m.get_srcSystem() for m in messages] == [1, 254, 1]
    assert [bytes(m.get_msgbuf()) for m in messages] == frames
    started = NOW.timestamp()
    assert [m._timestamp for m in messages] == pytest.approx(
        [started + n + 7e-6 for n in range(3)], abs=1e-6
    )
    assert path.read_bytes()[:8] == round((started + 7e-6) * 1e6).to_bytes(8, "big")


def test_frames_are_written_while_the_log_is_open(tmp_path: Path) -> None:
    with opened(tmp_path) as log:
        log.write(next(numbered(1)), NOW)
        wait_until(lambda: files_of(tmp_path) and files_of(tmp_path)[0].stat().st_size)


def test_keys_and_passwords_are_not_logged(tmp_path: Path) -> None:
    key = bytes(range(100, 132))
    encoder = Encoder(255, 190)
    secrets = [
        mavlink.MAVLink_setup_signing_message(1, 1, list(key), 1),
        mavlink.MAVLink_auth_key_message(key),
        mavlink.MAVLink_wifi_config_ap_message(b"farm", key),
    ]
    with opened(tmp_path) as log:
        for message in secrets:
            log.write(encoder.encode(message), NOW)
        log.write(encoder.encode(HEARTBEAT), NOW)
    (path,) = files_of(tmp_path)
    assert key[:8] not in path.read_bytes()
    assert [m.get_type() for m in replayed(path)] == ["HEARTBEAT"]


def test_the_logs_of_vehicles_do_not_fill_the_log(tmp_path: Path) -> None:
    encoder = Encoder(1, 1)
    with opened(tmp_path) as log:
        log.write(encoder.encode(mavlink.MAVLink_log_data_message(0, 0, 90, [7] * 90)), NOW)
        log.write(encoder.encode(mavlink.MAVLink_log_entry_message(0, 1, 0, 0, 90)), NOW)
    (path,) = files_of(tmp_path)
    assert [m.get_type() for m in replayed(path)] == ["LOG_ENTRY"]


def test_the_folder_has_a_bounded_size(tmp_path: Path) -> None:
    block = b"".join(b"\0" * 8 + frame for frame in numbered(100))
    store = FrameFiles(tmp_path, file_bytes=3 * len(block), files=4)
    for n in range(60):
        store.append(block, NOW + timedelta(seconds=n // 7))
        assert len(files_of(tmp_path)) <= 4
    store.close()
    assert [path.stat().st_size for path in files_of(tmp_path)] == [3 * len(block)] * 4


def test_a_new_run_starts_a_new_file_and_prunes_old_ones(tmp_path: Path) -> None:
    for n in range(5):
        with opened(tmp_path, files=2) as log:
            log.write(next(numbered(1, n)), NOW)
    # Files of one tick of the kernel's clock have no order by their time
    assert sorted(texts(replayed(path)) for path in files_of(tmp_path)) == [["3"], ["4"]]


def test_other_files_of_the_folder_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    for _ in range(3):
        with opened(tmp_path, files=1) as log:
            log.write(next(numbered(1)), NOW)
    assert (tmp_path / "notes.txt").read_text() == "mine"


class FullDisk:
    """Takes half of what it is given, and then nothing, until there is room."""

    def __init__(self) -> None:
        self.is_full = False
        self.writes = 0
        self._write = os.write

    def write(self, descriptor: int, data: bytes) -> int:
        if not self.is_full:
            return self._write(descriptor, data)
        self.writes += 1
        if self.writes == 1:
            return self._write(descriptor, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.thorough
def test_a_full_disk_is_logged_once_drops_frames_and_leaves_no_partial_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    disk = FullDisk()
    monkeypatch.setattr("mavlink_broker.links.frame_log.os.write", disk.write)
    monkeypatch.setattr(frame_log, "RETRY_INTERVAL_S", 0.05)
    with opened(tmp_path) as log:
        log.write(*record("before"))
        wait_until(lambda: files_of(tmp_path) and files_of(tmp_path)[0].stat().st_size)
        disk.is_full = True
        for _ in range(3):
            dropped = log.dropped
            log.write(*record("meanwhile"))
            wait_until(partial(_has_dropped_more, log, dropped))
        disk.is_full = False
        log.write(*record("after"))
    (path,) = files_of(tmp_path)
    assert texts(replayed(path)) == ["before", "after"]
    assert log.dropped == 3
    warnings = [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]
    assert len(warnings) == 2
    assert "No space left" in warnings[0]
    assert "again" in warnings[1]


def _has_dropped_more(log: FrameLog, than: int) -> bool:
    return log.dropped > than


def record(text: str) -> tuple[bytes, datetime]:
    frame = Encoder(1, 1).encode(mavlink.MAVLink_statustext_message(6, text.encode()))
    return frame, NOW


def test_a_folder_that_cannot_be_written_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frame_log, "RETRY_INTERVAL_S", 0.05)
    (tmp_path / "file").write_text("in the way")
    with opened(tmp_path / "file" / "tlog") as log:
        log.write(*record("lost"))
        wait_until(lambda: log.dropped == 1)


def test_a_disk_that_hangs_fills_a_bounded_buffer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frame_log, "BUFFER_BYTES", 1000)
    monkeypatch.setattr(frame_log, "FLUSH_INTERVAL_S", 3600.0)
    with opened(tmp_path) as log:
        for frame in numbered(1000):
            log.write(frame, NOW)
        assert log.dropped > 900


LAND = mavlink.MAVLink_command_long_message(1, 1, 21, 0, 0, 0, 0, 0, 0, 0, 0)


def copied(folder: Path, begin_s: float, end_s: float, *, system: int = 1) -> list[Any]:
    """Messages of a vehicle's records, as ground stations' library reads them."""
    output = io.BytesIO()
    times = (NOW + timedelta(seconds=begin_s), NOW + timedelta(seconds=end_s))
    assert copy_frames(folder, system, *times, output) == len(output.getvalue())
    path = folder / "copy"
    path.write_bytes(output.getvalue())
    return replayed(path)


def test_the_records_of_one_vehicle_and_time_are_copied(tmp_path: Path) -> None:
    vehicle, other, broker = Encoder(1, 1), Encoder(2, 1), Encoder(254, 191)
    to_all = mavlink.MAVLink_command_long_message(0, 0, 400, 0, 0, 0, 0, 0, 0, 0, 0)
    to_other = mavlink.MAVLink_command_long_message(2, 1, 22, 0, 0, 0, 0, 0, 0, 0, 0)
    sent = [
        vehicle.encode(HEARTBEAT),
        other.encode(HEARTBEAT),
        broker.encode(LAND),
        broker.encode(to_other),
        signed(broker.encode(to_all), bytes(32), 0, 9),
        vehicle.encode(mavlink.MAVLink_file_transfer_protocol_message(0, 254, 191, [7] * 251)),
    ]
    with opened(tmp_path, file_bytes=1) as log:
        for second in range(3):
            for frame in sent:
                log.write(frame, NOW + timedelta(seconds=second))
    messages = copied(tmp_path, 1, 1)
    sources = [(message.get_srcSystem(), message.get_type()) for message in messages]
    assert sources == [(1, "HEARTBEAT"), (254, "COMMAND_LONG"), (254, "COMMAND_LONG")]
    assert [message.command for message in messages[1:]] == [21, 400]
    assert {message._timestamp for message in messages} == {NOW.timestamp() + 1.0}
    assert len(copied(tmp_path, 0, 2)) == 9
    assert copied(tmp_path, 0, 2, system=3)[0].command == 400
    assert copied(tmp_path, 3, 9) == []


@pytest.mark.parametrize("rest", [b"", b"\0" * 40, b"\xff" * 7, b"\0" * 8 + b"\xfd\xff\x00half"])
def test_a_file_with_an_incomplete_record_is_copied_up_to_it(tmp_path: Path, rest: bytes) -> None:
    """As a power failure leaves it."""
    for n in range(2):
        with opened(tmp_path) as log:
            log.write(next(numbered(1, n)), NOW)
    for path in files_of(tmp_path):
        with path.open("ab") as file:
            file.write(rest)
    assert texts(copied(tmp_path, 0, 1)) == ["0", "1"]


def test_a_folder_without_files_has_no_records(tmp_path: Path) -> None:
    assert copied(tmp_path, 0, 1) == []
