import os
import random
import struct
import zlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.uav_firmware.modules.mavlink.files.harness import ALICE, BOB, TWIN, FileHarness
from uav_firmware.modules.mavlink.files.client import BURST_PACKETS
from uav_firmware.modules.mavlink.files.codec import Fault, Opcode
from uav_firmware.modules.mavlink.files.sessions import (
    IDLE_LIMIT_US,
    MAX_REPETITIONS,
    MAX_SESSIONS,
    RECLAIM_US,
    TAKE_OVER_US,
)
from uav_firmware.modules.mavlink.wire.token_bucket import TOKENS_MAX, TOKENS_PER_SECOND

pytestmark = pytest.mark.usefixtures("no_open_files")

CARD = "/fs/microsd"
SECRET = "secret.txt"


@pytest.fixture
def harness(tmp_path: Path) -> FileHarness:
    (tmp_path / SECRET).write_text("not for clients")
    return FileHarness(tmp_path)


def noise(count: int) -> bytes:
    return random.Random(count).randbytes(count)


def test_an_uploaded_file_is_downloaded_unchanged(harness: FileHarness) -> None:
    contents = noise(5_000)
    assert harness.upload(f"{CARD}/a.bin", contents).acknowledged
    assert (harness.files / "a.bin").read_bytes() == contents
    assert harness.download(f"{CARD}/a.bin") == contents


