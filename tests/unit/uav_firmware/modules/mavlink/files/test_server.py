import os
import random
import struct
import zlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.files.asking import ALICE, BOB, Desk
from uav_firmware.modules.mavlink.files.client import BURST_PACKETS
from uav_firmware.modules.mavlink.files.codec import Fault, Opcode
from uav_firmware.modules.mavlink.files.sessions import (
    IDLE_LIMIT_US,
    MAX_REPETITIONS,
    MAX_SESSIONS,
    RECLAIM_US,
    TAKE_OVER_US,
)
from uav_firmware.modules.mavlink.wire.pace import TOKENS_MAX, TOKENS_PER_SECOND

CARD = "/fs/microsd"
SECRET = "secret.txt"


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    (tmp_path / SECRET).write_text("not for clients")
    return Desk(tmp_path)


def noise(count: int) -> bytes:
    return random.Random(count).randbytes(count)


def test_what_was_uploaded_comes_back(desk: Desk) -> None:
    contents = noise(5_000)
    assert desk.upload(f"{CARD}/a.bin", contents).acknowledged
    assert (desk.files / "a.bin").read_bytes() == contents
    assert desk.download(f"{CARD}/a.bin") == contents


@given(st.binary(max_size=2000))
def test_any_contents_come_back(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    desk = Desk(tmp_path_factory.mktemp("card"))
    desk.upload("fs/microsd/x", data)
    assert desk.download("/fs/microsd/x") == data


def test_the_root_shows_what_is_mounted(desk: Desk) -> None:
    (desk.images / "1.jpg").write_bytes(b"12345")
    (desk.files / "notes").mkdir()
    assert desk.names("/") == ["D@MAV_LOG", "D@PARAM", "Detc", "Dfs"]
    assert desk.names("") == desk.names("/")
    assert desk.names("/fs") == ["Dmicrosd"]
    assert desk.names(f"{CARD}/") == ["Dimage", "Dlog", "Dnotes"]
    assert desk.names(f"{CARD}/image") == ["F1.jpg\t5"]
    assert [entry[:10] for entry in desk.names("@PARAM")] == ["Fparam.pck"]


def test_logs_are_found_by_both_names(desk: Desk) -> None:
    (desk.logs / "2026-03-01").mkdir()
    (desk.logs / "2026-03-01" / "09_30_00.ulg").write_bytes(b"ULog")
    assert desk.names("@MAV_LOG/2026-03-01") == ["F09_30_00.ulg\t4"]
    assert desk.download("@MAV_LOG/2026-03-01/09_30_00.ulg") == b"ULog"
    assert desk.download(f"{CARD}/log/2026-03-01/09_30_00.ulg") == b"ULog"


def test_a_long_folder_comes_in_pages_in_order(desk: Desk) -> None:
    names = [f"file-{i:03}.bin" for i in range(100)]
    for name in names:
        (desk.files / name).write_bytes(b"x")
    assert desk.names(CARD) == [*(f"F{name}\t1" for name in names), "Dimage", "Dlog"]


def test_what_is_neither_file_nor_folder_is_skipped_and_counted(desk: Desk) -> None:
    (desk.files / "a").write_bytes(b"")
    (desk.files / "link").symlink_to(desk.files.parent / SECRET)
    (desk.files / "z").write_bytes(b"")
    assert desk.names(CARD) == ["Fa\t0", "Dimage", "S", "Dlog", "Fz\t0"]


def test_a_listing_with_times_tells_them_for_folders_too(desk: Desk) -> None:
    (desk.files / "f").write_bytes(b"abc")
    (desk.files / "sub").mkdir()
    for name in ("f", "sub"):
        os.utime(desk.files / name, (1_770_000_000, 1_770_000_000))
    data = desk.ask(Opcode.LIST_DIRECTORY_WITH_TIME, CARD).data
    entries = data.split(b"\x00")
    assert b"Ff\t3\t1770000000" in entries
    assert b"Dsub\t0\t1770000000" in entries


def test_an_empty_folder_is_at_its_end(desk: Desk) -> None:
    assert desk.ask(Opcode.LIST_DIRECTORY, f"{CARD}/image").fault == Fault.END_OF_FILE


def test_folders_files_and_names_change_as_asked(desk: Desk) -> None:
    assert desk.ask(Opcode.CREATE_DIRECTORY, f"{CARD}/d").acknowledged
    desk.upload(f"{CARD}/d/a", b"one")
    assert desk.ask(Opcode.RENAME, f"{CARD}/d/a\0{CARD}/b").acknowledged
    assert desk.download(f"{CARD}/b") == b"one"
    assert desk.ask(Opcode.TRUNCATE_FILE, f"{CARD}/b", offset=2).acknowledged
    assert desk.download(f"{CARD}/b") == b"on"
    assert desk.ask(Opcode.REMOVE_FILE, f"{CARD}/b\0").acknowledged
    assert desk.ask(Opcode.REMOVE_DIRECTORY, f"{CARD}/d").acknowledged
    assert list(desk.files.iterdir()) == []


def test_create_begins_anew_and_open_to_write_keeps(desk: Desk) -> None:
    desk.upload(f"{CARD}/a", b"old contents")
    session = desk.open(f"{CARD}/a", Opcode.OPEN_FILE_WO)
    desk.ask(Opcode.WRITE_FILE, b"NEW", session=session)
    desk.ask(Opcode.TERMINATE_SESSION, session=session)
    assert desk.download(f"{CARD}/a") == b"NEW contents"
    desk.upload(f"{CARD}/a", b"x")
    assert desk.download(f"{CARD}/a") == b"x"


def test_the_checksum_is_the_one_that_clients_compute(desk: Desk) -> None:
    contents = noise(700_000)
    (desk.files / "a").write_bytes(contents)
    answers = desk.send(Opcode.CALC_FILE_CRC32, f"{CARD}/a")
    while not answers:
        answers = desk.tick()
    state = zlib.crc32(contents, 0xFFFFFFFF) ^ 0xFFFFFFFF
    assert [answer.data for answer in answers] == [struct.pack("<I", state)]
    (desk.files / "b").write_bytes(b"")
    assert desk.ask(Opcode.CALC_FILE_CRC32, f"{CARD}/b").data == bytes(4)


@pytest.mark.parametrize(
    ("opcode", "data", "fault"),
    [
        (Opcode.OPEN_FILE_RO, f"{CARD}/none", Fault.FILE_NOT_FOUND),
        (Opcode.REMOVE_FILE, f"{CARD}/none", Fault.FILE_NOT_FOUND),
        (Opcode.REMOVE_DIRECTORY, f"{CARD}/none", Fault.FILE_NOT_FOUND),
        (Opcode.TRUNCATE_FILE, f"{CARD}/none", Fault.FILE_NOT_FOUND),
        (Opcode.CALC_FILE_CRC32, f"{CARD}/none", Fault.FILE_NOT_FOUND),
        (Opcode.LIST_DIRECTORY, f"{CARD}/none", Fault.FILE_NOT_FOUND),
        (Opcode.LIST_DIRECTORY, "/dev", Fault.FILE_NOT_FOUND),
        (Opcode.RENAME, f"{CARD}/none\0{CARD}/b", Fault.FILE_NOT_FOUND),
        (Opcode.RENAME, f"{CARD}/a\0{CARD}/b", Fault.FILE_EXISTS),
        (Opcode.RENAME, f"{CARD}/a", Fault.INVALID_DATA_SIZE),
        (Opcode.CREATE_DIRECTORY, f"{CARD}/sub", Fault.FILE_EXISTS),
        (Opcode.CREATE_DIRECTORY, f"{CARD}/log", Fault.FILE_EXISTS),
        (Opcode.CREATE_FILE, f"{CARD}/log/x", Fault.FILE_PROTECTED),
        (Opcode.CREATE_FILE, f"{CARD}/image/x", Fault.FILE_PROTECTED),
        (Opcode.CREATE_FILE, "/fs/x", Fault.FILE_NOT_FOUND),
        (Opcode.REMOVE_DIRECTORY, CARD, Fault.FILE_PROTECTED),
        (Opcode.REMOVE_FILE, "@PARAM/param.pck", Fault.FILE_PROTECTED),
        (Opcode.CREATE_FILE, "/etc/extras/parameters.json.xz", Fault.FILE_PROTECTED),
        (Opcode.OPEN_FILE_RO, "/etc/passwd", Fault.FILE_NOT_FOUND),
        (Opcode.REMOVE_FILE, "", Fault.INVALID_DATA_SIZE),
        (Opcode.READ_FILE, "", Fault.INVALID_SESSION),
        (Opcode.WRITE_FILE, "x", Fault.INVALID_SESSION),
        (Opcode.BURST_READ_FILE, "", Fault.INVALID_SESSION),
        (Opcode.TERMINATE_SESSION, "", Fault.INVALID_SESSION),
        (17, "", Fault.UNKNOWN_COMMAND),
        (127, "", Fault.UNKNOWN_COMMAND),
    ],
)
def test_what_cannot_be_is_refused_by_its_code(
    desk: Desk, opcode: int, data: str, fault: Fault
) -> None:
    (desk.files / "a").write_bytes(b"")
    (desk.files / "b").write_bytes(b"")
    (desk.files / "sub").mkdir()
    answer = desk.ask(opcode, data)
    assert (answer.fault, answer.request_opcode, len(answer.data)) == (fault, opcode, 1)


def test_an_error_without_a_code_tells_its_number(desk: Desk) -> None:
    (desk.files / "full").mkdir()
    (desk.files / "full" / "x").write_bytes(b"")
    answer = desk.ask(Opcode.REMOVE_DIRECTORY, f"{CARD}/full")
    assert answer.data == bytes((Fault.FAIL_ERRNO, 39))  # ENOTEMPTY


def test_a_size_beyond_the_payload_is_refused(desk: Desk) -> None:
    (desk.files / "a").write_bytes(b"contents")
    session = desk.open(f"{CARD}/a")
    answer = desk.ask(Opcode.READ_FILE, session=session, size=240)
    assert answer.fault == Fault.INVALID_DATA_SIZE


@pytest.mark.parametrize(
    "path",
    [
        f"{CARD}/../{SECRET}",
        f"../{SECRET}",
        "/fs/microsd/../../../../../../etc/passwd",
        f"{CARD}/link",
        f"{CARD}/out/{SECRET}",
        f"{CARD}/a\nb",
    ],
)
def test_no_path_leads_out(desk: Desk, path: str) -> None:
    (desk.files / "link").symlink_to(desk.files.parent / SECRET)
    (desk.files / "out").symlink_to(desk.files.parent)
    for opcode in (
        Opcode.OPEN_FILE_RO,
        Opcode.CREATE_FILE,
        Opcode.OPEN_FILE_WO,
        Opcode.TRUNCATE_FILE,
        Opcode.CALC_FILE_CRC32,
        Opcode.LIST_DIRECTORY,
        Opcode.CREATE_DIRECTORY,
    ):
        assert not desk.ask(opcode, path).acknowledged
        desk.tick()
    assert (desk.files.parent / SECRET).read_text() == "not for clients"


def test_bytes_that_are_no_name_are_refused(desk: Desk) -> None:
    answer = desk.ask(Opcode.CREATE_FILE, CARD.encode() + b"/\xff\xfe")
    assert answer.fault == Fault.FILE_PROTECTED
    assert list(desk.files.iterdir()) == []


def test_a_log_can_be_removed_but_not_while_it_is_written(desk: Desk) -> None:
    day = desk.logs / "2026-03-01"
    day.mkdir()
    (day / "a.ulg").write_bytes(b"x")
    desk.busy.add(day / "a.ulg")
    assert desk.ask(Opcode.REMOVE_FILE, "@MAV_LOG/2026-03-01/a.ulg").fault == Fault.FILE_PROTECTED
    desk.busy.clear()
    assert desk.ask(Opcode.REMOVE_FILE, "@MAV_LOG/2026-03-01/a.ulg").acknowledged


def test_a_lost_reply_is_sent_again_and_nothing_is_done_twice(desk: Desk) -> None:
    desk.upload(f"{CARD}/a", b"x")
    removed = desk.ask(Opcode.REMOVE_FILE, f"{CARD}/a", seq=7)
    assert removed.acknowledged
    desk.upload(f"{CARD}/a", b"another")
    assert desk.ask(Opcode.REMOVE_FILE, f"{CARD}/a", seq=7) == removed
    assert (desk.files / "a").read_bytes() == b"another"
    assert desk.ask(Opcode.REMOVE_FILE, f"{CARD}/a", seq=8).acknowledged
    assert desk.ask(Opcode.REMOVE_FILE, f"{CARD}/a", seq=9).fault == Fault.FILE_NOT_FOUND


def test_a_repeated_open_opens_once(desk: Desk) -> None:
    (desk.files / "a").write_bytes(b"x")
    first = desk.ask(Opcode.OPEN_FILE_RO, f"{CARD}/a", seq=7)
    assert desk.ask(Opcode.OPEN_FILE_RO, f"{CARD}/a", seq=7) == first
    renumbered = desk.ask(Opcode.OPEN_FILE_RO, f"{CARD}/a", seq=8)
    assert (renumbered.session, renumbered.seq) == (first.session, 9)


def test_a_file_gets_the_number_that_the_client_names(desk: Desk) -> None:
    """MAVProxy counts its sessions itself and hears no answer under another number."""
    for name in ("a", "b"):
        (desk.files / name).write_bytes(name.encode())
    assert desk.open(f"{CARD}/a", session=200) == 200
    assert desk.open(f"{CARD}/b", session=0) == 0
    assert desk.ask(Opcode.READ_FILE, session=200, size=9).data == b"a"
    assert desk.ask(Opcode.READ_FILE, session=0, size=9).data == b"b"


def test_a_number_in_use_is_not_given_to_another_file(desk: Desk) -> None:
    """MAVSDK names 0 and reads from 0, whatever the answer says."""
    for name in ("a", "b"):
        (desk.files / name).write_bytes(name.encode())
    desk.open(f"{CARD}/a")
    assert desk.ask(Opcode.OPEN_FILE_RO, f"{CARD}/b").fault == Fault.NO_SESSIONS_AVAILABLE
    assert desk.ask(Opcode.READ_FILE, session=0, size=9).data == b"a"
    desk.tick(TAKE_OVER_US / 1e6 + 0.1)
    assert desk.open(f"{CARD}/b") == 0
    assert desk.ask(Opcode.READ_FILE, session=0, size=9).data == b"b"


def test_who_opens_without_end_is_refused_in_the_end(desk: Desk) -> None:
    (desk.files / "a").write_bytes(b"x")
    answers = []
    for _ in range(2 * MAX_REPETITIONS):
        answers.append(desk.ask(Opcode.OPEN_FILE_RO, f"{CARD}/a"))
        desk.tick()
    assert answers[MAX_REPETITIONS].acknowledged
    assert answers[-1].fault == Fault.NO_SESSIONS_AVAILABLE


def test_a_client_that_starts_anew_is_not_taken_for_the_former(desk: Desk) -> None:
    for contents in (b"first", b"first"):
        desk.tick(0.4)
        assert desk.ask(Opcode.RESET_SESSIONS, seq=0).acknowledged
        created = desk.ask(Opcode.CREATE_FILE, f"{CARD}/a", seq=1)
        assert desk.ask(Opcode.WRITE_FILE, contents, session=created.session, seq=2).acknowledged
        assert desk.ask(Opcode.TERMINATE_SESSION, session=created.session, seq=3).acknowledged
        assert (desk.files / "a").read_bytes() == contents


def test_senders_have_their_own_numbers_and_sessions(desk: Desk) -> None:
    (desk.files / "a").write_bytes(b"for alice")
    (desk.files / "b").write_bytes(b"for bob")
    alice = desk.ask(Opcode.OPEN_FILE_RO, f"{CARD}/a", seq=7).session
    bob = desk.ask(Opcode.OPEN_FILE_RO, f"{CARD}/b", seq=7, sender=BOB).session
    assert (alice, bob) == (0, 0)
    assert desk.ask(Opcode.READ_FILE, session=0, size=239).data == b"for alice"
    assert desk.ask(Opcode.READ_FILE, session=0, size=239, sender=BOB).data == b"for bob"
    assert desk.ask(Opcode.RESET_SESSIONS, sender=BOB).acknowledged
    assert desk.ask(Opcode.READ_FILE, session=0, size=239).acknowledged
    assert desk.ask(Opcode.READ_FILE, session=0, size=239, sender=BOB).fault == 4


def test_sessions_are_limited_and_given_back(desk: Desk) -> None:
    for i in range(MAX_SESSIONS + 1):
        (desk.files / str(i)).write_bytes(b"x")
    for i in range(MAX_SESSIONS):
        assert desk.open(f"{CARD}/{i}", session=i) == i
    more = f"{CARD}/{MAX_SESSIONS}"
    refused = desk.ask(Opcode.OPEN_FILE_RO, more, session=MAX_SESSIONS)
    assert refused.fault == Fault.NO_SESSIONS_AVAILABLE
    assert desk.ask(Opcode.TERMINATE_SESSION, session=3).acknowledged
    assert desk.open(more, session=3) == 3


def test_a_forgotten_session_gives_way(desk: Desk) -> None:
    for i in range(MAX_SESSIONS + 1):
        (desk.files / str(i)).write_bytes(b"x")
        if i < MAX_SESSIONS:
            desk.open(f"{CARD}/{i}", session=i)
    desk.tick(RECLAIM_US / 1e6 + 1.0)
    assert desk.ask(Opcode.READ_FILE, session=2, size=10).acknowledged
    desk.open(f"{CARD}/{MAX_SESSIONS}", session=MAX_SESSIONS)
    assert desk.ask(Opcode.READ_FILE, session=2, size=10).acknowledged
    assert desk.ask(Opcode.READ_FILE, session=5, size=10).fault == Fault.INVALID_SESSION


def test_an_idle_session_is_closed(desk: Desk) -> None:
    (desk.files / "a").write_bytes(b"x")
    session = desk.open(f"{CARD}/a")
    desk.tick(IDLE_LIMIT_US / 1e6 + 2.0)
    assert desk.ask(Opcode.READ_FILE, session=session, size=9).fault == Fault.INVALID_SESSION


@pytest.mark.parametrize("size", [239, 80, 1])
@pytest.mark.parametrize("rest", [0, 1])
def test_a_burst_gives_the_file_in_pieces_of_the_size_asked_for(
    desk: Desk, size: int, rest: int
) -> None:
    contents = noise(size * 150 + rest)
    (desk.files / "a").write_bytes(contents)
    session = desk.open(f"{CARD}/a")
    told = b""
    while len(told) < len(contents):
        answers = desk.send(Opcode.BURST_READ_FILE, session=session, offset=len(told), size=size)
        while not answers[-1].burst_complete:
            answers += desk.tick()
        seqs = [answer.seq for answer in answers]
        assert seqs == [(desk.seq + 1 + i) & 0xFFFF for i in range(len(answers))]
        assert len(answers) <= BURST_PACKETS
        assert [answer.burst_complete for answer in answers[:-1]] == [0] * (len(answers) - 1)
        for answer in answers:
            assert (answer.offset, answer.session) == (len(told), session)
            told += answer.data
        desk.tick()
    assert told == contents
    (end,) = desk.send(Opcode.BURST_READ_FILE, session=session, offset=len(told), size=size)
    assert end.fault == Fault.END_OF_FILE
    assert end.offset == len(contents)


def test_a_burst_begins_anywhere_and_a_new_one_replaces_it(desk: Desk) -> None:
    contents = noise(239 * 300)
    (desk.files / "a").write_bytes(contents)
    session = desk.open(f"{CARD}/a")
    desk.send(Opcode.BURST_READ_FILE, session=session)
    desk.send(Opcode.BURST_READ_FILE, session=session)
    desk.send(Opcode.BURST_READ_FILE, session=session)  # Now the tokens are used up
    assert desk.send(Opcode.BURST_READ_FILE, session=session, offset=1000) == []
    first = desk.tick()[0]
    assert first.offset == 1000
    assert first.data == contents[1000:1239]


def test_the_end_of_a_session_ends_its_burst(desk: Desk) -> None:
    (desk.files / "a").write_bytes(noise(239 * 1000))
    session = desk.open(f"{CARD}/a")
    for _ in range(5):
        desk.send(Opcode.BURST_READ_FILE, session=session)
    assert desk.send(Opcode.TERMINATE_SESSION, session=session) == []  # The tokens are used up
    *_, last = desk.tick(1.0)
    assert (last.request_opcode, last.acknowledged) == (Opcode.TERMINATE_SESSION, True)
    assert desk.tick(1.0) == []


def test_whatever_is_asked_the_work_is_bounded(desk: Desk) -> None:
    (desk.files / "a").write_bytes(noise(239 * 5000))
    session = desk.open(f"{CARD}/a")
    sent = 0
    for _ in range(200):
        sent += len(desk.send(Opcode.BURST_READ_FILE, session=session))
    assert sent <= TOKENS_MAX
    per_tick = [len(desk.tick()) for _ in range(10)]
    assert max(per_tick) <= TOKENS_PER_SECOND * 0.02 + 1


def test_a_large_folder_costs_more_time(desk: Desk) -> None:
    for i in range(1000):
        (desk.files / f"{i:04}").write_bytes(b"")
    answered = sum(len(desk.send(Opcode.LIST_DIRECTORY, CARD)) for _ in range(20))
    answered += len(desk.tick(0.2))
    assert 5 <= answered <= 10


def test_a_client_that_takes_all_it_can_does_not_shut_others_out(desk: Desk) -> None:
    (desk.files / "a").write_bytes(noise(239 * 5000))
    for sender in (ALICE, BOB):
        assert desk.ask(Opcode.OPEN_FILE_RO, f"{CARD}/a", sender=sender).session == 0
    for _ in range(10):
        desk.send(Opcode.BURST_READ_FILE, session=0, sender=ALICE)
    desk.now_us += 20_000
    desk.send(Opcode.READ_FILE, session=0, size=10, sender=BOB)
    heard = [answer.request_opcode for answer in desk.heard[BOB]]
    assert heard == [Opcode.OPEN_FILE_RO, Opcode.READ_FILE]


def test_a_full_card_says_so(tmp_path: Path) -> None:
    desk = Desk(tmp_path, bytes_max=1000)
    session = desk.open(f"{CARD}/a", Opcode.CREATE_FILE)
    for i in range(4):
        written = desk.ask(Opcode.WRITE_FILE, bytes(239), session=session, offset=239 * i)
        assert written.acknowledged
    for offset, data in ((239 * 4, bytes(239)), (0xFFFFFFFF, b"x")):
        answer = desk.ask(Opcode.WRITE_FILE, data, session=session, offset=offset)
        assert answer.data == bytes((Fault.FAIL_ERRNO, 28))  # ENOSPC
    answer = desk.ask(Opcode.TRUNCATE_FILE, f"{CARD}/a", offset=0xFFFFFFFF)
    assert answer.data == bytes((Fault.FAIL_ERRNO, 28))
    assert (desk.files / "a").stat().st_size == 239 * 4


def test_too_many_files_are_refused(tmp_path: Path) -> None:
    desk = Desk(tmp_path, entries_max=3)
    for i in range(3):
        assert desk.upload(f"{CARD}/{i}", b"").acknowledged
    for opcode in (Opcode.CREATE_FILE, Opcode.OPEN_FILE_WO, Opcode.CREATE_DIRECTORY):
        assert desk.ask(opcode, f"{CARD}/more").data == bytes((Fault.FAIL_ERRNO, 28))
    desk.ask(Opcode.REMOVE_FILE, f"{CARD}/0")
    assert desk.ask(Opcode.CREATE_DIRECTORY, f"{CARD}/more").acknowledged


def test_what_is_for_others_or_no_request_is_ignored(desk: Desk) -> None:
    assert desk.send(Opcode.RESET_SESSIONS, target=(8, 1)) == []
    assert desk.send(Opcode.RESET_SESSIONS, target=(7, 100)) == []
    assert desk.send(Opcode.ACK) == []
    assert desk.send(Opcode.NAK) == []
    assert desk.ask(Opcode.NONE).acknowledged


@given(st.lists(st.binary(min_size=12, max_size=251), max_size=20))
def test_any_payload_is_survived(
    tmp_path_factory: pytest.TempPathFactory, payloads: list[bytes]
) -> None:
    folder = tmp_path_factory.mktemp("card")
    (folder / SECRET).write_text("not for clients")
    desk = Desk(folder)
    for payload in payloads:
        seq, session, opcode, size, _, _, _, offset = struct.unpack_from("<HBBBBBBI", payload)
        desk.send(opcode % 18, payload[12:], session=session % 9, offset=offset, size=size, seq=seq)
        desk.tick()
    assert (folder / SECRET).read_text() == "not for clients"
    assert {entry.name for entry in folder.iterdir()} == {SECRET, "files", "log", "image"}
