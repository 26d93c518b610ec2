"""The spool on disk: one broker at a time, reports before pictures, a bound that holds."""

import errno
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mavlink_broker.edge.outbox import Post
from mavlink_broker.edge.spool import (
    LOCK_FILE,
    MIB,
    PICTURES_FILE,
    REPORTS_FILE,
    Spool,
    SpoolBusyError,
    SpoolError,
)
from tests.support.spooled_posts import numbers, picture, post


def opened(folder: Path, max_bytes: int = MIB) -> Spool:
    return Spool(folder, max_bytes=max_bytes)


def numbered(spool: Spool, *posts: Post) -> list[Post]:
    for one in posts:
        one.spool_number = spool.next_number()
    return list(posts)


def left_in(spool: Spool) -> list[int]:
    """Which posts an earlier run has left."""
    return numbers(list(spool.take_inherited()))


def long(number: int) -> dict[str, Any]:
    return {"sequence_number": number, "text": "x" * 1000}


def kept(spool: Spool, posts: list[Post]) -> list[int]:
    return numbers(
        [one for one in posts if one.spool_number is not None and one.spool_number in spool]
    )


def test_the_next_run_gets_the_posts_that_wait_in_order(tmp_path: Path) -> None:
    spool = opened(tmp_path)
    reports = numbered(spool, post(number=1), post(number=2), post(number=3))
    spool.store_reports(reports)
    spool.store_pictures(numbered(spool, picture(4)))
    spool.release(frozenset({reports[1].spool_number or 0}))
    spool.close()
    again = opened(tmp_path)
    left = list(again.take_inherited())
    assert numbers(left) == [1, 3, 4]
    assert [one.idempotency_key for one in left[:2]] == [
        "mission_report-1",
        "mission_report-3",
    ]
    assert again.next_number() > max(one.spool_number or 0 for one in left)


def test_an_unused_spool_writes_nothing(tmp_path: Path) -> None:
    spool = opened(tmp_path)
    spool.release(frozenset())
    assert spool.writes == 0
    assert [path.name for path in tmp_path.iterdir()] == [LOCK_FILE]


def test_two_brokers_cannot_use_one_folder(tmp_path: Path) -> None:
    spool = opened(tmp_path)
    with pytest.raises(SpoolBusyError, match="another broker"):
        opened(tmp_path)
    spool.close()
    opened(tmp_path).close()


def test_the_lock_ends_with_a_killed_broker(tmp_path: Path) -> None:
    """The lock belongs to the process."""
    reports = f"Spool(Path({str(tmp_path)!r}), max_bytes=1000); os.kill(os.getpid(), 9)"
    imports = "import os; from pathlib import Path; from mavlink_broker.edge.spool import Spool; "
    ended = subprocess.run([sys.executable, "-c", imports + reports], check=False)
    assert ended.returncode == -9
    opened(tmp_path).close()


def _is_a_file(folder: Path) -> None:
    folder.write_text("not a folder")


def _has_a_folder_for_words(folder: Path) -> None:
    (folder / REPORTS_FILE).mkdir(parents=True)


def _has_a_link_for_a_lock(folder: Path) -> None:
    folder.mkdir()
    (folder / LOCK_FILE).symlink_to("/dev/null")


@pytest.mark.parametrize("spoil", [_is_a_file, _has_a_folder_for_words, _has_a_link_for_a_lock])
def test_a_folder_that_cannot_be_used_is_an_error(
    spoil: Callable[[Path], None], tmp_path: Path
) -> None:
    spoil(tmp_path / "broker")
    with pytest.raises(SpoolError, match="broker"):
        opened(tmp_path / "broker")


def test_invalid_lines_are_counted_and_the_others_are_read(tmp_path: Path) -> None:
    spool = opened(tmp_path)
    spool.store_reports(numbered(spool, post(number=1)))
    spool.close()
    with (tmp_path / REPORTS_FILE).open("ab") as file:
        file.write(b"\x00\xff rubbish\n\n{}\n")
    again = opened(tmp_path)
    assert again.damaged == 3
    assert left_in(again) == [1]
    again.store_reports(numbered(again, post(number=2)))
    again.close()
    assert left_in(opened(tmp_path)) == [1, 2]


def test_pictures_have_half_of_the_space_and_the_oldest_are_stored(tmp_path: Path) -> None:
    spool = opened(tmp_path, 20_000)
    pictures = numbered(spool, *(picture(n, 3000) for n in range(6)))
    with pytest.raises(OSError, match="used up"):
        spool.store_pictures(pictures)
    assert kept(spool, pictures) == [0, 1, 2]


def test_a_small_picture_does_not_overtake_one_without_space(tmp_path: Path) -> None:
    spool = opened(tmp_path, 20_000)
    pictures = numbered(spool, picture(0, 6000), picture(1, 6000), picture(2, 10))
    with pytest.raises(OSError, match="used up"):
        spool.store_pictures(pictures)
    assert kept(spool, pictures) == [0]


def test_reports_evict_pictures(tmp_path: Path) -> None:
    spool = opened(tmp_path, 20_000)
    pictures = numbered(spool, picture(0, 8000))
    spool.store_pictures(pictures)
    reports = numbered(spool, *(post(number=n, body=long(n)) for n in range(14)))
    spool.store_reports(reports)
    assert kept(spool, reports) == list(range(14))
    assert spool.take_evicted() == {pictures[0].spool_number}
    assert spool.take_evicted() == frozenset()
    assert (tmp_path / PICTURES_FILE).stat().st_size == 0


def test_of_reports_beyond_the_limit_the_first_are_stored(tmp_path: Path) -> None:
    spool = opened(tmp_path, 3000)
    reports = numbered(spool, *(post(number=n, body=long(n)) for n in range(5)))
    spool.store_reports(reports[:1])
    with pytest.raises(OSError, match="used up"):
        spool.store_reports(reports[1:])
    assert kept(spool, reports) == [0, 1]
    spool.close()
    assert (tmp_path / REPORTS_FILE).stat().st_size <= 3000
    assert left_in(opened(tmp_path)) == [0, 1]


def test_the_file_never_exceeds_the_limit(tmp_path: Path) -> None:
    spool = opened(tmp_path, 10_000)
    last: list[Post] = []
    for number in range(200):
        reports = numbered(spool, post(number=number, body={"n": number, "text": "x" * 1000}))
        spool.store_reports(reports)
        assert (tmp_path / REPORTS_FILE).stat().st_size <= 10_000
        spool.release(frozenset(one.spool_number or 0 for one in last))
        last = reports
    spool.close()
    assert [one.body["n"] for one in opened(tmp_path).take_inherited()] == [199]


def test_reports_evict_pictures_on_a_full_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spool = opened(tmp_path)
    pictures = numbered(spool, picture(0, 5000))
    spool.store_pictures(pictures)
    write = os.write

    def write_if_there_is_room(descriptor: int, reports: bytes) -> int:
        if (tmp_path / PICTURES_FILE).stat().st_size:
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(descriptor, reports)

    monkeypatch.setattr(os, "write", write_if_there_is_room)
    reports = numbered(spool, post(number=1))
    spool.store_reports(reports)
    assert kept(spool, reports) == [1]
    assert kept(spool, pictures) == []
    assert spool.take_evicted() == {pictures[0].spool_number}