@given(st.binary(max_size=2000))
def test_any_contents_can_be_downloaded(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    harness = FileHarness(tmp_path_factory.mktemp("card"))
    harness.upload("fs/microsd/x", data)
    assert harness.download("/fs/microsd/x") == data


def test_the_root_lists_the_mounts(harness: FileHarness) -> None:
    (harness.images / "1.jpg").write_bytes(b"12345")
    (harness.files / "notes").mkdir()
    assert harness.names("/") == ["D@MAV_LOG", "D@PARAM", "Detc", "Dfs"]
    assert harness.names("") == harness.names("/")
    assert harness.names("/fs") == ["Dmicrosd"]
    assert harness.names(f"{CARD}/") == ["Dimage", "Dlog", "Dnotes"]
    assert harness.names(f"{CARD}/image") == ["F1.jpg\t5"]
    assert [entry[:10] for entry in harness.names("@PARAM")] == ["Fparam.pck"]


def test_logs_are_found_by_both_names(harness: FileHarness) -> None:
    (harness.logs / "2026-03-01").mkdir()
    (harness.logs / "2026-03-01" / "09_30_00.ulg").write_bytes(b"ULog")
    assert harness.names("@MAV_LOG/2026-03-01") == ["F09_30_00.ulg\t4"]
    assert harness.download("@MAV_LOG/2026-03-01/09_30_00.ulg") == b"ULog"
    assert harness.download(f"{CARD}/log/2026-03-01/09_30_00.ulg") == b"ULog"


def test_a_long_folder_is_listed_in_pages(harness: FileHarness) -> None:
    names = [f"file-{i:03}.bin" for i in range(100)]
    for name in names:
        (harness.files / name).write_bytes(b"x")
    assert harness.names(CARD) == [*(f"F{name}\t1" for name in names), "Dimage", "Dlog"]


def test_special_files_are_skipped_and_counted(harness: FileHarness) -> None:
    (harness.files / "a").write_bytes(b"")
    (harness.files / "link").symlink_to(harness.files.parent / SECRET)
    (harness.files / "z").write_bytes(b"")
    assert harness.names(CARD) == ["Fa\t0", "Dimage", "S", "Dlog", "Fz\t0"]


def test_a_listing_with_times_includes_folders(harness: FileHarness) -> None:
    (harness.files / "f").write_bytes(b"abc")
    (harness.files / "sub").mkdir()
    for name in ("f", "sub"):
        os.utime(harness.files / name, (1_770_000_000, 1_770_000_000))
    data = harness.request(Opcode.LIST_DIRECTORY_WITH_TIME, CARD).data
    entries = data.split(b"\x00")
    assert b"Ff\t3\t1770000000" in entries
    assert b"Dsub\t0\t1770000000" in entries


def test_an_empty_folder_has_no_entries(harness: FileHarness) -> None:
    assert harness.request(Opcode.LIST_DIRECTORY, f"{CARD}/image").fault == Fault.END_OF_FILE


def test_folders_and_files_are_created_renamed_and_removed(harness: FileHarness) -> None:
    assert harness.request(Opcode.CREATE_DIRECTORY, f"{CARD}/d").acknowledged
    harness.upload(f"{CARD}/d/a", b"one")
    assert harness.request(Opcode.RENAME, f"{CARD}/d/a\0{CARD}/b").acknowledged
    assert harness.download(f"{CARD}/b") == b"one"
    assert harness.request(Opcode.TRUNCATE_FILE, f"{CARD}/b", offset=2).acknowledged
    assert harness.download(f"{CARD}/b") == b"on"
    assert harness.request(Opcode.REMOVE_FILE, f"{CARD}/b\0").acknowledged
    assert harness.request(Opcode.REMOVE_DIRECTORY, f"{CARD}/d").acknowledged
    assert list(harness.files.iterdir()) == []


def test_create_truncates_and_open_to_write_does_not(harness: FileHarness) -> None:
    harness.upload(f"{CARD}/a", b"old contents")
    session = harness.open(f"{CARD}/a", Opcode.OPEN_FILE_WO)
    harness.request(Opcode.WRITE_FILE, b"NEW", session=session)
    harness.request(Opcode.TERMINATE_SESSION, session=session)
    assert harness.download(f"{CARD}/a") == b"NEW contents"
    harness.upload(f"{CARD}/a", b"x")
    assert harness.download(f"{CARD}/a") == b"x"


def test_the_checksum_equals_that_of_clients(harness: FileHarness) -> None:
    contents = noise(700_000)
    (harness.files / "a").write_bytes(contents)
    answers = harness.send(Opcode.CALC_FILE_CRC32, f"{CARD}/a")
    while not answers:
        answers = harness.tick()
    state = zlib.crc32(contents, 0xFFFFFFFF) ^ 0xFFFFFFFF
    assert [answer.data for answer in answers] == [struct.pack("<I", state)]
    (harness.files / "b").write_bytes(b"")
    assert harness.request(Opcode.CALC_FILE_CRC32, f"{CARD}/b").data == bytes(4)


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
        (Opcode.CREATE_FILE, "/x", Fault.FILE_PROTECTED),
        (Opcode.CREATE_FILE, "/etc/x", Fault.FILE_PROTECTED),
        (Opcode.OPEN_FILE_WO, "/fs/x", Fault.FILE_PROTECTED),
        (Opcode.CREATE_DIRECTORY, "/x", Fault.FILE_PROTECTED),
        (Opcode.CREATE_DIRECTORY, "/fs/x", Fault.FILE_PROTECTED),
        (Opcode.RENAME, f"{CARD}/a\0/x", Fault.FILE_PROTECTED),
        (Opcode.CREATE_FILE, "@PARAM/x", Fault.FILE_PROTECTED),
        (Opcode.CREATE_FILE, "/none/x", Fault.FILE_NOT_FOUND),
        (Opcode.CREATE_DIRECTORY, "/fs/none/x", Fault.FILE_NOT_FOUND),
        (Opcode.OPEN_FILE_RO, "/fs/x", Fault.FILE_NOT_FOUND),
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
def test_failed_requests_have_their_error_code(
    harness: FileHarness, opcode: int, data: str, fault: Fault
) -> None:
    (harness.files / "a").write_bytes(b"")
    (harness.files / "b").write_bytes(b"")
    (harness.files / "sub").mkdir()
    answer = harness.request(opcode, data)
    assert (answer.fault, answer.request_opcode, len(answer.data)) == (fault, opcode, 1)


def test_an_other_os_error_has_its_errno(harness: FileHarness) -> None:
    (harness.files / "full").mkdir()
    (harness.files / "full" / "x").write_bytes(b"")
    answer = harness.request(Opcode.REMOVE_DIRECTORY, f"{CARD}/full")
    assert answer.data == bytes((Fault.FAIL_ERRNO, 39))  # ENOTEMPTY


def test_a_size_beyond_the_payload_is_refused(harness: FileHarness) -> None:
    (harness.files / "a").write_bytes(b"contents")
    session = harness.open(f"{CARD}/a")
    answer = harness.request(Opcode.READ_FILE, session=session, size=240)
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
def test_paths_cannot_leave_the_tree(harness: FileHarness, path: str) -> None:
    (harness.files / "link").symlink_to(harness.files.parent / SECRET)
    (harness.files / "out").symlink_to(harness.files.parent)
    for opcode in (
        Opcode.OPEN_FILE_RO,
        Opcode.CREATE_FILE,
        Opcode.OPEN_FILE_WO,
        Opcode.TRUNCATE_FILE,
        Opcode.CALC_FILE_CRC32,
        Opcode.LIST_DIRECTORY,
        Opcode.CREATE_DIRECTORY,
    ):
        assert not harness.request(opcode, path).acknowledged
        harness.tick()
    assert (harness.files.parent / SECRET).read_text() == "not for clients"


def test_invalid_paths_are_refused(harness: FileHarness) -> None:
    answer = harness.request(Opcode.CREATE_FILE, CARD.encode() + b"/\xff\xfe")
    assert answer.fault == Fault.FILE_PROTECTED
    assert list(harness.files.iterdir()) == []


def test_a_log_can_be_removed_but_not_while_it_is_written(harness: FileHarness) -> None:
    day = harness.logs / "2026-03-01"
    day.mkdir()
    (day / "a.ulg").write_bytes(b"x")
    harness.busy.add(day / "a.ulg")
    assert (
        harness.request(Opcode.REMOVE_FILE, "@MAV_LOG/2026-03-01/a.ulg").fault
        == Fault.FILE_PROTECTED
    )
    harness.busy.clear()
    assert harness.request(Opcode.REMOVE_FILE, "@MAV_LOG/2026-03-01/a.ulg").acknowledged


def test_a_lost_reply_is_repeated_and_the_request_executed_once(harness: FileHarness) -> None:
    harness.upload(f"{CARD}/a", b"x")
    removed = harness.request(Opcode.REMOVE_FILE, f"{CARD}/a", seq=7)
    assert removed.acknowledged
    harness.upload(f"{CARD}/a", b"another")
    assert harness.request(Opcode.REMOVE_FILE, f"{CARD}/a", seq=7) == removed
    assert (harness.files / "a").read_bytes() == b"another"
    assert harness.request(Opcode.REMOVE_FILE, f"{CARD}/a", seq=8).acknowledged
    assert harness.request(Opcode.REMOVE_FILE, f"{CARD}/a", seq=9).fault == Fault.FILE_NOT_FOUND


def test_a_repeated_open_opens_once(harness: FileHarness) -> None:
    (harness.files / "a").write_bytes(b"x")
    first = harness.request(Opcode.OPEN_FILE_RO, f"{CARD}/a", seq=7)
    assert harness.request(Opcode.OPEN_FILE_RO, f"{CARD}/a", seq=7) == first
    renumbered = harness.request(Opcode.OPEN_FILE_RO, f"{CARD}/a", seq=8)
    assert (renumbered.session, renumbered.seq) == (first.session, 9)


def test_a_session_has_the_requested_number(harness: FileHarness) -> None:
    """MAVProxy numbers its sessions itself and ignores answers with another number."""
    for name in ("a", "b"):
        (harness.files / name).write_bytes(name.encode())
    assert harness.open(f"{CARD}/a", session=200) == 200
    assert harness.open(f"{CARD}/b", session=0) == 0
    assert harness.request(Opcode.READ_FILE, session=200, size=9).data == b"a"
    assert harness.request(Opcode.READ_FILE, session=0, size=9).data == b"b"


def test_a_session_number_in_use_is_refused(harness: FileHarness) -> None:
    """MAVSDK requests session 0 and uses 0 whatever the answer contains."""
    for name in ("a", "b"):
        (harness.files / name).write_bytes(name.encode())
    harness.open(f"{CARD}/a")
    assert harness.request(Opcode.OPEN_FILE_RO, f"{CARD}/b").fault == Fault.NO_SESSIONS_AVAILABLE
    assert harness.request(Opcode.READ_FILE, session=0, size=9).data == b"a"
    harness.tick(TAKE_OVER_US / 1e6 + 0.1)
    assert harness.open(f"{CARD}/b") == 0
    assert harness.request(Opcode.READ_FILE, session=0, size=9).data == b"b"


def test_too_many_open_requests_are_refused(harness: FileHarness) -> None:
    (harness.files / "a").write_bytes(b"x")
    answers = []
    for _ in range(2 * MAX_REPETITIONS):
        answers.append(harness.request(Opcode.OPEN_FILE_RO, f"{CARD}/a"))
        harness.tick()
    assert answers[MAX_REPETITIONS].acknowledged
    assert answers[-1].fault == Fault.NO_SESSIONS_AVAILABLE


def test_a_restarted_client_gets_no_cached_replies(harness: FileHarness) -> None:
    for contents in (b"first", b"first"):
        harness.tick(0.4)
        assert harness.request(Opcode.RESET_SESSIONS, seq=0).acknowledged
        created = harness.request(Opcode.CREATE_FILE, f"{CARD}/a", seq=1)
        assert harness.request(
            Opcode.WRITE_FILE, contents, session=created.session, seq=2
        ).acknowledged
        assert harness.request(
            Opcode.TERMINATE_SESSION, session=created.session, seq=3
        ).acknowledged
        assert (harness.files / "a").read_bytes() == contents


def test_senders_have_their_own_numbers_and_sessions(harness: FileHarness) -> None:
    (harness.files / "a").write_bytes(b"for alice")
    (harness.files / "b").write_bytes(b"for bob")
    alice = harness.request(Opcode.OPEN_FILE_RO, f"{CARD}/a", seq=7).session
    bob = harness.request(Opcode.OPEN_FILE_RO, f"{CARD}/b", seq=7, sender=BOB).session
    assert (alice, bob) == (0, 0)
    assert harness.request(Opcode.READ_FILE, session=0, size=239).data == b"for alice"
    assert harness.request(Opcode.READ_FILE, session=0, size=239, sender=BOB).data == b"for bob"
    assert harness.request(Opcode.RESET_SESSIONS, sender=BOB).acknowledged
    assert harness.request(Opcode.READ_FILE, session=0, size=239).acknowledged
    assert harness.request(Opcode.READ_FILE, session=0, size=239, sender=BOB).fault == 4


def test_senders_with_the_same_ids_write_to_their_own_files(harness: FileHarness) -> None:
    session = harness.open(f"{CARD}/a", Opcode.CREATE_FILE)
    assert harness.request(Opcode.CREATE_FILE, f"{CARD}/b", sender=TWIN).session == session
    assert harness.request(Opcode.WRITE_FILE, b"of alice").acknowledged
    assert harness.request(Opcode.WRITE_FILE, b"of the twin", sender=TWIN).acknowledged
    assert harness.request(Opcode.RESET_SESSIONS, sender=TWIN).acknowledged
    assert harness.request(Opcode.WRITE_FILE, b", whole", offset=8).acknowledged
    assert harness.request(Opcode.TERMINATE_SESSION).acknowledged
    assert (harness.files / "a").read_bytes() == b"of alice, whole"
    assert (harness.files / "b").read_bytes() == b"of the twin"


def test_sessions_are_limited_and_reusable(harness: FileHarness) -> None:
    for i in range(MAX_SESSIONS + 1):
        (harness.files / str(i)).write_bytes(b"x")
    for i in range(MAX_SESSIONS):
        assert harness.open(f"{CARD}/{i}", session=i) == i
    more = f"{CARD}/{MAX_SESSIONS}"
    refused = harness.request(Opcode.OPEN_FILE_RO, more, session=MAX_SESSIONS)
    assert refused.fault == Fault.NO_SESSIONS_AVAILABLE
    assert harness.request(Opcode.TERMINATE_SESSION, session=3).acknowledged
    assert harness.open(more, session=3) == 3


def test_an_idle_session_number_is_reused(harness: FileHarness) -> None:
    for i in range(MAX_SESSIONS + 1):
        (harness.files / str(i)).write_bytes(b"x")
        if i < MAX_SESSIONS:
            harness.open(f"{CARD}/{i}", session=i)
    harness.tick(RECLAIM_US / 1e6 + 1.0)
    assert harness.request(Opcode.READ_FILE, session=2, size=10).acknowledged
    harness.open(f"{CARD}/{MAX_SESSIONS}", session=MAX_SESSIONS)
    assert harness.request(Opcode.READ_FILE, session=2, size=10).acknowledged
    assert harness.request(Opcode.READ_FILE, session=5, size=10).fault == Fault.INVALID_SESSION


def test_an_idle_session_is_closed(harness: FileHarness) -> None:
    (harness.files / "a").write_bytes(b"x")
    session = harness.open(f"{CARD}/a")
    harness.tick(IDLE_LIMIT_US / 1e6 + 2.0)
    assert harness.request(Opcode.READ_FILE, session=session, size=9).fault == Fault.INVALID_SESSION


@pytest.mark.parametrize("size", [239, 80, 1])
@pytest.mark.parametrize("rest", [0, 1])
def test_a_burst_has_packets_of_the_requested_size(
    harness: FileHarness, size: int, rest: int
) -> None:
    contents = noise(size * 150 + rest)
    (harness.files / "a").write_bytes(contents)
    session = harness.open(f"{CARD}/a")
    reported = b""
    while len(reported) < len(contents):
        answers = harness.send(
            Opcode.BURST_READ_FILE, session=session, offset=len(reported), size=size
        )
        while not answers[-1].burst_complete:
            answers += harness.tick()
        seqs = [answer.seq for answer in answers]
        assert seqs == [(harness.seq + 1 + i) & 0xFFFF for i in range(len(answers))]
        assert len(answers) <= BURST_PACKETS
        assert [answer.burst_complete for answer in answers[:-1]] == [0] * (len(answers) - 1)
        for answer in answers:
            assert (answer.offset, answer.session) == (len(reported), session)
            reported += answer.data
        harness.tick()
    assert reported == contents
    (end,) = harness.send(Opcode.BURST_READ_FILE, session=session, offset=len(reported), size=size)
    assert end.fault == Fault.END_OF_FILE
    assert end.offset == len(contents)


def test_a_burst_starts_at_any_offset_and_is_replaced_by_a_new_one(harness: FileHarness) -> None:
    contents = noise(239 * 300)
    (harness.files / "a").write_bytes(contents)
    session = harness.open(f"{CARD}/a")
    harness.send(Opcode.BURST_READ_FILE, session=session)
    harness.send(Opcode.BURST_READ_FILE, session=session)
    harness.send(Opcode.BURST_READ_FILE, session=session)  # Uses up the tokens
    assert harness.send(Opcode.BURST_READ_FILE, session=session, offset=1000) == []
    first = harness.tick()[0]
    assert first.offset == 1000
    assert first.data == contents[1000:1239]


def test_the_end_of_a_session_ends_its_burst(harness: FileHarness) -> None:
    (harness.files / "a").write_bytes(noise(239 * 1000))
    session = harness.open(f"{CARD}/a")
    for _ in range(5):
        harness.send(Opcode.BURST_READ_FILE, session=session)
    assert harness.send(Opcode.TERMINATE_SESSION, session=session) == []  # No tokens left
    *_, last = harness.tick(1.0)
    assert (last.request_opcode, last.acknowledged) == (Opcode.TERMINATE_SESSION, True)
    assert harness.tick(1.0) == []


def test_the_work_of_any_request_is_bounded(harness: FileHarness) -> None:
    (harness.files / "a").write_bytes(noise(239 * 5000))
    session = harness.open(f"{CARD}/a")
    sent = 0
    for _ in range(200):
        sent += len(harness.send(Opcode.BURST_READ_FILE, session=session))
    assert sent <= TOKENS_MAX
    per_tick = [len(harness.tick()) for _ in range(10)]
    assert max(per_tick) <= TOKENS_PER_SECOND * 0.02 + 1


@pytest.mark.thorough
def test_a_large_folder_costs_more_time(harness: FileHarness) -> None:
    for i in range(1000):
        (harness.files / f"{i:04}").write_bytes(b"")
    answered = sum(len(harness.send(Opcode.LIST_DIRECTORY, CARD)) for _ in range(20))
    answered += len(harness.tick(0.2))
    assert 5 <= answered <= 10


def test_a_busy_client_does_not_block_others(harness: FileHarness) -> None:
    (harness.files / "a").write_bytes(noise(239 * 5000))
    for sender in (ALICE, BOB):
        assert harness.request(Opcode.OPEN_FILE_RO, f"{CARD}/a", sender=sender).session == 0
    for _ in range(10):
        harness.send(Opcode.BURST_READ_FILE, session=0, sender=ALICE)
    harness.now_us += 20_000
    harness.send(Opcode.READ_FILE, session=0, size=10, sender=BOB)
    received = [answer.request_opcode for answer in harness.received[BOB]]
    assert received == [Opcode.OPEN_FILE_RO, Opcode.READ_FILE]


def test_full_storage_is_reported(tmp_path: Path) -> None:
    harness = FileHarness(tmp_path, bytes_max=1000)
    session = harness.open(f"{CARD}/a", Opcode.CREATE_FILE)
    for i in range(4):
        written = harness.request(Opcode.WRITE_FILE, bytes(239), session=session, offset=239 * i)
        assert written.acknowledged
    for offset, data in ((239 * 4, bytes(239)), (0xFFFFFFFF, b"x")):
        answer = harness.request(Opcode.WRITE_FILE, data, session=session, offset=offset)
        assert answer.data == bytes((Fault.FAIL_ERRNO, 28))  # ENOSPC
    answer = harness.request(Opcode.TRUNCATE_FILE, f"{CARD}/a", offset=0xFFFFFFFF)
    assert answer.data == bytes((Fault.FAIL_ERRNO, 28))
    assert (harness.files / "a").stat().st_size == 239 * 4


def test_too_many_files_are_refused(tmp_path: Path) -> None:
    harness = FileHarness(tmp_path, entries_max=3)
    for i in range(3):
        assert harness.upload(f"{CARD}/{i}", b"").acknowledged
    for opcode in (Opcode.CREATE_FILE, Opcode.OPEN_FILE_WO, Opcode.CREATE_DIRECTORY):
        assert harness.request(opcode, f"{CARD}/more").data == bytes((Fault.FAIL_ERRNO, 28))
    harness.request(Opcode.REMOVE_FILE, f"{CARD}/0")
    assert harness.request(Opcode.CREATE_DIRECTORY, f"{CARD}/more").acknowledged


def test_replies_and_requests_for_others_are_ignored(harness: FileHarness) -> None:
    assert harness.send(Opcode.RESET_SESSIONS, target=(8, 1)) == []
    assert harness.send(Opcode.RESET_SESSIONS, target=(7, 100)) == []
    assert harness.send(Opcode.ACK) == []
    assert harness.send(Opcode.NAK) == []
    assert harness.request(Opcode.NONE).acknowledged


@given(st.lists(st.binary(min_size=12, max_size=251), max_size=20))
def test_any_payload_is_survived(
    tmp_path_factory: pytest.TempPathFactory, payloads: list[bytes]
) -> None:
    folder = tmp_path_factory.mktemp("card")
    (folder / SECRET).write_text("not for clients")
    harness = FileHarness(folder)
    for payload in payloads:
        seq, session, opcode, size, _, _, _, offset = struct.unpack_from("<HBBBBBBI", payload)
        harness.send(
            opcode % 18, payload[12:], session=session % 9, offset=offset, size=size, seq=seq
        )
        harness.tick()
    assert (folder / SECRET).read_text() == "not for clients"
    assert {entry.name for entry in folder.iterdir()} == {SECRET, "files", "log", "image"}
