import random
from pathlib import Path
from typing import Any, Final

import pytest

from uav_firmware.drivers.file_tree import FileTree
from uav_firmware.modules.mavlink.files.log_pace import BURST, FIRST_PER_S, MOST_PER_S, UNPACED
from uav_firmware.modules.mavlink.files.log_server import LogServer
from uav_firmware.modules.mavlink.wire.addressing import Outgoing, Sender
from uav_firmware.modules.mavlink.wire.dialect import mavlink, pack
from uav_firmware.modules.mavlink.wire.status_text import StatusTexts

pytestmark = pytest.mark.usefixtures("no_open_files")

SYSTEM: Final = 7
ALICE: Final = Sender(255, 190, ("192.0.2.2", 14550))
BOB: Final = Sender(254, 191, ("192.0.2.3", 14540))
TWIN: Final = Sender(255, 190, ("192.0.2.4", 14550))
"""Has the ids of ALICE, as two ground stations have that were not given their own."""
ALL: Final = 0xFFFFFFFF
TICK_US: Final = 8_000


class Reader:
    """A log server over a folder, and its client."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.armed = False
        self.busy: set[Path] = set()
        self.server = LogServer(
            system_id=SYSTEM,
            store=FileTree(folder, may_write=False, is_in_use=self.busy.__contains__),
            is_armed=lambda: self.armed,
            texts=StatusTexts(),
        )
        self.now_us = 0

    def log(self, day: str, time: str, contents: bytes) -> Path:
        path = self.folder / day / f"{time}.ulg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(contents)
        return path

    def send(self, message: Any, sender: Sender = ALICE, seconds: float = 2.0) -> list[Any]:
        """Send a message; return the messages to the sender within some time."""
        pack(message)  # Must be encodable
        received = self.server.handle(message, sender, self.now_us)
        return [
            m for o in received + self.run(seconds) if o.to in {sender.address, None} for m in [o]
        ]

    def run(self, seconds: float) -> list[Outgoing]:
        received: list[Outgoing] = []
        for _ in range(round(seconds * 1e6 / TICK_US)):
            self.now_us += TICK_US
            received += self.server.tick(self.now_us)
        return received

    def listed(self, start: int = 0, end: int = 0xFFFF) -> list[tuple[int, ...]]:
        request = mavlink.MAVLink_log_request_list_message(SYSTEM, 1, start, end)
        return [
            (m.id, m.num_logs, m.last_log_num, m.time_utc, m.size)
            for m in (o.message for o in self.send(request))
            if m.get_type() == "LOG_ENTRY"
        ]

    def pieces(
        self, log_id: int, offset: int = 0, count: int = ALL, sender: Sender = ALICE
    ) -> list[tuple[int, bytes]]:
        request = mavlink.MAVLink_log_request_data_message(SYSTEM, 1, log_id, offset, count)
        return data_of(self.send(request, sender))


def data_of(received: list[Outgoing]) -> list[tuple[int, bytes]]:
    return [(o.message.ofs, bytes(o.message.data[: o.message.count])) for o in received]


def noise(count: int) -> bytes:
    return random.Random(count).randbytes(count)


@pytest.fixture
def reader(tmp_path: Path) -> Reader:
    return Reader(tmp_path)


def test_without_logs_one_entry_is_sent(reader: Reader) -> None:
    assert reader.listed() == [(0, 0, 0, 0, 0)]


def test_logs_are_numbered_from_the_oldest_with_their_time(reader: Reader) -> None:
    reader.log("2026-03-02", "00_00_00", b"ULog second")
    reader.log("2026-03-01", "09_30_00_2", b"ULog")
    reader.log("2026-03-01", "09_30_00", b"U")
    (reader.folder / "2026-03-01" / "notes.txt").write_text("no log")
    assert reader.listed() == [
        (0, 3, 2, 1_772_357_400, 1),
        (1, 3, 2, 1_772_357_400, 4),
        (2, 3, 2, 1_772_409_600, 11),
    ]


def test_a_part_of_the_list_can_be_requested_again(reader: Reader) -> None:
    for minute in range(5):
        reader.log("2026-03-01", f"09_{minute:02}_00", bytes(minute))
    reader.listed()
    assert [entry[0] for entry in reader.listed(2, 3)] == [2, 3]
    assert [entry[0] for entry in reader.listed(4, 0xFFFF)] == [4]


def test_log_numbers_are_valid_until_the_next_list(reader: Reader) -> None:
    first = reader.log("2026-03-01", "09_00_00", b"first")
    reader.log("2026-03-01", "10_00_00", b"second")
    reader.listed()
    first.unlink()
    assert reader.pieces(1) == [(0, b"second")]
    assert reader.pieces(0) == []
    assert len(reader.listed()) == 1
    assert reader.pieces(0) == [(0, b"second")]


@pytest.mark.parametrize("size", [1, 89, 90, 91, 180, 12_345])
def test_a_log_is_downloaded_completely(reader: Reader, size: int) -> None:
    contents = noise(size)
    reader.log("2026-03-01", "09_00_00", contents)
    reader.listed()
    pieces = reader.pieces(0)
    assert [offset for offset, _ in pieces] == list(range(0, size, 90))
    assert b"".join(data for _, data in pieces) == contents


def test_any_range_can_be_requested(reader: Reader) -> None:
    contents = noise(1000)
    reader.log("2026-03-01", "09_00_00", contents)
    assert reader.pieces(0, 45, 100) == [(45, contents[45:135]), (135, contents[135:145])]
    assert reader.pieces(0, 990, 90) == [(990, contents[990:])]


def test_a_request_beyond_the_end_gets_one_empty_packet(reader: Reader) -> None:
    reader.log("2026-03-01", "09_00_00", bytes(180))
    assert reader.pieces(0, 180) == [(180, b"")]
    assert reader.pieces(0, 5000, 90) == [(5000, b"")]


def test_several_ranges_are_all_sent(reader: Reader) -> None:
    contents = noise(9000)
    reader.log("2026-03-01", "09_00_00", contents)
    reader.listed()
    received: list[Outgoing] = []
    for offset in range(0, 1800, 90):
        request = mavlink.MAVLink_log_request_data_message(SYSTEM, 1, 0, offset, 90)
        received += reader.server.handle(request, ALICE, reader.now_us)
    pieces = data_of(received + reader.run(1.0))
    assert pieces == [(offset, contents[offset : offset + 90]) for offset in range(0, 1800, 90)]


def test_a_request_for_another_log_replaces_the_previous_one(reader: Reader) -> None:
    reader.log("2026-03-01", "09_00_00", bytes(90_000))
    reader.log("2026-03-01", "10_00_00", b"second")
    reader.listed()
    reader.send(mavlink.MAVLink_log_request_data_message(SYSTEM, 1, 0, 0, ALL), seconds=0.02)
    received = reader.send(mavlink.MAVLink_log_request_data_message(SYSTEM, 1, 1, 0, ALL))
    assert data_of(received)[-1] == (0, b"second")


def test_log_request_end_stops_the_transfer(reader: Reader) -> None:
    reader.log("2026-03-01", "09_00_00", bytes(900_000))
    reader.send(mavlink.MAVLink_log_request_data_message(SYSTEM, 1, 0, 0, ALL), seconds=0.1)
    assert reader.send(mavlink.MAVLink_log_request_end_message(SYSTEM, 1)) == []


def test_two_clients_get_their_own_data(reader: Reader) -> None:
    reader.log("2026-03-01", "09_00_00", b"one")
    reader.log("2026-03-01", "10_00_00", b"two")
    reader.listed()
    assert reader.pieces(0) == [(0, b"one")]
    assert reader.pieces(1, sender=BOB) == [(0, b"two")]


@pytest.mark.parametrize("other", [BOB, TWIN], ids=["other ids", "same ids"])
@pytest.mark.parametrize("erased", [False, True], ids=["listed again", "erased"])
def test_a_download_stays_in_its_log_when_another_client_numbers_them_anew(
    reader: Reader, other: Sender, *, erased: bool
) -> None:
    first = reader.log("2026-03-01", "09_00_00", b"1" * 900)
    reader.log("2026-03-01", "10_00_00", b"2" * 900)
    reader.busy.add(reader.log("2026-03-01", "11_00_00", b"3" * 900))
    reader.listed()
    assert reader.pieces(1, 0, 90) == [(0, b"2" * 90)]
    if erased:
        reader.send(mavlink.MAVLink_log_erase_message(SYSTEM, 1), other)
    else:
        first.unlink()
        reader.send(mavlink.MAVLink_log_request_list_message(SYSTEM, 1, 0, 0xFFFF), other)
    assert reader.pieces(1, 90, 90) == [(90, b"2" * 90)]


def test_the_end_of_a_download_keeps_the_numbers(reader: Reader) -> None:
    first = reader.log("2026-03-01", "09_00_00", b"first")
    reader.log("2026-03-01", "10_00_00", b"second")
    reader.listed()
    first.unlink()
    reader.send(mavlink.MAVLink_log_request_end_message(SYSTEM, 1))
    assert reader.pieces(1) == [(0, b"second")]


def test_clients_with_the_same_ids_get_their_own_data(reader: Reader) -> None:
    reader.log("2026-03-01", "09_00_00", b"1" * 90_000)
    reader.log("2026-03-01", "10_00_00", b"2" * 90_000)
    reader.listed()
    whole = [mavlink.MAVLink_log_request_data_message(SYSTEM, 1, log, 0, ALL) for log in (0, 1)]
    received = reader.server.handle(whole[0], ALICE, reader.now_us)
    received += reader.server.handle(whole[1], TWIN, reader.now_us) + reader.run(0.1)
    received += reader.server.handle(
        mavlink.MAVLink_log_request_end_message(SYSTEM, 1), TWIN, reader.now_us
    )
    received += reader.run(5.0)
    for sender, digit in ((ALICE, b"1"), (TWIN, b"2")):
        data = b"".join(
            part for _, part in data_of([o for o in received if o.to == sender.address])
        )
        assert set(data) == set(digit)
        assert (len(data) == 90_000) == (sender == ALICE)


def test_a_whole_log_is_sent_at_a_pace_and_in_small_bursts(reader: Reader) -> None:
    reader.log("2026-03-01", "09_00_00", bytes(9_000_000))
    request = mavlink.MAVLink_log_request_data_message(SYSTEM, 1, 0, 0, ALL)
    at_once = reader.server.handle(request, ALICE, reader.now_us)
    bursts = [len(at_once), *(len(reader.run(TICK_US * 1e-6)) for _ in range(250))]
    assert max(bursts) <= BURST
    assert sum(bursts) == pytest.approx(2 * FIRST_PER_S, rel=0.05)


def test_the_rate_of_requests_that_fit_into_a_buffer_is_bounded(reader: Reader) -> None:
    reader.log("2026-03-01", "09_00_00", bytes(9_000_000))
    reader.listed()
    size, count = UNPACED * 90, 0
    for part in range(40):
        request = mavlink.MAVLink_log_request_data_message(SYSTEM, 1, 0, part * size, size)
        count += len(reader.send(request, seconds=0.128))
    assert count == pytest.approx(40 * 0.128 * MOST_PER_S, rel=0.05)


def test_logs_are_erased_on_the_ground_but_for_the_one_being_written(reader: Reader) -> None:
    old = reader.log("2026-03-01", "09_00_00", b"one")
    new = reader.log("2026-03-02", "10_00_00", b"two")
    reader.busy.add(new)
    reader.armed = True
    (refusal,) = reader.send(mavlink.MAVLink_log_erase_message(SYSTEM, 1))
    assert "armed" in refusal.message.text
    assert old.exists()
    reader.armed = False
    (text,) = reader.send(mavlink.MAVLink_log_erase_message(SYSTEM, 1))
    assert text.message.text == "1 logs erased, 1 kept"
    assert not old.parent.exists()
    assert new.exists()
    assert [entry[4] for entry in reader.listed()] == [3]


def test_requests_for_another_vehicle_are_ignored(reader: Reader) -> None:
    path = reader.log("2026-03-01", "09_00_00", b"one")
    assert reader.send(mavlink.MAVLink_log_erase_message(8, 1)) == []
    assert reader.send(mavlink.MAVLink_log_request_list_message(8, 1, 0, 0xFFFF)) == []
    assert path.exists()
